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

"""The error of the chain and of its rivals against 50 digits."""

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from benchmarks.chain import precision, reference
from benchmarks.chain.precision import RATES, WANTED, errors_of
from benchmarks.chain.rivals import WITH_RUNNING_SUMS
from slip_detector.chain.filters import design
from slip_detector.parameters.chain_checks import LOWEST_EDGE
from slip_detector.parameters.detector import ChainConfig
from support.benchmarks import gains, keys_of


@pytest.mark.parametrize('rate_hz', RATES)
def test_the_chain_is_exact_at_every_rate(rate_hz):
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    # Both windows and something in them.
    entry = errors_of(config, max(1000, 2 * config.samples(config.envelope_window_s) + 500))
    chain = entry['methods']['chain']
    assert chain['error'] <= WANTED['rates.error'].high
    assert chain['envelope_error'] <= WANTED['rates.error'].high
    assert entry['run_error'] <= WANTED['rates.error'].high
    assert chain['differing_decisions'] == 0
    assert chain['state'] == ''
    for name in ('sections float32', 'polynomials float64', 'polynomials float32'):
        rival = entry['methods'][name]
        assert rival['state'] or rival['error'] >= 5 * chain['error'], name


def test_polynomials_and_float32_are_lost_at_rates_where_the_chain_is_not(chain_precision):
    methods = next(entry for entry in chain_precision['rates'] if entry['sample_rate_hz'] == 1e4)
    methods = methods['methods']
    assert methods['chain']['error'] < 1e-10
    assert methods['polynomials float64']['error'] > 1e-8
    assert methods['sections float32']['error'] > 1e-4
    assert methods['polynomials float32']['state'] == 'unstable'
    assert methods['polynomials float32']['differing_decisions'] > 0


def test_every_accepted_edge_is_exact_and_what_is_refused_says_so_first(chain_precision):
    taken = [entry for entry in chain_precision['edges'] if not entry['refused']]
    refused = [entry for entry in chain_precision['edges'] if entry['refused']]
    assert {entry['network'] for entry in taken} == {entry['network'] for entry in refused}
    assert min(entry['edge_share'] for entry in taken) == LOWEST_EDGE
    for entry in taken:
        chain, *_, polynomials = (
            entry['methods'][name] for name in ('chain', 'polynomials float64')
        )
        assert chain['error'] <= WANTED['edges.error'].high
        assert chain['differing_decisions'] == 0
        assert polynomials['error'] > 100 * chain['error']
    for entry in refused:
        assert entry['edge_share'] < LOWEST_EDGE
        assert 'allowed: ' in entry['refused']
        assert '\n' not in entry['refused']
        assert entry['methods'] == {}


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


def test_the_error_does_not_grow_with_the_rows(chain_precision):
    errors = chain_precision['long_run']['methods']['chain']['errors']
    assert len(errors) == len(chain_precision['long_run']['rows']) >= 2
    assert max(errors) <= WANTED['long_run.error'].high


def test_every_key_is_documented(chain_precision):
    names = {*WITH_RUNNING_SUMS, 'value', 'bound', 'met'}
    for key in keys_of(chain_precision) - names:
        assert f'``{key}``' in precision.__doc__, key


def test_the_claims_are_the_chains_worst_errors(chain_precision):
    assert set(chain_precision['wanted']) == set(WANTED)
    rates = [entry['methods']['chain']['error'] for entry in chain_precision['rates']]
    assert chain_precision['wanted']['rates.error']['value'] == max(rates)
    for name, entry in chain_precision['wanted'].items():
        assert entry['met'] is WANTED[name].met(entry['value'])
