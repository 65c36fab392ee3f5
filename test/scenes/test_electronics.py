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

"""The electronics: what drift, noise, rails and converter make of clean voltages."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters import PAPER_CHANNELS, PAPER_GROUPS
from slip_detector.scenes.electronics import (
    CONTACT_N,
    SENSOR_PITCH_M,
    UNIT_RADIUS_M,
    ContactNoise,
    Electronics,
    Faults,
    Frontend,
    taxel_positions,
)
from slip_detector.scenes.parts import spawn_parts

ACROSS = np.array(PAPER_GROUPS['TP'] + PAPER_GROUPS['TD']) - 1
ALONG = np.array(PAPER_GROUPS['LR'] + PAPER_GROUPS['LU']) - 1

#: Electronics that do nothing, to be given one part at a time.
NEAT = {'noise_v': 0.0, 'rails_v': [-1000.0, 1000.0]}


def frontend(seed=0, rate_hz=380.0, parts=(), **parameters):
    children = spawn_parts(np.random.default_rng(seed))
    return Frontend({'electronics': Electronics(**parameters), **dict(parts)}, children, rate_hz)


def sampled(clean_v, force_n=0.0, **values):
    """Return samples of clean voltages, without the baselines, and their times."""
    rate_hz = values.get('rate_hz', 380.0)
    time_s = np.arange(len(clean_v)) / rate_hz
    return frontend(**{'baseline_v': (0.0, 0.0), **values}).sample(
        clean_v, time_s, np.full(len(clean_v), force_n)
    )


# The fingertip.


def as_set(points):
    return {tuple(np.round(np.multiply(point, 1e9)).astype(int)) for point in points}


def test_each_group_of_table_1_is_where_its_name_says_on_crosses_of_four_units():
    half_m, r = SENSOR_PITCH_M / 2, UNIT_RADIUS_M
    sensors = taxel_positions().reshape(4, 4, 2)
    offsets = sensors - sensors.mean(axis=1, keepdims=True)
    for units in offsets:
        assert as_set(units) == as_set([(-r, 0), (r, 0), (0, -r), (0, r)])
    # Distal is towards the tip (y), radial along x.
    middles = {'TD': (0, half_m), 'TP': (0, -half_m), 'LR': (half_m, 0), 'LU': (-half_m, 0)}
    for name, group in PAPER_GROUPS.items():
        members = np.array(group) - 1
        middle = taxel_positions()[members].mean(axis=0)
        np.testing.assert_allclose(middle, middles[name], atol=1e-12)
        along = offsets.reshape(16, 2)[members, 0 if name.startswith('T') else 1]
        np.testing.assert_allclose(np.abs(along), r)


def test_units_along_the_finger_have_their_share_of_the_sensitivity():
    whole, part = (frontend(shear_along_share=share).shear_v_n for share in (1.0, 0.3))
    np.testing.assert_array_equal(part[ACROSS], whole[ACROSS])
    np.testing.assert_allclose(part[ALONG], 0.3 * whole[ALONG], rtol=1e-12)


# Noise and drift.


def test_the_noise_is_white_of_its_standard_deviation_and_differs_per_channel():
    noise = sampled(np.zeros((4000, PAPER_CHANNELS)), **{**NEAT, 'noise_v': 0.02})
    np.testing.assert_allclose(noise.std(0), 0.02, rtol=0.06)
    correlation = np.corrcoef(np.hstack([noise[1:], noise[:-1]]).T)
    assert np.abs(correlation - np.eye(len(correlation))).max() < 0.1


@pytest.mark.parametrize('rate_hz', [50.0, 400.0])
def test_the_variance_of_the_drift_grows_linearly_whatever_the_rate(rate_hz):
    zero_v = np.zeros((round(2 * rate_hz), PAPER_CHANNELS))
    walks = [
        sampled(zero_v, seed=seed, rate_hz=rate_hz, **{**NEAT, 'drift_v': 0.1})
        for seed in range(100)
    ]
    deviation = np.hstack(walks).std(axis=1)
    for after_s in (0.5, 1.0, 2.0):
        # 1600 walks tell a standard deviation within 1.8 %; five times that is allowed.
        expected_v = 0.1 * np.sqrt(after_s)
        assert deviation[round(after_s * rate_hz) - 1] == pytest.approx(expected_v, rel=0.09)


# Contact noise.


def contact_noise(clean_v, force_n, **parameters):
    """Return the noise alone, at 380 Hz."""
    parts = {'contact_noise': ContactNoise(**parameters)}
    return sampled(clean_v, force_n, **NEAT, parts=parts) - clean_v


@given(st.floats(0.0, 0.05))
def test_what_is_touched_makes_noise_and_what_is_not_makes_none(force_n):
    noise = contact_noise(np.zeros((1000, PAPER_CHANNELS)), force_n, noise_v=0.02)
    full_v = 0.02 * min(force_n / CONTACT_N, 1.0)
    np.testing.assert_allclose(noise.std(0), full_v, rtol=0.12, atol=1e-12)
    spectrum = np.abs(np.fft.rfft(noise, axis=0)) ** 2  # white: as much in either half
    low, high = spectrum[1:251].sum(), spectrum[251:501].sum()
    assert force_n < 1e-6 or low == pytest.approx(high, rel=0.15)


@settings(max_examples=30)
@given(st.floats(-10, 20), st.floats(0, 2), st.sampled_from([1.0, 12.65, 80.0]))
def test_contact_noise_grows_with_activity_in_its_band_above_the_knee(above_db, growth, hz):
    knee_v, time_s = 1e-3, np.arange(2280) / 380.0
    rms_v = knee_v * 10 ** (above_db / 20)
    swing_v = np.sqrt(2) * rms_v * np.sin(2 * np.pi * hz * time_s)[:, np.newaxis]
    noise = contact_noise(
        swing_v * np.ones(PAPER_CHANNELS), 1.0, noise_v=1e-4, knee_v=knee_v, growth=growth
    )
    # Of the sines beside the band its skirts leave less than a tenth.
    grown_db = growth * max(above_db, 0.0) if hz == 12.65 else 0.0
    assert 20 * np.log10(noise[760:].std() / 1e-4) == pytest.approx(grown_db, abs=0.5)


# Rails and converter.

RAILS = st.tuples(st.floats(-1000, 999), st.floats(1e-6, 1000)).map(
    lambda pair: (pair[0], min(pair[0] + pair[1], 1000.0))
)


@given(RAILS, st.integers(0, 32), st.lists(st.floats(-1e308, 1e308), min_size=1, max_size=16))
def test_samples_stay_within_the_rails_and_show_them_exactly(rails_v, bits, volts):
    low_v, high_v = rails_v
    clean_v = np.full((3, PAPER_CHANNELS), low_v)
    clean_v[0, : len(volts)] = volts
    clean_v[1], clean_v[2] = -np.inf, np.inf
    samples = sampled(clean_v, noise_v=1e-3, rails_v=rails_v, adc_bits=bits)
    assert samples.min() == low_v
    assert samples.max() == high_v
    assert np.all(samples[1] == low_v)
    assert np.all(samples[2] == high_v)


@given(st.integers(1, 32), st.floats(-5, 5), st.floats(0.1, 10), st.integers(0, 99))
def test_the_converter_rounds_to_the_nearest_of_its_codes(bits, low_v, range_v, seed):
    high_v = low_v + range_v
    inside_v = np.random.default_rng(seed).uniform(low_v, high_v, (20, PAPER_CHANNELS))
    converter = {'noise_v': 0.0, 'rails_v': (low_v, high_v), 'adc_bits': bits}
    samples = sampled(inside_v, **converter)
    step_v = range_v / (2**bits - 1)
    round_off_v = 1e-14 * (abs(low_v) + range_v)
    assert np.abs(samples - inside_v).max() <= 0.5 * step_v * (1 + 1e-9) + round_off_v
    codes = (samples - low_v) / step_v
    assert np.abs(codes - np.rint(codes)).max() * step_v <= round_off_v
    np.testing.assert_array_equal(sampled(samples, **converter), samples)


# Faults.


@given(st.floats(0, 0.7))
def test_channels_fail_from_their_time_on_and_the_others_never(from_s):
    clean_v = 4.0 + 0.1 * np.sin(np.arange(228.0))[:, np.newaxis] * np.ones(PAPER_CHANNELS)
    faults = Faults(from_s=from_s, dead_channels=[3, 16])
    rails = {'rails_v': (0.5, 5.0)}
    sound, faulty = sampled(clean_v, **rails), sampled(clean_v, parts={'faults': faults}, **rails)
    failed = np.arange(228) / 380.0 >= from_s
    np.testing.assert_array_equal(faulty[~failed], sound[~failed])
    failing = np.isin(np.arange(1, 17), [3, 16])
    np.testing.assert_array_equal(faulty[:, ~failing], sound[:, ~failing])
    assert np.all(faulty[failed][:, failing] == 0.5)
