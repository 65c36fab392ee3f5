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

"""Hum, tremor, taps and rolling: their lines, their ways, and nothing outside their time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import (
    TREMOR_PEAK,
    Hum,
    Rolling,
    Taps,
    Tremor,
    rolled_at,
    sines_at,
    sines_rate_at,
    tap_force_at,
)

SINES = st.lists(
    st.tuples(st.floats(-10, 10), st.floats(0, 100), st.floats(0, 2 * np.pi)), max_size=5
).map(lambda rows: np.array(rows).reshape(-1, 3).T.copy())


@given(SINES, st.floats(-100, 100))
def test_the_rate_of_a_sum_of_sines(sines, t):
    rate = (sines[0] * sines[1]) @ np.cos(sines[1] * t + sines[2])
    assert sines_rate_at(t, sines) == pytest.approx(rate, abs=1e-7)


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
    volts = sines_at(np.arange(1000) / 1000.0, hum.sines(np.random.default_rng(seed)))
    expected = np.zeros(501)
    expected[frequency_hz] = amplitude_v
    for number, relative in enumerate(harmonics, start=2):
        expected[number * frequency_hz] = relative * amplitude_v
    np.testing.assert_allclose(2 * np.abs(np.fft.rfft(volts)) / 1000, expected, atol=1e-9)


@given(st.floats(0.1, 30), st.floats(1.001, 30), st.integers(0, 999))
def test_tremor_lies_in_its_band_with_its_rms_and_below_its_peak(low_hz, ratio, seed):
    tremor = Tremor(low_hz=low_hz, high_hz=low_hz * ratio)
    amplitude, rate_rad_s, _ = tremor.sines(0.3, np.random.default_rng(seed))
    frequency_hz = rate_rad_s / (2 * np.pi)
    assert np.all((frequency_hz > tremor.low_hz) & (frequency_hz < tremor.high_hz))
    # Lines of different frequencies add their powers.
    assert len(set(frequency_hz)) == len(frequency_hz)
    assert np.sqrt(np.sum(amplitude**2) / 2) == pytest.approx(0.3, rel=1e-12)
    assert np.sum(amplitude) <= TREMOR_PEAK * 0.3


@st.composite
def taps(draw):
    duration_s = draw(st.floats(1e-3, 0.05))
    gaps_s = draw(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=5))
    begins_s = np.cumsum(np.array(gaps_s) + duration_s * (1 + 1e-9))
    return Taps(times_s=begins_s, duration_s=duration_s, peak_force_n=draw(st.floats(-5, 5)))


@given(taps())
def test_taps_are_half_sines_and_nothing_outside_their_time(tapping):
    t = np.arange(10_000) / 5000.0
    force_n = tap_force_at(t, tapping.numbers())
    expected_n = np.zeros(len(t))
    for begin_s in tapping.times_s:
        u = (t - begin_s) / tapping.duration_s
        inside = (u >= 0) & (u < 1)
        expected_n[inside] = tapping.peak_force_n * np.sin(np.pi * u[inside])
    np.testing.assert_allclose(force_n, expected_n, atol=1e-9)
    np.testing.assert_array_equal(force_n[expected_n == 0.0], 0.0)


ROLLING = st.builds(
    Rolling,
    start_s=st.floats(0, 2),
    duration_s=st.floats(0.05, 1),
    hold_s=st.floats(0, 0.5),
    distance_m=st.tuples(st.floats(-5e-3, 5e-3), st.floats(-5e-3, 5e-3)),
    repeats=st.integers(1, 7),
)


def rolled_m(rolling, time_s):
    """Return how far the centre of contact has moved, shape (n, 2)."""
    return np.transpose(rolled_at(time_s, rolling.numbers()))


@given(ROLLING)
def test_rolling_goes_to_the_far_end_and_returns_each_time(rolling):
    there_s = rolling.start_s + rolling.duration_s
    back_s = there_s + rolling.hold_s + rolling.duration_s
    cycle_s = 2 * (rolling.duration_s + rolling.hold_s)
    cycles_s = cycle_s * np.arange(rolling.repeats)
    for rest_s in np.linspace(0, rolling.hold_s, 5):
        far_m = rolled_m(rolling, there_s + rest_s + cycles_s)
        np.testing.assert_allclose(far_m, np.tile(rolling.distance_m, (len(far_m), 1)), atol=1e-12)
        np.testing.assert_allclose(rolled_m(rolling, back_s + rest_s + cycles_s), 0.0, atol=1e-12)
    end_s = rolling.start_s + rolling.repeats * cycle_s
    outside_s = np.concatenate([np.linspace(0, rolling.start_s, 20), end_s + np.arange(20) / 7])
    np.testing.assert_array_equal(rolled_m(rolling, outside_s), 0.0)
