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

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future

from slip_detector.nodes.health import ERROR, OK, WARN
from slip_detector.nodes.messages import event_qos
from support.harness import Beating, ended_quietly
from support.interfaces import build

#: The definitions in control_msgs.
STATE = 'float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n'
STATES = 'sensor_msgs/JointState state\n'
DEFINITIONS = {
    'msg/GripperCommand.msg': 'float64 position\nfloat64 max_effort\n',
    'action/GripperCommand.action': f'GripperCommand command\n---\n{STATE}---\n{STATE}',
    'action/ParallelGripperCommand.action': (
        f'sensor_msgs/JointState command\n---\n{STATES}'
        f'bool stalled\nbool reached_goal\n---\n{STATES}'
    ),
}
DEPENDS = ('sensor_msgs', 'std_msgs', 'geometry_msgs', 'builtin_interfaces', 'action_msgs')
DEPENDS += ('service_msgs', 'unique_identifier_msgs')

ACTION = '/gripper_controller/gripper_cmd'

#: Where the fingers are open, where closed, and where they meet the object.
OPEN, CLOSED, OBJECT = 0.04, 0.002, 0.03

#: Period of the gripper's controller, what the fingers move in it, how near is reached, and after
#: how many periods without motion a goal has stalled.
PERIOD_S, STEP, TOLERANCE, STALL = 0.01, 0.002, 0.0005, 20

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


class Gripper:
    """A gripper with an object between its fingers, and the server of its action.

    As in parallel_gripper_action_controller and gripper_action_controller a new goal ends the one
    before as cancelled, though nobody has asked for it; a goal ends when the position is reached,
    and is aborted when the fingers have stalled; the command stays in force. The parallel one
    refuses a goal that has not one position.
    """

    def __init__(self, node, kind):
        self.goals, self.cancels, self.refuses = [], 0, False
        self.in_force, self.position, self.object = None, OPEN, OBJECT
        self._kind, self._running, self._still = kind, None, 0
        self._server = ActionServer(
            node, kind, ACTION, self._execute,
            goal_callback=self._on_goal, cancel_callback=self._on_cancel,
        )  # fmt: skip
        self._timer = node.create_timer(PERIOD_S, self._update)
        self._node = node

    def destroy(self):
        self._node.destroy_timer(self._timer)
        self._server.destroy()

    def _on_cancel(self, _):
        self.cancels += 1
        return CancelResponse.ACCEPT

    def _on_goal(self, goal):
        command = goal.command
        if hasattr(command, 'max_effort'):
            goal = command.position, command.max_effort
        elif len(command.position) == len(command.effort) == 1:
            assert list(command.name) == ['knuckle']
            goal = command.position[0], command.effort[0]
        else:
            return GoalResponse.REJECT
        self.goals.append(goal)
        return GoalResponse.REJECT if self.refuses else GoalResponse.ACCEPT

    async def _execute(self, handle):
        self.preempt()
        self.in_force, self._still = self.goals[-1], 0
        self._running = running = Future()
        end, stalled, reached = await running
        if end == 'canceled':
            handle._update_state(rclpy_implementation.GoalEvent.CANCEL_GOAL)
        getattr(handle, end)()
        return self._kind.Result(stalled=stalled, reached_goal=reached)

    def preempt(self):
        """End the goal as another client's goal does."""
        self._end('canceled', False, False)

    def _end(self, *how):
        running, self._running = self._running, None
        if running:
            running.set_result(how)

    def _update(self):
        if self.in_force is None:
            return
        way = self.in_force[0] - self.position
        moved = max(self.position + max(-STEP, min(STEP, way)), self.object)
        self._still = self._still + 1 if moved == self.position else 0
        self.position = moved
        if abs(self.in_force[0] - moved) < TOLERANCE:
            self._end('succeed', False, True)
        elif self._still > STALL:
            self._end('abort', True, False)


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
        """Wait until the diagnostics say so."""
        self.wait_for(lambda: self._last() and self._last().level == level, words)
        self.wait_for(lambda: words in self._last().message, words)
        assert self._last().level == level
        assert self._last().name == 'grasp_controller: gripper'

    def _last(self):
        return self._heard[-1].status[0] if self._heard else None


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
    with ended_quietly(hand.process):
        hand.wait_for(lambda: gripper.position == CLOSED, 'the fingers to close')
    assert gripper.in_force == limit
    assert gripper.cancels == 0


def test_a_goal_that_is_refused_or_lost_leaves_the_grip_is_reported_and_sent_again(
    bench, control_msgs
):
    kind = control_msgs.ParallelGripperCommand
    deaf = Node('deaf', context=bench.context)
    silent = ActionServer(deaf, kind, ACTION, lambda handle: None)
    hand = Hand(bench, 'parallel_gripper_command')
    hand.hears(ERROR, 'lost, it has no answer')
    silent.destroy()
    deaf.destroy_node()
    hand.hears(ERROR, f'{ACTION} has no server')
    gripper = Gripper(bench.node, kind)
    hand.hears(OK, 'stalled')
    gripper.refuses, before = True, gripper.in_force
    hand.state['slip'] = True
    hand.wait_for(lambda: gripper.goals[-1] != before, 'a higher effort')
    hand.state['slip'] = False
    hand.hears(ERROR, 'refused, the grip stays as it is')
    assert gripper.in_force == before
    gripper.refuses = False
    hand.wait_for(lambda: gripper.in_force[1] > before[1], 'the goal again')
    hand.hears(OK, 'stalled')
    before = gripper.in_force
    gripper.destroy()
    hand.hears(ERROR, f'{ACTION} has no server')
    gripper = Gripper(bench.node, kind)
    hand.hears(OK, 'stalled')
    assert gripper.in_force == before
    assert 'refused' in hand.process.log()


def test_a_goal_that_another_client_replaces_is_reported_and_not_fought_for(bench, control_msgs):
    gripper = Gripper(bench.node, control_msgs.GripperCommand)
    hand = Hand(bench, 'gripper_command')
    hand.wait_for(lambda: gripper.in_force, 'a goal')
    gripper.preempt()
    hand.hears(WARN, 'ended, neither reached nor stalled: does another node command')
    assert len(gripper.goals) == 1


def test_the_position_that_is_reached_is_reported(bench, control_msgs):
    gripper = Gripper(bench.node, control_msgs.GripperCommand)
    gripper.object = 0.0
    Hand(bench, 'gripper_command').hears(OK, 'reached its position')


def test_an_action_without_its_messages_is_refused_in_one_line(bench, tmp_path, monkeypatch):
    (tmp_path / 'control_msgs').mkdir()
    (tmp_path / 'control_msgs' / '__init__.py').touch()
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    words = ["command_type is 'gripper_command', allowed: only where control_msgs is installed"]
    bench.check_refused('grasp_controller', {'command_type': 'gripper_command'}, words)
