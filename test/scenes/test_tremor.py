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

"""Tremor: in its band, with the RMS that is asked for, the same in any cut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import (
    TREMOR_PEAK,
    HandMotion,
    Tremor,
    sines_at,
    sines_rate_at,
)
from support.disturbance_cases import (
    CUTS,
    RefusingGenerator,
    check_closed_form,
    check_refused,
    instants_s,
    spectrum,
    trial,
)


@given(CUTS, st.integers(0, 99), st.floats(0, 4000))
def test_any_cut_of_the_times_and_one_instant_alone_give_the_same_bits(cuts, seed, start_s):
    hand = HandMotion(Tremor(), trial(seed))
    check_closed_form(lambda t: sines_at(t, hand.force_sines), cuts, start_s)
    check_closed_form(lambda t: sines_at(t, hand.motion_sines), cuts, start_s)
    check_closed_form(lambda t: sines_rate_at(t, hand.motion_sines), cuts, start_s)


@given(st.integers(0, 999))
def test_tremor_is_never_above_its_peak(seed):
    sines = HandMotion(Tremor(force_rms_n=0.3), trial(seed)).force_sines
    assert np.sum(sines.amplitude) <= TREMOR_PEAK * 0.3


@given(st.floats(0.1, 30), st.floats(1.001, 30), st.integers(0, 999))
def test_tremor_lies_in_its_band_with_the_rms_asked_for(low_hz, ratio, seed):
    tremor = Tremor(low_hz=low_hz, high_hz=low_hz * ratio, force_rms_n=0.3, motion_rms_m=2e-5)
    hand = HandMotion(tremor, trial(seed))
    for lines, rms in ((hand.force_sines, 0.3), (hand.motion_sines, 2e-5)):
        frequency_hz = lines.angular_rate_rad_s / (2 * np.pi)
        assert np.all((frequency_hz > tremor.low_hz) & (frequency_hz < tremor.high_hz))
        assert len(set(frequency_hz)) == len(frequency_hz)
        # Lines of different frequencies add their powers.
        assert np.sqrt(np.sum(lines.amplitude**2) / 2) == pytest.approx(rms, rel=1e-12)


@pytest.mark.parametrize('seed', range(3))
def test_in_the_long_run_tremor_has_the_rms_and_the_band_asked_for(seed):
    hand = HandMotion(Tremor(force_rms_n=0.3, motion_rms_m=2e-5), trial(seed))
    t = instants_s(2000.0, 100.0)
    for values, rms in (
        (sines_at(t, hand.force_sines), 0.3),
        (sines_at(t, hand.motion_sines), 2e-5),
    ):
        assert np.sqrt(np.mean(values**2)) == pytest.approx(rms, rel=0.01)
        hz, amplitude = spectrum(values * np.hanning(len(t)), 100.0)
        outside = (hz < 1.9) | (hz > 20.1)
        assert np.sum(amplitude[outside] ** 2) < 1e-4 * np.sum(amplitude**2)


def test_tremor_beats_slowly():
    hand = HandMotion(Tremor(force_rms_n=0.3), trial())
    t = instants_s(200.0, 100.0)
    # RMS over 2 s, the longest period of the band four times.
    over_2s = np.sqrt(np.mean(sines_at(t, hand.force_sines).reshape(-1, 200) ** 2, axis=1))
    assert over_2s.max() > 1.3 * over_2s.min()


@given(st.integers(0, 999), st.floats(0, 100))
def test_the_velocity_of_tremor_is_the_derivative_of_its_position(seed, start_s):
    hand = HandMotion(Tremor(motion_rms_m=1e-3), trial(seed))
    h, t = 1e-4, start_s + instants_s(0.5)
    x = [sines_at(t + k * h, hand.motion_sines) for k in (-2, -1, 1, 2)]
    slope_m_s = (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h)
    np.testing.assert_allclose(sines_rate_at(t, hand.motion_sines), slope_m_s, atol=1e-9)


def test_force_and_motion_of_tremor_are_independent_of_each_other():
    t = instants_s(0.5)
    both = HandMotion(Tremor(), trial())
    force = HandMotion(Tremor(motion_rms_m=0.0), trial())
    motion = HandMotion(Tremor(force_rms_n=0.0), trial())
    np.testing.assert_array_equal(sines_at(t, force.force_sines), sines_at(t, both.force_sines))
    np.testing.assert_array_equal(sines_at(t, motion.motion_sines), sines_at(t, both.motion_sines))
    assert not sines_at(t, force.motion_sines).any()
    assert not sines_rate_at(t, force.motion_sines).any()
    assert not sines_at(t, motion.force_sines).any()
    assert not set(both.force_sines.phase_rad) & set(both.motion_sines.phase_rad)


def test_nothing_is_drawn_for_a_tremor_that_is_zero():
    HandMotion(Tremor(force_rms_n=0.0, motion_rms_m=0.0), RefusingGenerator())
    for part in ({'force_rms_n': 0.0}, {'motion_rms_m': 0.0}):
        with pytest.raises(AssertionError, match='something was drawn'):
            HandMotion(Tremor(**part), RefusingGenerator())


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        (
            {'low_hz': 20, 'high_hz': 2},
            'parameter high_hz is 2 Hz, allowed: above low_hz, 20 Hz',
        ),
        ({'force_rms_n': -1}, 'parameter force_rms_n is -1 N, allowed: 0 to 100 N'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Tremor, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Tremor()
    assert type(part).from_parameters(part.to_parameters()) == part
