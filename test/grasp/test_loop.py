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

"""The closed loop without ROS, and how the controller compares with other grips."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from slip_detector.grasp import loop
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
    conditions = loop.conditions(CHAIN, GRASP)
    return {
        name: [loop.play_trial(*both, seed) for seed in SEEDS] for name, both in conditions.items()
    }


def test_each_seed_is_another_object_within_the_ranges_and_always_the_same_one():
    scenes = [loop.object_scene(seed) for seed in range(200)]
    assert scenes[7] == loop.object_scene(7)
    masses = [scene['object']['mass_kg'] for scene in scenes]
    low, high = loop.RANGES['mass_kg']
    assert low <= min(masses) < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < max(masses) <= high
    assert len({scene['electronics']['fingertip_seed'] for scene in scenes}) == len(scenes)


def test_samples_before_a_command_do_not_depend_on_it_and_the_grip_lags_behind(played):
    trial = played[loop.CONTROLLER][0]
    other = loop.play_trial(CHAIN, dataclasses.replace(GRASP, step_factor=1.1), SEEDS[0])
    same = np.flatnonzero(trial.command_n != other.command_n)[0]
    np.testing.assert_array_equal(trial.position_m[:same], other.position_m[:same])
    assert not np.array_equal(trial.position_m, other.position_m)
    jump = int(np.argmax(np.diff(trial.command_n))) + 1
    before_n, after_n = trial.command_n[jump - 1], trial.command_n[jump]
    at_half = jump + int(np.argmax(trial.force_n[jump:] > 0.5 * (before_n + after_n)))
    # Half of it: later than the transport and well before three times the 30 ms of lag.
    assert 10e-3 < trial.time_s[at_half] - trial.time_s[jump] < 90e-3


def test_an_object_that_slides_on_after_the_first_raise_of_a_slow_gripper_is_caught():
    """Sliding, its friction is a tenth less, while its weight grows."""
    assert loop.play_trial(CHAIN, GRASP, 4, lag_factor=2.0).slide_mm < 1.0


def test_a_scene_of_another_rate_is_refused_in_one_line():
    faster = dataclasses.replace(CHAIN, sample_rate_hz=500.0)
    with pytest.raises(ValueError, match='has 380 Hz, allowed: 500 Hz'):
        loop.play_trial(faster, GRASP, 0)


def test_without_a_controller_it_is_dropped_and_the_controller_holds_it_with_less_than_the_limit(
    played,
):
    found = {name: loop.grasp_figures(trials, GRASP.limit_n) for name, trials in played.items()}
    assert found[loop.UNCONTROLLED]['slide_mm'] == [None] * len(SEEDS)
    at_limit, ours, theirs = (found[n] for n in (loop.AT_LIMIT, loop.CONTROLLER, loop.PAPER))
    assert at_limit['worst_slide_mm'] < 0.1
    assert at_limit['force_percent'] > 90.0
    assert ours['worst_slide_mm'] < 0.6
    assert ours['needed_percent'] < ours['force_percent'] < 0.8 * at_limit['force_percent']
    assert theirs['dropped'] or theirs['mean_slide_mm'] > ours['mean_slide_mm']
    assert theirs['force_percent'] > ours['force_percent']
    for trial in played[loop.CONTROLLER]:
        # It did slip, slip said so, the grip rose, and at the end the object is at rest.
        assert trial.sliding.any()
        assert len(trial.onsets_s)
        assert trial.command_n[-1] > GRASP.grip_n
        assert not trial.sliding[-100:].any()
        assert np.ptp(trial.position_m[-100:]) < 1e-5


def test_the_figures_of_trials_made_by_hand():
    held, lost = grasp_trials.trial(1e-3, 4.0), grasp_trials.trial(grasp_trials.LENGTH_M, 2.0)
    found = loop.grasp_figures([held, lost], 10.0)
    assert (found['trials'], found['dropped']) == (2, 1)
    assert found['slide_mm'] == [pytest.approx(1.0), None]
    assert (found['mean_slide_mm'], found['worst_slide_mm']) == (None, None)
    assert found['force_percent'] == pytest.approx(30.0)
    assert found['most_force_percent'] == pytest.approx(40.0)
    assert found['needed_percent'] == pytest.approx(30.0)
    assert found['onsets'] == 1.0
    # What comes before the object has to be held does not count.
    assert loop.grasp_figures([grasp_trials.trial(onset_row=10)], 10.0)['onsets'] == 0.0


POSITION = np.array([[0.0, 0.0], [1.0, 1e-3]])


def test_the_commanded_grip_holds_until_the_next_command():
    command = np.array([[0.5, 2.0], [1.0, 3.0]])
    trial = loop.LiveGraspTrial(POSITION, command, np.zeros(0))
    times_s = np.array([0.0, 0.5, 0.9, 1.0, 7.0])
    # Before the first command the gripper holds what that one says.
    assert trial.command_n(times_s).tolist() == [2.0, 2.0, 2.0, 3.0, 3.0]


def test_an_onset_is_answered_by_the_next_raise_that_is_soon_enough():
    command = np.array([[0.0, 2.0], [1.01, 3.0], [1.5, 3.0], [2.0, 2.5], [3.0, 4.0]])
    onsets_s = np.array([1.0, 1.99, 3.0 - 0.9 * loop.ANSWER_S, 3.0])
    trial = loop.LiveGraspTrial(POSITION, command, onsets_s)
    # The grip sinks after the second, and nothing comes after the last.
    assert trial.latencies_s() == pytest.approx([0.01, 0.9 * loop.ANSWER_S])
