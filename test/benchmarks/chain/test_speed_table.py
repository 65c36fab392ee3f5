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

"""The figures of the speed as text."""

from benchmarks.chain.speed_table import chain_speed_table
from benchmarks.measurement import heading


def test_the_table_names_each_figure_with_its_bound(chain_speed):
    text = heading(chain_speed) + '\n' + chain_speed_table(chain_speed)
    for label, bound in (
        ('SciPy and NumPy', ''),
        ('one bare sosfilt', ''),
        ('speed-up', '>= 10'),
        ('speed-up', '>= 5'),
        ('C++', ''),
        ('ratio to decisions alone', '<= 1.5'),
        ('ratio to decisions alone', '<= 2'),
        ('speed-up', '>= 11'),
        ('ratio of the most channels', '<= 0.8'),
        ('kept', '< 1'),
        ('temporary arrays', '< 1'),
        ('worst ratio', '<= 1.5'),
        ('equal decisions', ''),
    ):
        assert any(label in line and bound in line for line in text.splitlines()), label
    for fact in ('cores', 'Python', 'NumPy', 'SciPy', 'Numba'):
        assert fact in text
    assert max(len(line) for line in text.splitlines()) <= 120


def test_the_table_says_honestly_what_is_not_met(chain_speed):
    claims = {name: entry | {'met': False} for name, entry in chain_speed['wanted'].items()}
    measured = sum(entry['value'] is not None for entry in claims.values())
    assert measured >= 10
    assert chain_speed_table(chain_speed | {'wanted': claims}).count('NOT met') == measured
    claims = {name: entry | {'met': True} for name, entry in chain_speed['wanted'].items()}
    assert 'NOT met' not in chain_speed_table(chain_speed | {'wanted': claims})


def test_without_a_compiler_the_table_says_why_there_is_no_cpp(chain_speed):
    blocks = chain_speed['blocks'] | {'cpp_ratio': None, 'cpp_left_out': 'there is no compiler'}
    text = chain_speed_table(chain_speed | {'blocks': blocks})
    assert 'left out: there is no compiler' in text
    assert 'run time over that' not in text
