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

"""The chain in 50 digits: that its digits are right, and that the chain comes close to it."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from mpmath import mpf
from scipy import signal

from benchmarks.chain import reference
from benchmarks.chain.command import WANTED
from benchmarks.chain.precision import RATES, errors_of, evidence_errors, tones_v
from slip_detector.chain.filters import design, response
from slip_detector.parameters.chain_checks import LOWEST_EDGE
from slip_detector.parameters.detector import ChainConfig

ORDINARY = [
    {},
    {'passband_degree': 8, 'stopband_degree': 2},
    {'passband_degree': 6, 'stopband_degree': 6, 'stopband_attenuation_db': 60.0},
    {'passband_hz': (10.0, 150.0), 'stopbands_hz': ()},
    {'passband_hz': (7.0, 0.0), 'passband_degree': 3},
    {'passband_hz': (7.0, 0.0), 'passband_degree': 4, 'stopbands_hz': ((45.0, 55.0),)},
    {'sample_rate_hz': 2000.0, 'stopband_degree': 10, 'stopband_ripple_db': 0.5},
]


def gains(sections, shares):
    """Return the network's complex gains in 50 digits at shares of the sample rate."""
    found = []
    with mpmath.workdps(reference.DIGITS):
        for share in shares:
            z = mpmath.expjpi(2 * mpf(share))
            gain = mpf(1)
            for b0, b1, b2, a1, a2 in sections:
                gain *= (z * (z * b0 + b1) + b2) / (z * (z + a1) + a2)
            found.append(gain)
    return found


@pytest.mark.parametrize('values', ORDINARY)
def test_the_reference_designs_the_filters_that_scipy_designs(values):
    config = ChainConfig(**values)
    frequency_hz = np.linspace(0.002, 0.498, 60) * config.sample_rate_hz
    mine = gains(reference.design(config), frequency_hz / config.sample_rate_hz)
    theirs = response(design(config), frequency_hz, config.sample_rate_hz)
    assert np.abs(np.array(mine, complex) - theirs).max() <= 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize('values', ORDINARY[:4])
def test_the_reference_has_the_gains_by_which_its_filters_are_defined(values):
    config = ChainConfig(**values)
    rate = mpf(config.sample_rate_hz)
    passband = reference.design(ChainConfig(**values | {'stopbands_hz': ()}))
    with mpmath.workdps(reference.DIGITS):
        half_power = config.gain * mpmath.sqrt(mpf(1) / 2)
        for gain in gains(passband, [mpf(edge) / rate for edge in config.passband_hz]):
            assert abs(abs(gain) / half_power - 1) < 1e-40
        ripple = mpf(10) ** (-mpf(config.stopband_ripple_db) / 20)
        for pair in config.stopbands_hz:
            one = reference.design(ChainConfig(**values | {'stopbands_hz': (pair,)}))
            for edge in pair:
                (gain,) = gains(one[len(passband) :], [mpf(edge) / rate])
                assert abs(abs(gain) / ripple - 1) < 1e-40


@pytest.mark.parametrize('values', ORDINARY)
def test_the_reference_runs_as_scipy_and_numpy_do(values):
    config = ChainConfig(**values)
    samples = tones_v(ChainConfig(), 400)[:, 0]
    filtered = reference.run_filter(reference.design(config), samples)
    envelope, level = reference.envelope_and_level(filtered, config)
    out = signal.sosfilt(design(config), samples - samples[0])
    assert np.allclose(np.array(filtered, float), out, rtol=0, atol=1e-12)
    window = np.ones(config.samples(config.envelope_window_s))
    window /= window.size
    wanted = np.sqrt(np.convolve(np.abs(out) ** 6, window)[:400])
    assert np.allclose(np.array(envelope, float), wanted, rtol=0, atol=1e-12 * wanted.max())
    wanted = np.convolve(wanted, window)[:400]
    assert np.allclose(np.array(level, float), wanted, rtol=0, atol=1e-12 * wanted.max())


def test_windows_of_the_reference_keep_nothing_of_a_huge_value():
    config = ChainConfig(exponent=6, envelope_window_s=2 / 380, decision_window_s=1 / 380)
    small = mpf(10) ** -20
    _, level = reference.envelope_and_level([small, mpf(10) ** 30, small, small], config)
    with mpmath.workdps(reference.DIGITS):
        assert abs(level[-1] / small**6 - 1) < 1e-45


@pytest.mark.parametrize('rate_hz', RATES)
def test_the_chain_is_exact_at_every_rate_and_float32_and_polynomials_are_not(rate_hz):
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    # Both windows and something in them.
    entry = errors_of(config, max(1000, 2 * config.samples(config.envelope_window_s) + 500))
    errors = entry['errors']
    own = errors.pop('chain')
    assert max(own, entry['run_error']) <= WANTED['precision.rates_error'].high
    assert min(errors.values()) >= 5 * own


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-5, -0.9),
    st.floats(-6, 0.5),
    st.sampled_from([1, 2, 3, 4, 10]),
    st.sampled_from(['pass', 'stop']),
)
def test_what_is_accepted_has_the_gain_it_should_have(low_power, width_power, order, kind):
    low = max(10**low_power, LOWEST_EDGE)
    pair = low, min(low * (1 + 10**width_power), 0.45)
    values = {'passband_hz': pair, 'passband_degree': 2 * order, 'stopbands_hz': ()}
    if kind == 'stop':
        values = {
            'passband_hz': (0.1, 0.4), 'stopbands_hz': (pair,), 'stopband_degree': 2 * order
        }  # fmt: skip
    config = ChainConfig(
        sample_rate_hz=1.0, channels=1, envelope_window_s=15.0, decision_window_s=15.0, **values
    )
    try:
        sections = design(config)
    except ValueError:
        reject()
    width = pair[1] - pair[0]
    shares = [float(share) for share in low + width * np.linspace(-0.2, 1.1, 14)]
    wanted = gains(reference.design(config), shares)
    found = gains(reference.exactly(sections), shares)
    largest = max(abs(gain) for gain in wanted)
    assert max(abs(a - b) for a, b in zip(wanted, found, strict=True)) <= 1e-6 * largest


@pytest.mark.parametrize(
    'values', [{}, {'noise_floor_learnt': True}, {'evidence_limit_db_s': 0.2}]
)
def test_the_chain_decides_by_the_evidence_of_the_reference(values):
    errors = evidence_errors(380.0, 600, **values)
    assert max(errors['floor_error_db'], errors['excess_error_db']) < 2e-5
    assert errors['level_error'] <= WANTED['precision.evidence_error'].high
    assert errors['differing_decisions'] == 0
