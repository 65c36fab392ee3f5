# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Rolling: there and back along a smooth way, exactly at rest before and after."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.rolling import Rolling, rolled_at
from support.disturbance_cases import CUTS, check_closed_form, check_refused, instants_s


def rolled_m(rolling, time_s):
    """Return how far the centre of contact has moved, shape (n, 2)."""
    return np.transpose(rolled_at(time_s, rolling.numbers()))


@given(CUTS, st.floats(0, 4000))
def test_any_cut_of_the_times_and_one_instant_alone_give_the_same_bits(cuts, start_s):
    rolling = Rolling(start_s=start_s + 0.1, duration_s=0.1, hold_s=0.03, repeats=2)
    check_closed_form(lambda t: rolled_m(rolling, t), cuts, start_s)


ROLLING = st.builds(
    Rolling,
    start_s=st.floats(0, 2),
    duration_s=st.floats(0.05, 1),
    hold_s=st.floats(0, 0.5),
    distance_m=st.tuples(st.floats(-5e-3, 5e-3), st.floats(-5e-3, 5e-3)),
    repeats=st.integers(1, 7),
)


@given(ROLLING)
def test_rolling_goes_to_the_far_end_and_returns_each_time(rolling):
    there_s = rolling.start_s + rolling.duration_s
    back_s = there_s + rolling.hold_s + rolling.duration_s
    cycle_s = 2 * (rolling.duration_s + rolling.hold_s)
    cycles_s = cycle_s * np.arange(rolling.repeats)
    rests_s = np.linspace(0, rolling.hold_s, 5)
    for rest_s in rests_s:
        far_m = rolled_m(rolling, there_s + rest_s + cycles_s)
        np.testing.assert_allclose(far_m, np.tile(rolling.distance_m, (len(far_m), 1)), atol=1e-12)
        np.testing.assert_allclose(rolled_m(rolling, back_s + rest_s + cycles_s), 0.0, atol=1e-12)
    end_s = rolling.start_s + rolling.repeats * cycle_s
    outside_s = np.concatenate([np.linspace(0, rolling.start_s, 20), end_s + np.arange(20) / 7])
    np.testing.assert_array_equal(rolled_m(rolling, outside_s), 0.0)


@given(ROLLING)
def test_rolling_has_no_jump_in_position_or_velocity(rolling):
    h = 1e-5
    t = instants_s(
        rolling.start_s + 2 * rolling.repeats * (rolling.duration_s + rolling.hold_s) + 1
    )
    velocity_m_s = np.diff([rolled_m(rolling, t + k * h) for k in (-1, 0, 1)], axis=0) / h
    # 3 u^2 - 2 u^3 has a slope of at most 3/2 and a curvature of at most 6.
    distance_m = np.abs(rolling.distance_m)
    assert np.all(np.abs(velocity_m_s) <= 1.5 * distance_m / rolling.duration_s + 1e-9)
    change_m_s = np.abs(velocity_m_s[1] - velocity_m_s[0])
    assert np.all(change_m_s <= 6 * distance_m * h / rolling.duration_s**2 + 1e-9)


@given(ROLLING)
def test_between_its_corners_rolling_is_a_cubic(rolling):
    end_s = rolling.start_s + 2 * rolling.repeats * (rolling.duration_s + rolling.hold_s) + 1.0
    corners_s = rolling.corners_s(end_s)
    edges_s = np.unique([0.0, *corners_s, end_s])
    for from_s, to_s in itertools.pairwise(edges_s):
        within_m = rolled_m(rolling, np.linspace(from_s, to_s, 9)[1:-1])
        np.testing.assert_allclose(np.diff(within_m, 4, axis=0), 0.0, atol=1e-12)
    # A scene that ends before need not know the others.
    early_s = rolling.corners_s(rolling.start_s + 1e-6)
    np.testing.assert_array_equal(early_s, corners_s[:4])
    assert not len(rolling.corners_s(rolling.start_s - 1e-6))


def test_rolling_moves_along_a_straight_line():
    rolling = Rolling(distance_m=[1e-3, -2e-3])
    x, y = rolled_m(rolling, instants_s(3.0)).T
    np.testing.assert_allclose(y, -2 * x)
    assert np.all(np.diff(x[(instants_s(3.0) > 1.0) & (instants_s(3.0) < 1.5)]) > 0.0)


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({'distance_m': [1e-3]}, 'parameter distance_m has 1 numbers, allowed: 2'),
        ({'repeats': 0}, 'parameter repeats is 0, allowed: 1 to 1e+06'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Rolling, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Rolling()
    assert type(part).from_parameters(part.to_parameters()) == part
