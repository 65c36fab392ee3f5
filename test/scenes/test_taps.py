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

"""Taps: half sines on the normal force, and nothing between them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import Taps, tap_force_at
from support.disturbance_cases import CUTS, check_closed_form, check_refused, instants_s


def tapped_n(taps, time_s):
    return tap_force_at(time_s, time_s, taps.numbers())


@given(CUTS, st.floats(0, 4000))
def test_any_cut_of_the_times_and_one_instant_alone_give_the_same_bits(cuts, start_s):
    tapping = Taps(times_s=[start_s + at_s for at_s in (0.1, 0.3, 0.52)])
    check_closed_form(lambda t: tapped_n(tapping, t), cuts, start_s)


@st.composite
def taps(draw):
    duration_s = draw(st.floats(1e-3, 0.05))
    gaps_s = draw(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=5))
    begins_s = np.cumsum(np.array(gaps_s) + duration_s * (1 + 1e-9))
    return Taps(times_s=begins_s, duration_s=duration_s, peak_force_n=draw(st.floats(-5, 5)))


@given(taps())
def test_taps_are_half_sines_and_nothing_outside_their_time(tapping):
    t = instants_s(2.0, 5000.0)
    force_n = tapped_n(tapping, t)
    expected_n = np.zeros(len(t))
    for begin_s in tapping.times_s:
        u = (t - begin_s) / tapping.duration_s
        inside = (u >= 0) & (u < 1)
        expected_n[inside] = tapping.peak_force_n * np.sin(np.pi * u[inside])
    np.testing.assert_allclose(force_n, expected_n, atol=1e-9)
    np.testing.assert_array_equal(force_n[expected_n == 0.0], 0.0)


def test_a_tap_has_its_impulse_and_its_peak():
    tapping = Taps(times_s=[0.2, 0.21], duration_s=0.01, peak_force_n=3.0)
    t = instants_s(0.5, 1e5)
    force_n = tapped_n(tapping, t)
    assert np.sum(force_n) / 1e5 == pytest.approx(2 * (2 / np.pi * 3.0 * 0.01), rel=1e-5)
    assert force_n.max() == pytest.approx(3.0)
    assert force_n.min() >= 0.0
    assert not force_n[(t < 0.2 - 1e-9) | (t > 0.22 + 1e-9)].any()


def test_at_the_ends_of_a_tap_the_side_says_what_is_meant():
    numbers = Taps(times_s=[0.25], duration_s=0.5, peak_force_n=2.0).numbers()
    assert tap_force_at(0.75, 0.8, numbers) == 0.0
    assert tap_force_at(0.75, 0.5, numbers) == pytest.approx(0.0, abs=1e-15)
    assert tap_force_at(0.5, 0.7, numbers) == 2.0
    assert tap_force_at(0.5, 0.1, numbers) == 0.0


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({}, 'parameter times_s is empty, allowed: at least one time'),
        (
            {'times_s': [2, 1]},
            'parameter times_s has 1 s after 2 s, allowed: rising, at least duration_s, 0.01 s, '
            'apart',
        ),
        (
            {'times_s': [1, 1.05], 'duration_s': 0.1},
            'parameter times_s has 1.05 s after 1 s, allowed: rising, at least duration_s, 0.1 s, '
            'apart',
        ),
        ({'times_s': [-1]}, 'parameter times_s is -1 s, allowed: at least one, rising'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Taps, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Taps(times_s=[1.0])
    assert type(part).from_parameters(part.to_parameters()) == part
