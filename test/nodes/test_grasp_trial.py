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

"""What is computed from what a grasp through the nodes has published."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from slip_detector.nodes.grasp_trial import ANSWER_S, LiveGraspTrial

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


def test_where_the_grip_is_never_raised_no_onset_is_answered():
    trial = LiveGraspTrial(POSITION, np.array([[0.0, 2.0]]), np.array([0.5]))
    assert trial.latencies_s() == []
