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

"""Pictures of trials and of the grasp, and its table."""

import numpy as np
import pytest

from slip_detector.grasp.loop import UNCONTROLLED, grasp_figures
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import pictures
from slip_detector.report.pictures import draw_grasp, draw_trial, grasp_table
from support import grasp_trials

TIME_S = np.arange(400) / 100.0
ON = (TIME_S >= 1.0) & (TIME_S < 2.0)


@pytest.mark.parametrize('motion_s', [(1.0, 2.0), None])
def test_each_group_shows_its_channels_and_its_decision(monkeypatch, motion_s):
    drawn = []
    monkeypatch.setattr(pictures, 'save_picture', lambda figure, path: drawn.append(figure))
    config = ChainConfig(channels=3, groups={'a': (1, 2), 'b': (3,)})
    volts = np.column_stack([np.sin(TIME_S), np.cos(TIME_S), TIME_S])
    groups = {'a': ON, 'b': ~ON}
    draw_trial('a.png', TIME_S, volts, config, groups, ON, motion_s)
    (figure,) = drawn
    raw_a, decided_a, raw_b, decided_b, slip = figure.axes
    marks = 1 if motion_s else 0
    assert [len(axis.lines) for axis in (raw_a, raw_b)] == [2 + marks, 1 + marks]
    np.testing.assert_array_equal(raw_b.lines[0].get_ydata(), volts[:, 2])
    labels = [axis.get_ylabel() for axis in (decided_a, decided_b, slip)]
    assert labels == ['a', 'b', 'slip']


@pytest.mark.parametrize('live', [True, False])
def test_the_grasp_is_drawn_with_and_without_a_trial_of_the_nodes(tmp_path, live):
    trials = grasp_trials.by_condition()
    rows = np.column_stack([np.linspace(0.0, 8.0, 50), np.linspace(0.0, 1e-3, 50)])
    draw_grasp(
        tmp_path / 'grasp.png',
        {name: mine[0] for name, mine in trials.items()},
        10.0,
        {'position': rows, 'command': rows} if live else {},
    )
    assert (tmp_path / 'grasp.png').read_bytes().startswith(b'\x89PNG')


def test_the_table_of_the_grasp_has_conditions_and_the_nodes():
    parts = {name: grasp_figures(mine, 10.0) for name, mine in grasp_trials.by_condition().items()}
    simulated = {'slide_mm': 0.5, 'command_percent': 49.0}
    result = {
        'seeds': [5000],
        'conditions': parts,
        'transport_ms': 4.0,
        'nodes': {'5000': {'slide_mm': None, 'command_percent': 50.0, 'simulated': simulated}},
        'latency_ms': None,
    }
    lines = [' '.join(line.split()) for line in grasp_table(result).splitlines()]
    assert any(line.startswith(f'{UNCONTROLLED} 1 of 1 - -') for line in lines)
    assert '5000 - 0.50 50.0 49.0' in lines
    assert 'From sample to command: undefined, no onset was answered' in lines
