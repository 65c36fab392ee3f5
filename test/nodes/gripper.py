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

"""A gripper with an action server that behaves as ros2_control's do, here or as a process."""

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future

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
        print(f'goal of effort {goal[1]:.3g}', flush=True)
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


if __name__ == '__main__':  # A process of its own, which serves until it is ended.
    from control_msgs.action import GripperCommand

    rclpy.init()
    node = Node('gripper')
    gripper = Gripper(node, GripperCommand)
    print('serves', flush=True)
    rclpy.spin(node)
