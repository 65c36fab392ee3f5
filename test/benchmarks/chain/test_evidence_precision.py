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

"""The error of the decision by evidence against 50 digits."""

import pytest

from benchmarks.chain.evidence_precision import evidence_config, slide_v
from benchmarks.chain.precision import WANTED
from benchmarks.chain.reference import evidence, exactly, run_filter
from slip_detector.chain.filters import design
from slip_detector.chain.logarithms import DECIBEL_ERROR
from slip_detector.chain.slip_chain import SlipChain


def test_the_chain_gives_floor_excess_and_evidence_of_the_reference(chain_precision):
    rates = chain_precision['evidence']['rates']
    assert [entry['sample_rate_hz'] for entry in rates] == [50.0, 380.0, 1e4]
    for entry in rates:
        assert 0 < entry['floor_error_db'] <= 2 * DECIBEL_ERROR
        assert 0 < entry['excess_error_db'] <= 2 * DECIBEL_ERROR
        assert 0 < entry['level_error'] <= WANTED['evidence.level_error'].high
        assert entry['differing_decisions'] == 0
        # There is something to err about.
        assert entry['largest_level'] > 0.1


def test_the_logarithms_error_is_what_is_said_of_it(chain_precision):
    error_db = chain_precision['evidence']['logarithm_error_db']
    assert 0.9 * DECIBEL_ERROR < error_db <= DECIBEL_ERROR


def test_floor_and_evidence_hardly_drift(chain_precision):
    for entry in chain_precision['evidence']['slides']:
        assert entry['evidence_db_s'] == pytest.approx(
            9.5 * entry['rows'] / entry['sample_rate_hz']
        )
        assert entry['floor_drift_db'] < 1e-6
        assert entry['drift_db_s'] < 1e-6


def test_extreme_inputs_stay_finite_and_within_bounds(chain_precision):
    cases = chain_precision['evidence']['extremes']
    assert len(cases) >= 8
    assert all(one['finite'] for one in cases)
    assert not any('NOT' in one['found'] for one in cases)
    assert 'refused: parameter noise_floor is 0' in cases[-1]['found']


@pytest.mark.parametrize('values', [{'noise_floor_learnt': True}, {'evidence_limit_db_s': 0.2}])
def test_the_reference_of_50_digits_is_the_chain_in_other_configurations(values):
    config = evidence_config(380.0, mains_hz=0.0, **values)
    samples = slide_v(600)
    filtered = run_filter(exactly(design(config)), samples)
    floors, excesses, levels, _ = evidence(filtered, config)
    result = SlipChain(config).update(samples[:, None], floor=True, excess=True)
    for found, wanted in ((result.floor, floors), (result.excess, excesses)):
        assert found[:, 0] == pytest.approx([float(value) for value in wanted], abs=2e-5)
    assert result.level[:, 0] == pytest.approx([float(value) for value in levels], abs=1e-4)
