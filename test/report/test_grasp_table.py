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

"""The figures of the grasp as text."""

from slip_detector.grasp.comparison import (
    CONTROLLER,
    HARDER,
    QUARTER_RIDGES,
    UNCONTROLLED,
    check_wanted,
    grasp_figures,
)
from slip_detector.report.grasp_table import grasp_table
from support import grasp_trials


def test_what_is_not_defined_is_a_dash_in_the_table():
    parts = {name: grasp_figures(mine, 10.0) for name, mine in grasp_trials.by_condition().items()}
    harder = {**dict.fromkeys(HARDER, parts[CONTROLLER]), QUARTER_RIDGES: parts[UNCONTROLLED]}
    result = {
        'seeds': [5000],
        'conditions': parts,
        'harder': harder,
        'transport_ms': 4.0,
        'nodes': {
            '5000': {
                'slide_mm': None,
                'command_percent': 50.0,
                'simulated': {'slide_mm': 0.5, 'command_percent': 49.0},
            }
        },
        'latency_ms': None,
        'wanted': check_wanted({**parts, **harder}),
    }
    lines = grasp_table(result).splitlines()
    (uncontrolled,) = (line for line in lines if line.strip().startswith(UNCONTROLLED))
    assert uncontrolled.split()[2:7] == ['1', 'of', '1', '-', '-']
    assert any(line.split() == ['5000', '-', '0.50', '50.0', '49.0'] for line in lines)
    assert 'From sample to command: undefined, no onset was answered' in lines
    wanted = [line.split() for line in lines if 'wanted' in line]
    assert ['controller', 'objects', 'dropped', '0.00', 'wanted', '<=', '0', 'met'] in wanted
    quarter = [*QUARTER_RIDGES.split(), 'worst', 'slide', '[mm]', '-', 'wanted', '<', '2.1']
    assert [*quarter, 'NOT', 'met'] in wanted
