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

"""What is measured of the tuner."""

from benchmarks.tune.measure import measure_tuning
from benchmarks.tune.table import tuning_table


def test_quick_figures_are_shown_and_not_judged():
    result = measure_tuning(quick=True, parts=['search'])
    text = tuning_table(result)
    wanted = result['wanted']
    assert wanted['search.speedup']['value'] == result['search']['speedup']
    assert wanted['search.speedup']['met'] is None
    assert wanted['evaluate.ratio'] == {'value': None, 'bound': '<= 4', 'met': None}
    assert [line.split()[-2:] for line in text.splitlines()].count(['not', 'judged']) == 1
    assert 'met' not in text
