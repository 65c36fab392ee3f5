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

"""The chain at extreme inputs."""

from benchmarks.chain.precision import WANTED
from benchmarks.chain.rivals import RUNNING_SUMS


def cases(chain_precision, word):
    found = [entry for entry in chain_precision['extremes'] if word in entry['case']]
    assert found
    return found


def test_nothing_is_ever_other_than_finite(chain_precision):
    assert all(entry['finite'] for entry in chain_precision['extremes'])


def test_exponents_with_either_rectifier(chain_precision):
    found = cases(chain_precision, 'wave')
    assert len([entry for entry in found if entry['case'].startswith('exponent')]) == 12
    for entry in found:
        assert entry['error'] <= 1e-11
        assert entry['largest_level'] > 0


def test_a_spike_and_a_step_of_a_million_volts_leave_nothing(chain_precision):
    (spike,) = cases(chain_precision, 'spike of 1e6 V')
    assert spike['largest_level'] > 1e20
    assert spike['error'] <= 1e-11
    # What a sum that is updated keeps of it hides the signal for ever.
    assert spike['others'][RUNNING_SUMS] > 1
    (step,) = cases(chain_precision, 'step of 1e6 V')
    # The offset stays, and with it its rounding errors: 1e-6 of a signal of 20 mV on 1e6 V.
    assert step['error'] <= WANTED['extremes.error'].high


def test_a_constant_rail_is_exactly_zero_and_leaves_the_vote(chain_precision):
    found = cases(chain_precision, 'constant')
    assert len(found) == 3
    for entry in found:
        assert entry['largest_level'] == 0
        assert entry['error'] == 0
        assert entry['found'] == 'level exactly 0, out of the vote after 1 s'


def test_denormals_are_off_and_what_is_tiny_is_exact(chain_precision):
    (denormal,) = cases(chain_precision, '(denormal)')
    assert denormal['largest_level'] == 0
    (pulse,) = cases(chain_precision, 'a pulse of 1 V')
    assert pulse['found'] == 'the level ends at 0'
    for word in ('1e-100 V', '1e-24 V'):
        (entry,) = cases(chain_precision, word)
        assert 0 < entry['largest_level'] < 1e-90
        assert entry['error'] <= 1e-11


def test_the_largest_values_overflow_nowhere(chain_precision):
    (largest,) = cases(chain_precision, 'gain 1e6, exponent 6')
    assert 1e100 < largest['largest_level'] < 1e150
    assert largest['error'] <= 1e-11
    (beyond,) = cases(chain_precision, '1e60 V and NaN')
    assert beyond['error'] <= 1e-11
    assert 'out of the vote' in beyond['found']
    assert 'NOT' not in beyond['found']
