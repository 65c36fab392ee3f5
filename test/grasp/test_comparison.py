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

"""The controller against no controller, a grip at the limit and the paper's detector."""

from pathlib import Path

import numpy as np
import pytest

from slip_detector.grasp.loop import (
    ANSWER_S,
    AT_LIMIT,
    CONTROLLER,
    PAPER,
    UNCONTROLLED,
    LiveGraspTrial,
    conditions,
    grasp_figures,
    play_trial,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig
from support import grasp_trials

FILE = Path(__file__).resolve().parents[2] / 'config' / 'grasp.yaml'
CHAIN, GRASP = ChainConfig.from_yaml(FILE), GraspConfig.from_yaml(FILE)

#: Others than those that docs/grasp.md reports on and those the parameters were chosen on.
SEEDS = range(5000, 5002)


@pytest.fixture(scope='module')
def played():
    """Return the trials of each condition."""
    return {
        name: [play_trial(*both, seed) for seed in SEEDS]
        for name, both in conditions(CHAIN, GRASP).items()
    }


def test_without_a_controller_it_is_dropped_and_the_controller_holds_it_with_less_than_the_limit(
    played,
):
    found = {name: grasp_figures(trials, GRASP.limit_n) for name, trials in played.items()}
    assert found[UNCONTROLLED]['slide_mm'] == [None] * len(SEEDS)
    assert found[AT_LIMIT]['worst_slide_mm'] < 0.1
    assert found[AT_LIMIT]['force_percent'] > 90.0
    ours, theirs = found[CONTROLLER], found[PAPER]
    assert ours['worst_slide_mm'] < 0.6
    assert ours['needed_percent'] < ours['force_percent'] < 0.8 * found[AT_LIMIT]['force_percent']
    assert theirs['dropped'] or theirs['mean_slide_mm'] > ours['mean_slide_mm']
    assert theirs['force_percent'] > ours['force_percent']
    for trial in played[CONTROLLER]:
        # It did slip, slip said so, the grip rose, and at the end the object is at rest.
        assert trial.sliding.any()
        assert len(trial.onsets_s)
        assert trial.command_n[-1] > GRASP.grip_n
        assert not trial.sliding[-100:].any()
        assert np.ptp(trial.position_m[-100:]) < 1e-5


def test_the_figures_of_trials_made_by_hand():
    held, lost = grasp_trials.trial(1e-3, 4.0), grasp_trials.trial(grasp_trials.LENGTH_M, 2.0)
    found = grasp_figures([held, lost], 10.0)
    assert (found['trials'], found['dropped']) == (2, 1)
    assert found['slide_mm'] == [pytest.approx(1.0), None]
    assert (found['mean_slide_mm'], found['worst_slide_mm']) == (None, None)
    assert found['force_percent'] == pytest.approx(30.0)
    assert found['most_force_percent'] == pytest.approx(40.0)
    assert found['needed_percent'] == pytest.approx(30.0)
    assert found['onsets'] == 1.0
    # What comes before the object has to be held does not count.
    assert grasp_figures([grasp_trials.trial(onset_row=10)], 10.0)['onsets'] == 0.0


POSITION = np.array([[0.0, 0.0], [1.0, 1e-3]])


def test_the_commanded_grip_holds_until_the_next_command():
    command = np.array([[0.5, 2.0], [1.0, 3.0]])
    trial = LiveGraspTrial(POSITION, command, np.zeros(0))
    times_s = np.array([0.0, 0.5, 0.9, 1.0, 7.0])
    # Before the first command the gripper holds what that one says.
    assert trial.command_n(times_s).tolist() == [2.0, 2.0, 2.0, 3.0, 3.0]


def test_an_onset_is_answered_by_the_next_raise_that_is_soon_enough():
    command = np.array([[0.0, 2.0], [1.01, 3.0], [1.5, 3.0], [2.0, 2.5], [3.0, 4.0]])
    onsets_s = np.array([1.0, 1.99, 3.0 - 0.9 * ANSWER_S, 3.0])
    trial = LiveGraspTrial(POSITION, command, onsets_s)
    # The grip sinks after the second, and nothing comes after the last.
    assert trial.latencies_s() == pytest.approx([0.01, 0.9 * ANSWER_S])
