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

"""Hum: at its frequency and harmonics, with their amplitudes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import Hum, HumVoltage
from support.disturbance_cases import (
    CUTS,
    check_closed_form,
    check_refused,
    instants_s,
    spectrum,
    trial,
)


@given(CUTS, st.integers(0, 99), st.floats(0, 4000))
def test_any_cut_of_the_times_and_one_instant_alone_give_the_same_bits(cuts, seed, start_s):
    check_closed_form(HumVoltage(Hum(harmonics=[0.3, 0.0, 0.1]), trial(seed)).volts, cuts, start_s)


def test_an_hour_later_hum_is_as_exact_as_at_the_start():
    # Against the same lines with the whole turns taken out in integers first.
    t_ms = 3_600_000 + np.arange(1000)
    hum = HumVoltage(Hum(amplitude_v=1.0), trial())
    turns_ms = t_ms % 20
    expected = np.sin(2 * np.pi * turns_ms / 20 + hum.sines.phase_rad[0])
    np.testing.assert_allclose(hum.volts(t_ms / 1000), expected, atol=1e-8)


@given(
    st.integers(16, 60),
    st.floats(1e-4, 1),
    st.lists(st.floats(0, 1), max_size=3),
    st.integers(0, 99),
)
def test_hum_is_at_its_frequency_and_harmonics_with_their_amplitudes(
    frequency_hz, amplitude_v, harmonics, seed
):
    hum = Hum(frequency_hz=frequency_hz, amplitude_v=amplitude_v, harmonics=harmonics)
    volts = HumVoltage(hum, trial(seed)).volts(instants_s(1.0, 1000.0))
    assert volts.shape == (1000,)  # One for all channels.
    expected = np.zeros(501)
    expected[frequency_hz] = amplitude_v
    for number, relative in enumerate(harmonics, start=2):
        expected[number * frequency_hz] = relative * amplitude_v
    np.testing.assert_allclose(spectrum(volts, 1000.0)[1], expected, atol=1e-9)


def test_hum_has_another_phase_in_another_trial():
    t = instants_s(0.5)
    one, same, other = (HumVoltage(Hum(), trial(seed)).volts(t) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 1e-3


def test_a_harmonic_more_leaves_the_fundamental_as_it_is():
    t = instants_s(1.0, 1000.0)
    plain = HumVoltage(Hum(), trial()).volts(t)
    more = HumVoltage(Hum(harmonics=[0.5]), trial()).volts(t)
    difference = spectrum(more - plain, 1000.0)[1]
    assert difference[100] == pytest.approx(0.5 * 5e-3)
    assert np.delete(difference, 100).max() < 1e-12


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({'frequency_hz': 0}, 'parameter frequency_hz is 0 Hz, allowed: 1 to 1000 Hz'),
        ({'harmonics': [0.1, -1]}, 'parameter harmonics is -1, allowed: 0 to 10'),
        ({'harmonics': 0.1}, 'parameter harmonics is 0.1, allowed: a list'),
        ({'hz': 50}, 'unknown parameter hz = 50; allowed: amplitude_v, frequency_hz, harm'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Hum, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Hum(harmonics=[0.5])
    assert type(part).from_parameters(part.to_parameters()) == part
