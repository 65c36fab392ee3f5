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

"""Sums of sines: their value and their rate at any instant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import NO_SINES, Sines, sines_at, sines_rate_at
from support.disturbance_cases import CUTS, check_closed_form, instants_s

SINES = st.lists(
    st.tuples(st.floats(-10, 10), st.floats(0, 1000), st.floats(0, 2 * np.pi)), max_size=5
).map(lambda rows: Sines(*np.array(rows).reshape(-1, 3).T.copy()))


@given(SINES, CUTS, st.floats(0, 4000))
def test_any_cut_of_the_times_and_one_instant_alone_give_the_same_bits(sines, cuts, start_s):
    check_closed_form(lambda t: sines_at(t, sines), cuts, start_s)
    check_closed_form(lambda t: sines_rate_at(t, sines), cuts, start_s)


@given(SINES, st.floats(-100, 100))
def test_the_sum_is_that_of_its_sines(sines, t):
    wanted = sum(a * np.sin(rate * t + phase) for a, rate, phase in zip(*sines, strict=True))
    assert sines_at(t, sines) == pytest.approx(wanted, abs=1e-9)


@given(SINES)
def test_an_array_of_the_fields_gives_the_same_bits(sines):
    t = instants_s(0.2)
    assert sines_at(t, np.array(sines)).tobytes() == sines_at(t, sines).tobytes()
    assert sines_rate_at(t, np.array(sines)).tobytes() == sines_rate_at(t, sines).tobytes()


@given(SINES, st.floats(0, 10))
def test_the_rate_is_the_derivative_of_the_sum(sines, start_s):
    # Slow enough for the difference of four places to be exact to some digits.
    slow = sines._replace(angular_rate_rad_s=sines.angular_rate_rad_s / 10)
    h, t = 1e-4, start_s + instants_s(0.2)
    x = [sines_at(t + k * h, slow) for k in (-2, -1, 1, 2)]
    slope = (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h)
    np.testing.assert_allclose(sines_rate_at(t, slow), slope, atol=1e-6)


def test_no_sines_are_nothing():
    t = instants_s(0.2)
    np.testing.assert_array_equal(sines_at(t, NO_SINES), 0.0)
    np.testing.assert_array_equal(sines_rate_at(t, NO_SINES), 0.0)
