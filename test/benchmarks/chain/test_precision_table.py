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

"""The figures of the precision as text."""

from benchmarks.chain.precision import WANTED
from benchmarks.chain.precision_table import chain_precision_table


def test_the_table_says_what_each_method_does(chain_precision):
    text = chain_precision_table(chain_precision)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 99
    for word in ('50 digits', 'unstable', 'refused: parameter', '(wanted <= 1e-07: met)'):
        assert word in text
    for entry in chain_precision['extremes']:
        assert entry['case'] in text
    for entry in chain_precision['rates']:
        error = f'{entry["methods"]["chain"]["error"]:.1e}'
        assert any(f'{entry["sample_rate_hz"]:g}' in line and error in line for line in lines)


def test_the_table_says_honestly_what_is_bad(chain_precision):
    entry = chain_precision['rates'][0]
    methods = entry['methods'] | {'chain': entry['methods']['chain'] | {'state': 'lost'}}
    extreme = chain_precision['extremes'][0] | {'finite': False, 'error': None}
    text = chain_precision_table(
        chain_precision
        | {
            'rates': [entry | {'methods': methods}],
            'extremes': [extreme],
            'wanted': {
                name: one | {'met': False} for name, one in chain_precision['wanted'].items()
            },
        }
    )
    assert text.count('NOT met') == len(WANTED)
    assert 'NOT finite' in text
    assert any('lost' in line for line in text.splitlines() if line.startswith('       50 '))
