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

"""The chain against 50 digits that share no line with it: where they agree both are right."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from mpmath import mpf

from benchmarks.chain import reference
from benchmarks.chain.command import WANTED
from benchmarks.chain.precision import RATES, errors_of, evidence_errors
from slip_detector.chain.filters import design
from slip_detector.parameters.chain import LOWEST_EDGE, ChainConfig


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


@pytest.mark.parametrize('rate_hz', RATES)
def test_the_chain_is_exact_at_every_rate_and_float32_and_polynomials_are_not(rate_hz):
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    # Both windows and something in them.
    rows = max(1000, 2 * config.samples(config.envelope_window_s) + 500)
    errors = errors_of(config, rows)['errors']
    own = errors.pop('chain')
    assert own <= WANTED['precision.rates_error'].high
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
