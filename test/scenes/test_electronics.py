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

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import PAPER_CHANNELS, PAPER_GROUPS
from slip_detector.scenes.electronics import Electronics, Frontend
from support.disturbance_cases import RefusingGenerator

PERIOD_S = 1 / 380.0
ACROSS = np.array(PAPER_GROUPS['TP'] + PAPER_GROUPS['TD']) - 1
ALONG = np.array(PAPER_GROUPS['LR'] + PAPER_GROUPS['LU']) - 1

#: Electronics that do nothing, to be given one part at a time.
NEAT = {'noise_v': 0.0, 'rails_v': [-1000.0, 1000.0]}

#: All that sampling can do, at once.
FULL = {'drift_v': 0.2, 'noise_v': 0.01, 'rails_v': [0.0, 5.0], 'adc_bits': 12}


def frontend(seed=0, **parameters):
    return Frontend(Electronics(**parameters), np.random.default_rng(seed))


def rows(n, low_v=-1.0, high_v=6.0):
    return np.random.default_rng(99).uniform(low_v, high_v, (n, PAPER_CHANNELS))


# The fingertip.


def test_a_fingertip_seed_stays_the_same_fingertip():
    # Channels 1 (across the finger) and 2 (along it) of fingertip 1, as they always were.
    one = frontend(shear_v_n=3.0)
    expected = [
        (one.baseline_v, [4.325591081235013, 4.347523184816296]),
        (one.normal_v_n, [-10.039722107481658, -9.707543249034911]),
        (one.shear_v_n, [2.8867184978619007, 1.8064157411238497]),
    ]
    for values, first_two in expected:
        np.testing.assert_allclose(values[:2], first_two, rtol=1e-12)


def test_the_trial_does_not_change_the_fingertip():
    one, other = frontend(1), frontend(2)
    for name in ('baseline_v', 'normal_v_n', 'shear_v_n'):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@given(st.floats(0, 1), st.floats(0, 1))
def test_units_along_the_finger_have_their_shares_of_the_sensitivities(normal, shear):
    whole = frontend(normal_along_share=1.0, shear_along_share=1.0)
    part = frontend(normal_along_share=normal, shear_along_share=shear)
    for name, share in (('normal_v_n', normal), ('shear_v_n', shear)):
        one, other = getattr(whole, name), getattr(part, name)
        np.testing.assert_array_equal(other[ACROSS], one[ACROSS])
        np.testing.assert_allclose(other[ALONG], share * one[ALONG], rtol=1e-12)


def test_without_spread_the_channels_of_a_group_are_alike():
    one = frontend(spread=0.0, normal_along_share=0.5, shear_v_n=3.0)
    assert set(one.normal_v_n[ACROSS]) == {-10.0}
    assert set(one.normal_v_n[ALONG]) == {-5.0}
    assert set(one.shear_v_n[ALONG]) == {1.5}


# Sampling as a whole.


@given(st.lists(st.integers(0, 60), max_size=12), st.integers(0, 9))
def test_any_cut_of_the_rows_gives_the_same_bits(cuts, seed):
    clean_v = rows(200)
    whole = frontend(seed, **FULL).sample(clean_v, PERIOD_S)
    one = frontend(seed, **FULL)
    pieces = [
        one.sample(piece, PERIOD_S) for piece in np.split(clean_v, np.cumsum(cuts, dtype=int))
    ]
    assert np.concatenate(pieces).tobytes() == whole.tobytes()


def test_sampling_leaves_the_clean_voltages_as_they_are():
    clean_v = rows(50)
    before = clean_v.copy()
    frontend(**FULL).sample(clean_v, PERIOD_S)
    frontend(**NEAT).sample(clean_v, PERIOD_S)[:] = 0.0
    np.testing.assert_array_equal(clean_v, before)


def test_leaving_out_drift_or_noise_leaves_the_bits_of_the_other():
    zero_v = np.zeros((300, PAPER_CHANNELS))
    drift = frontend(**{**NEAT, 'drift_v': 0.1}).sample(zero_v, PERIOD_S)
    noise = frontend(**{**NEAT, 'noise_v': 0.2}).sample(zero_v, PERIOD_S)
    both = frontend(**{**NEAT, 'drift_v': 0.1, 'noise_v': 0.2}).sample(zero_v, PERIOD_S)
    np.testing.assert_array_equal(both, drift + noise)


def test_nothing_is_drawn_for_parts_that_are_zero():
    clean_v = rows(20)
    neat = Frontend(Electronics(**NEAT), RefusingGenerator())
    np.testing.assert_array_equal(neat.sample(clean_v, PERIOD_S), clean_v)
    for part in ({'noise_v': 1e-3}, {'drift_v': 1e-3}):
        named = Frontend(Electronics(**{**NEAT, **part}), RefusingGenerator())
        with pytest.raises(AssertionError, match='something was drawn'):
            named.sample(clean_v, PERIOD_S)


# Noise and drift.


def test_the_noise_is_white_of_its_standard_deviation_and_differs_per_channel():
    noise = frontend(**{**NEAT, 'noise_v': 0.02}).sample(
        np.zeros((4000, PAPER_CHANNELS)), PERIOD_S
    )
    np.testing.assert_allclose(noise.std(0), 0.02, rtol=0.06)
    correlation = np.corrcoef(np.hstack([noise[1:], noise[:-1]]).T)
    assert np.abs(correlation - np.eye(len(correlation))).max() < 0.1


@pytest.mark.parametrize('rate_hz', [50.0, 400.0])
def test_the_variance_of_the_drift_grows_linearly_whatever_the_rate(rate_hz):
    zero_v = np.zeros((round(2 * rate_hz), PAPER_CHANNELS))
    walks = [
        frontend(seed, **{**NEAT, 'drift_v': 0.1}).sample(zero_v, 1 / rate_hz)
        for seed in range(100)
    ]
    deviation = np.hstack(walks).std(axis=1)
    for after_s in (0.5, 1.0, 2.0):
        # 1600 walks tell a standard deviation within 1.8 %; five times that is allowed.
        expected_v = 0.1 * np.sqrt(after_s)
        assert deviation[round(after_s * rate_hz) - 1] == pytest.approx(expected_v, rel=0.09)


def test_the_steps_of_the_drift_are_independent():
    walk = frontend(**{**NEAT, 'drift_v': 0.1}).sample(np.zeros((4000, PAPER_CHANNELS)), PERIOD_S)
    steps_v = np.diff(walk, axis=0)
    np.testing.assert_allclose(steps_v.std(0), 0.1 * np.sqrt(PERIOD_S), rtol=0.06)
    correlation = np.corrcoef(np.hstack([steps_v[1:], steps_v[:-1]]).T)
    assert np.abs(correlation - np.eye(len(correlation))).max() < 0.1


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
    one = frontend(noise_v=1e-3, rails_v=rails_v, adc_bits=bits)
    samples = one.sample(clean_v, PERIOD_S)
    assert samples.min() == low_v
    assert samples.max() == high_v
    assert np.all(samples[1] == low_v)
    assert np.all(samples[2] == high_v)


@given(st.integers(1, 32), st.floats(-5, 5), st.floats(0.1, 10), st.integers(0, 99))
def test_the_converter_rounds_to_the_nearest_of_its_codes(bits, low_v, range_v, seed):
    high_v = low_v + range_v
    inside_v = np.random.default_rng(seed).uniform(low_v, high_v, (20, PAPER_CHANNELS))
    one = frontend(noise_v=0.0, rails_v=(low_v, high_v), adc_bits=bits)
    samples = one.sample(inside_v, PERIOD_S)
    step_v = range_v / (2**bits - 1)
    round_off_v = 1e-14 * (abs(low_v) + range_v)
    assert np.abs(samples - inside_v).max() <= 0.5 * step_v * (1 + 1e-9) + round_off_v
    codes = (samples - low_v) / step_v
    assert np.abs(codes - np.rint(codes)).max() * step_v <= round_off_v
    np.testing.assert_array_equal(one.sample(samples, PERIOD_S), samples)


@pytest.mark.parametrize('bits', [1, 3, 8])
def test_the_converter_has_all_its_codes_and_no_other(bits):
    sweep_v = np.repeat(np.linspace(-0.5, 5.5, 3000)[:, np.newaxis], PAPER_CHANNELS, axis=1)
    samples = frontend(noise_v=0.0, adc_bits=bits).sample(sweep_v, PERIOD_S)
    assert len(np.unique(samples)) == 2**bits
    assert np.all(np.diff(samples, axis=0) >= 0.0)


# What is wrong is said in one line.


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({'adc_bits': 33}, 'parameter adc_bits is 33, allowed: 0 to 32'),
        ({'adc_bits': 12.5}, 'parameter adc_bits is 12.5, allowed: a whole number'),
        ({'drift_v': -1}, 'parameter drift_v is -1 V/sqrt(s), allowed: 0 to 100 V/sqrt(s)'),
        ({'bandwidth_hz': -1}, 'parameter bandwidth_hz is -1 Hz, allowed: 0 to 1e+09 Hz'),
        ({'normal_along_share': 2}, 'parameter normal_along_share is 2, allowed: 0 to 1'),
        ({'rails_v': [5, 5]}, 'parameter rails_v is [5, 5] V, allowed: low below high'),
        ({'baseline_v': [2, 1]}, 'parameter baseline_v is [2, 1] V, allowed: low not above high'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    with pytest.raises(ValueError, match=f'^{re.escape(said)}$'):
        Electronics(**parameters)
