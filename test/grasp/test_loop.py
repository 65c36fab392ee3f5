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

"""The closed loop without ROS: objects that slip are caught."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from slip_detector.grasp.loop import RANGES, object_scene, play_trial
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig

FILE = Path(__file__).resolve().parents[2] / 'config' / 'grasp.yaml'
CHAIN, GRASP = ChainConfig.from_yaml(FILE), GraspConfig.from_yaml(FILE)


def test_each_seed_is_another_object_within_the_ranges_and_always_the_same_one():
    scenes = [object_scene(seed) for seed in range(200)]
    assert scenes[7] == object_scene(7)
    masses = [scene['object']['mass_kg'] for scene in scenes]
    low, high = RANGES['mass_kg']
    assert low <= min(masses) < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < max(masses) <= high
    assert len({scene['electronics']['fingertip_seed'] for scene in scenes}) == len(scenes)


def test_samples_before_a_command_do_not_depend_on_it_and_the_grip_lags_behind():
    trial = play_trial(CHAIN, GRASP, 5000)
    weaker = dataclasses.replace(GRASP, step_factor=1.1)
    other = play_trial(CHAIN, weaker, 5000)
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
    assert play_trial(CHAIN, GRASP, 4, lag_factor=2.0).slide_mm < 1.0


def test_a_scene_of_another_rate_is_refused_in_one_line():
    faster = dataclasses.replace(CHAIN, sample_rate_hz=500.0)
    with pytest.raises(ValueError, match='has 380 Hz, allowed: 500 Hz'):
        play_trial(faster, GRASP, 0)
