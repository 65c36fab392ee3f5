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

"""The grasp controller beside an action server that behaves as ros2_control's grippers do."""

import importlib.util
import os
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nodes.gripper import ACTION, CLOSED, DEFINITIONS, DEPENDS, Gripper

from slip_detector.nodes.health import ERROR, OK, WARN
from slip_detector.nodes.messages import event_qos
from support.harness import ROOT, Beating
from support.interfaces import build

#: Its server as a process of its own.
GRIPPER = ROOT / 'test' / 'nodes' / 'gripper.py'

#: Raises from the grip to the limit, one at each command unless goals are limited.
RAISES = 100
FACTOR, GRIP_N, LIMIT_N = 0.04, 2.0, 2.0 * 1.01**RAISES


@pytest.fixture(scope='module')
def control_msgs(tmp_path_factory):
    """The package of the actions: that of the installation of ROS, or a built one."""
    with pytest.MonkeyPatch.context() as patch:
        if not importlib.util.find_spec('control_msgs'):
            folder = tmp_path_factory.mktemp('interfaces')
            build(folder, 'control_msgs', DEFINITIONS, DEPENDS)
            patch.syspath_prepend(folder)
            patch.setenv('PYTHONPATH', str(folder), prepend=os.pathsep)
        yield importlib.import_module('control_msgs.action')


class Hand(Beating):
    """A controller process, the test in place of its detector, and what is said of its gripper."""

    def __init__(self, bench, kind, **parameters):
        super().__init__(bench)
        self._heard = bench.listen(DiagnosticArray, '/diagnostics', event_qos())
        given = {
            'command_type': kind, 'command_topic': ACTION, 'command_joints': '[knuckle]',
            'command_factor': FACTOR, 'closed_position': CLOSED, 'closing_n_s': 1e6,
            'grip_n': GRIP_N, 'limit_n': LIMIT_N, 'step_factor': 1.01, 'repeat_s': 0.0,
            'settle_s': 0.0, 'relax_n_s': 0.0, 'deadline_s': 5.0, **parameters,
        }  # fmt: skip
        self.process = bench.start('grasp_controller', parameters=given)

    def hears(self, level, words):
        """Wait until the diagnostics say so, at this level or one of these."""
        self.wait_for(lambda: self._said(level, words), words)
        assert self._heard[-1].status[0].name == 'grasp_controller: gripper'

    def _said(self, level, words):
        last = self._heard[-1].status[0] if self._heard else None
        return last and last.level in level and words in last.message


@pytest.mark.parametrize('kind', ['gripper_command', 'parallel_gripper_command'])
def test_a_higher_effort_is_a_new_goal_and_no_more_come_than_may(bench, control_msgs, kind):
    name = {'gripper_command': 'GripperCommand'}.get(kind, 'ParallelGripperCommand')
    gripper = Gripper(bench.node, getattr(control_msgs, name))
    hand = Hand(bench, kind, goal_hz=4.0)
    hand.hears(OK, 'stalled')
    assert gripper.goals == [(CLOSED, pytest.approx(FACTOR * GRIP_N))]
    hand.state['slip'] = True
    limit = CLOSED, pytest.approx(FACTOR * LIMIT_N)
    hand.wait_for(lambda: gripper.in_force == limit, 'the limit')
    hand.state['slip'] = False
    hand.hears(OK, 'goal of effort 0.216: stalled')
    efforts = [effort for _, effort in gripper.goals]
    assert efforts == sorted(set(efforts))
    assert 3 <= len(efforts) < RAISES / 2
    # The object is gone.
    gripper.object = 0.0
    hand.wait_for(lambda: gripper.position == CLOSED, 'the fingers to close')
    hand.process.end_quietly()
    assert gripper.in_force == limit
    assert gripper.cancels == 0


def test_a_goal_that_is_refused_leaves_the_grip_is_reported_and_sent_again(bench, control_msgs):
    hand = Hand(bench, 'parallel_gripper_command')
    hand.hears(ERROR, f'{ACTION} has no server')
    gripper = Gripper(bench.node, control_msgs.ParallelGripperCommand)
    hand.hears(OK, 'stalled')
    gripper.refuses, before = True, gripper.in_force
    hand.state['slip'] = True
    hand.wait_for(lambda: gripper.goals[-1] != before, 'a higher effort')
    hand.state['slip'] = False
    hand.hears(ERROR, 'refused, the grip stays as it is')
    assert gripper.in_force == before
    gripper.refuses = False
    hand.wait_for(lambda: gripper.in_force[1] > before[1], 'the goal again')
    assert 'refused' in hand.process.log()


def test_a_server_that_was_killed_and_comes_back_gets_the_last_goal(bench, control_msgs):
    hand = Hand(bench, 'gripper_command')
    killed = bench.start_python('-P', GRIPPER)
    hand.hears(OK, 'goal of effort 0.08: stalled')
    killed.signal(signal.SIGKILL)
    killed.wait()
    # The middleware goes on knowing the killed one.
    back = bench.start_python('-P', GRIPPER)
    hand.wait_for(lambda: 'goal of effort 0.08' in back.log(), 'the last goal')
    hand.hears(OK + WARN, 'goal of effort 0.08: stalled')
    # Another one beside it.
    Gripper(bench.node, control_msgs.GripperCommand)
    hand.hears(WARN, 'servers, allowed: 1')


def test_the_newest_effort_follows_an_answer_and_no_other_waits_for_one(bench, control_msgs):
    hand = Hand(bench, 'gripper_command')
    gripper = bench.start_python('-P', GRIPPER)
    hand.hears(OK, 'goal of effort 0.08: stalled')
    gripper.signal(signal.SIGSTOP)
    hand.state['slip'] = True
    hand.hears(ERROR, 'goal of effort 0.0808: no answer yet')
    hand.wait_for(lambda: f'raised to {LIMIT_N:.2f} N' in hand.process.log(), 'the limit')
    gripper.signal(signal.SIGCONT)
    limit = f'goal of effort {FACTOR * LIMIT_N:.3g}'
    hand.wait_for(lambda: limit in gripper.log(), 'the last goal')
    assert gripper.log().count('goal of') == 3


def test_a_goal_that_another_client_replaces_is_not_fought_for_and_one_reached_is_reported(
    bench, control_msgs
):
    gripper = Gripper(bench.node, control_msgs.GripperCommand)
    hand = Hand(bench, 'gripper_command')
    hand.wait_for(lambda: gripper.in_force, 'a goal')
    gripper.preempt()
    hand.hears(WARN, 'ended, neither reached nor stalled: does another node command')
    assert len(gripper.goals) == 1
    gripper.object, hand.state['slip'] = 0.0, True
    hand.hears(OK, 'reached its position')


def test_an_action_without_its_messages_is_refused_in_one_line(bench, tmp_path, monkeypatch):
    (tmp_path / 'control_msgs').mkdir()
    (tmp_path / 'control_msgs' / '__init__.py').touch()
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    words = ["No module named 'control_msgs.action'"]
    bench.check_refused('grasp_controller', {'command_type': 'gripper_command'}, words)
