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

"""Commands a gripper by the goals of an action; ``/diagnostics`` says what becomes of them."""

import functools
import math
import time
from typing import Any

from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from slip_detector.nodes.health import ERROR, OK, WARN, Diagnostics, status
from slip_detector.parameters.grasp import GRIPPER_COMMAND, GraspConfig

#: Share of the last effort below which a lower one is a new goal. A grip that relaxes would send
#: them all the time, and the gripper never have the time to say that it has stalled.
LOWER = 0.95

#: Period of the reports in seconds, after which a goal that failed is sent again.
REPORT_S = 1.0


class GripperAction:
    """Sends the grip as goals, at no more than ``goal_hz``: the closed position, and an effort.

    A goal that holds an object never reaches its position: it stalls, and may be aborted for it.
    The gripper goes on gripping then, as it does when a goal is refused or lost. A goal is
    replaced by the next one and never cancelled, which would end the grip. One that was refused or
    lost is sent again. ``/diagnostics`` says what becomes of the last goal.

    Parameters
    ----------
    node
        The node that sends them.
    config
        Its parameters.

    Raises
    ------
    ValueError
        When control_msgs is not installed.
    """

    def __init__(self, node: Node, config: GraspConfig) -> None:
        self._node, self._config = node, config
        try:
            from control_msgs.action import GripperCommand, ParallelGripperCommand
        except ImportError:
            words = f'{config.command_type!r}, allowed: only where control_msgs is installed'
            raise ValueError(f'parameter command_type is {words}') from None
        simple = config.command_type == GRIPPER_COMMAND
        self._type: Any = GripperCommand if simple else ParallelGripperCommand
        self._client = ActionClient(node, self._type, config.command_topic)
        self._effort, self._sent_s = 0.0, -math.inf
        # The last goal's request; what the goal is called, how bad what became of it is, and what.
        self._asked: Future | None = None
        self._goal, self._level, self._words = 'no goal yet', OK, ''
        self._diagnostics = Diagnostics(node)
        node.create_timer(REPORT_S, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def send(self, force_n: float) -> None:
        """Send a goal for a force, if it is another one and the last goal is not too recent."""
        config, now_s = self._config, time.monotonic()
        effort = config.command_factor * force_n
        too_soon = now_s < self._sent_s + 1.0 / config.goal_hz
        if too_soon or LOWER * self._effort <= effort <= self._effort:
            return
        self._sent_s = now_s
        if not self._client.server_is_ready():
            return
        self._effort, self._goal = effort, f'goal of effort {effort:.3g}'
        goal, n = self._type.Goal(), len(config.command_joints)
        if config.command_type == GRIPPER_COMMAND:
            goal.command.position, goal.command.max_effort = config.closed_position, effort
        else:
            goal.command.name = list(config.command_joints)
            goal.command.position, goal.command.effort = [config.closed_position] * n, [effort] * n
        self._asked = self._client.send_goal_async(goal)
        self._asked.add_done_callback(self._on_answer)

    def _on_answer(self, asked: Future) -> None:
        goal = asked.result()
        if asked is self._asked and not goal.accepted:
            self._note(ERROR, 'refused, the grip stays as it is')
        elif asked is self._asked:
            self._note(OK, 'under way')
            goal.get_result_async().add_done_callback(functools.partial(self._on_end, asked))

    def _on_end(self, asked: Future, end: Future) -> None:
        result = end.result().result
        if asked is not self._asked:  # The next goal has replaced it.
            return
        if result.reached_goal or result.stalled:
            words = 'reached its position' if result.reached_goal else 'stalled, as on an object'
            self._note(OK, f'{words}, the grip stays as it is')
        else:
            words = 'ended, neither reached nor stalled: does another node command the gripper?'
            self._note(WARN, words)

    def _note(self, level: bytes, words: str) -> None:
        """Note what has become of the last goal; log it if that is bad news."""
        words = f'{self._goal}: {words}'
        if level != OK and words != self._words:
            self._node.get_logger().warning(words)
        self._level, self._words = level, words

    def _report(self) -> None:
        """Look for lost goals, have goals that failed sent again, and publish the diagnostics."""
        if not self._client.server_is_ready():
            self._note(ERROR, f'{self._config.command_topic} has no server')
        elif self._asked is None:
            self._note(OK, 'the gripper is there')
        elif not self._asked.done() and time.monotonic() - self._sent_s > REPORT_S:
            self._note(ERROR, 'lost, it has no answer')
        if self._level == ERROR:
            self._effort = 0.0
        each = status('gripper', '', [(self._level, self._words)], {})
        self._diagnostics.publish([each], self._config.command_topic)
