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
import functools
from pathlib import Path

import numpy as np
import pytest

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.grasp.law import GraspLaw
from slip_detector.grasp.loop import GraspTrial, play_trial, play_trials
from slip_detector.grasp.objects import object_scene
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig

FILE = Path(__file__).resolve().parents[2] / 'config' / 'grasp.yaml'
CHAIN, GRASP = ChainConfig.from_yaml(FILE), GraspConfig.from_yaml(FILE)


@functools.cache
def caught():
    """Play a trial of another object, once for all tests."""
    return play_trials(CHAIN, GRASP, [5000])[0]


def test_a_trial_is_the_same_each_time_and_what_was_before_a_command_does_not_depend_on_it():
    once, (again,) = caught(), play_trials(CHAIN, GRASP, [5000])
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one, other)
    weaker = dataclasses.replace(GRASP, step_factor=1.1)
    (other,) = play_trials(CHAIN, weaker, [5000])
    same = np.flatnonzero(once.command_n != other.command_n)[0]
    np.testing.assert_array_equal(once.position_m[:same], other.position_m[:same])
    assert not np.array_equal(once.position_m, other.position_m)


def test_the_longer_a_command_takes_the_further_the_object_slides():
    # One that hears the object when it slides. The grip that comes late is not felt as slip.
    hears = ChainConfig(
        common_mode='median', passband_hz=(10.0, 150.0), stopbands_hz=(), envelope_window_s=0.015,
        decision_window_s=0.01, threshold=0.05, vote='mean',
    )  # fmt: skip
    slides_m = [
        play_trials(hears, GraspConfig(), [5000], transport_s=transport_s)[0].position_m[-1]
        for transport_s in (0.0, 0.02, 0.06)
    ]
    assert slides_m == sorted(slides_m)
    assert slides_m[-1] > 1.1 * slides_m[0]


def test_the_grip_follows_the_command_with_the_lag_of_the_gripper():
    trial = caught()
    jump = int(np.argmax(np.diff(trial.command_n))) + 1
    before_n, after_n = trial.command_n[jump - 1], trial.command_n[jump]
    at_half = jump + int(np.argmax(trial.force_n[jump:] > 0.5 * (before_n + after_n)))
    # Half of it: later than the transport and well before three times the 30 ms of lag.
    assert 10e-3 < trial.time_s[at_half] - trial.time_s[jump] < 90e-3


def test_a_scene_that_holds_nothing_or_has_another_rate_is_refused_in_one_line():
    with pytest.raises(ValueError, match='the scene holds nothing, allowed: '):
        play_trial({'steps': [{'duration_s': 1.0}]}, 0, SlipChain(CHAIN), GraspLaw(GRASP))
    faster = SlipChain(dataclasses.replace(CHAIN, sample_rate_hz=500.0))
    with pytest.raises(ValueError, match='has 380 Hz, allowed: 500 Hz'):
        play_trial(object_scene(0), 0, faster, GraspLaw(GRASP))


def test_a_slide_of_a_lost_object_is_not_defined():
    rows = np.zeros(3)
    lost = GraspTrial(
        rows, rows, rows, rows > 0, rows > 0, np.array([0.0, 0.05, 0.1]), np.ones(3), length_m=0.1
    )
    assert lost.dropped
    assert lost.slide_m is None
    held = lost._replace(length_m=0.2)
    assert not held.dropped
    assert held.slide_m == 0.1
