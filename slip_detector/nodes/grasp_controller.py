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

"""The grasp controller node, an example of how to use ``slip``: it commands the grip force."""

import functools
import math
import time
from typing import Any

from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

from slip_detector.grasp.law import GraspLaw
from slip_detector.nodes.health import ERROR, OK, WARN, Diagnostics, make_status
from slip_detector.nodes.inputs import describe_rivals, find_publishing_nodes
from slip_detector.nodes.messages import STEADY, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.parameters import ACTIONS, GRIPPER_COMMAND, JOINT_STATE, GraspConfig

#: Length of the queues, so that no change is missed while this node is busy.
DEPTH = 100

#: Most command periods that count as passed between two commands. A longer time is a stall of this
#: node, which neither the gripper nor the detector notices.
PERIODS_COUNTED = 3

#: Period, in seconds, at which another publisher of the commands is looked for, and shortest time
#: between two errors about such a publisher.
RIVAL_CHECK_S, RIVAL_LOG_S = 1.0, 60.0

#: Number of checks for silence within ``deadline_s``.
CHECKS = 10

#: Share of the last effort below which a lower one is a new goal. Otherwise a grip that relaxes
#: would send goals all the time, and no goal would last until it stalls.
LOWER_SHARE = 0.95

#: Period of the reports in seconds. After it a goal that was refused is sent again; within it an
#: answer is expected.
GOAL_REPORT_S = 1.0

#: Time in seconds after which a goal without an answer is given up: a request may be lost while
#: its server is being discovered.
ANSWER_S = 10.0

#: Period in seconds at which the servers are looked for. A server counts when it is found twice:
#: of one that has just come, the part that takes goals may not be known yet.
SEARCH_S = 0.25


class GraspController(Node):
    """Commands the grip force of :class:`.GraspLaw` at a fixed rate and at each change of slip.

    ``slip`` is not relied on while ``slip_valid`` is false, nor when either topic has been silent
    for longer than ``deadline_s``: the detector may hang or have been killed, or the network may
    be down. A stall of this node itself (a stopped process, a busy machine) is no silence, as
    messages wait in the queues meanwhile. So silence is measured in calls of a timer, which is
    called only once after a stall, and not by the deadline of the middleware.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('grasp_controller', cli_args=cli_args)
        self.config = config = declare(self, GraspConfig)
        self._law = GraspLaw(config)
        # By topic, the last state, and the number of checks for silence since the last message.
        self._states = {'slip': False, 'slip_valid': False}
        self._checks = dict.fromkeys(self._states, math.inf)
        # Whether both topics have been heard at the same time so far, and are reliable now.
        self._heard = self._trusted = False
        self._commanded_s = time.monotonic()
        for topic in self._states:
            on_message = functools.partial(self._on_message, topic)
            self.create_subscription(Bool, topic, on_message, state_qos(DEPTH, config.deadline_s))
        self.create_timer(1.0 / config.command_hz, self._command_grip, clock=STEADY)
        self.create_timer(config.deadline_s / CHECKS, self._check_silence, clock=STEADY)
        if config.command_type in ACTIONS:
            self._send = GripperAction(self, config).send
        else:
            with_names = config.command_type == JOINT_STATE
            message_type = JointState if with_names else Float64MultiArray
            self._send = self._publish
            self._command = self.create_publisher(message_type, config.command_topic, state_qos())
            self.create_timer(RIVAL_CHECK_S, self._look_for_rivals, clock=STEADY)
        words = f'grip {config.grip_n:g} to {config.limit_n:g} N, waiting for the detector'
        self.get_logger().info(words)

    def _on_message(self, topic: str, message: Bool) -> None:
        self._checks[topic] = 0
        before, self._states[topic] = self._states[topic], message.data
        if message.data != before:
            self._command_grip()

    def _check_silence(self) -> None:
        """Command at once when a topic has become silent."""
        for topic in self._checks:
            self._checks[topic] += 1
        if CHECKS + 1 in self._checks.values():
            self._command_grip()

    def _look_for_rivals(self) -> None:
        """Report when another node commands the same gripper."""
        topic = self._command.topic_name
        names = find_publishing_nodes(self, topic)
        if len(names) > 1:
            words = describe_rivals(topic, names)
            self.get_logger().error(words, throttle_duration_sec=RIVAL_LOG_S)

    def _command_grip(self) -> None:
        """Command the force of the law, once both topics of the detector have been heard."""
        silent = [topic for topic, checks in self._checks.items() if checks > CHECKS]
        self._heard = self._heard or not silent
        slip, trusted = self._states['slip'], self._states['slip_valid'] and not silent
        if trusted and not self._trusted:
            self.get_logger().info('slip is valid')
        elif self._trusted and not trusted:
            why = f'{" and ".join(silent)} silent' if silent else 'not valid'
            does = 'opens' if self.config.on_invalid == 'open' else 'stays as it is'
            self.get_logger().warning(f'slip cannot be relied on ({why}): the grip {does}')
        self._trusted = trusted
        now_s, before_n = time.monotonic(), self._law.force_n
        elapsed_s = min(now_s - self._commanded_s, PERIODS_COUNTED / self.config.command_hz)
        self._commanded_s = now_s
        force_n = self._law.update(elapsed_s, slip, trusted)
        if slip and force_n > before_n >= self.config.grip_n:
            self.get_logger().info(f'slip: grip raised to {force_n:.2f} N')
        if self._heard:
            self._send(force_n)

    def _publish(self, force_n: float) -> None:
        """Publish the gripper's message for a force."""
        config = self.config
        joints = list(config.command_joints)
        efforts = [config.command_factor * force_n] * len(joints)
        if config.command_type == JOINT_STATE:
            message = JointState(name=joints, effort=efforts)
            message.header.stamp = self.get_clock().now().to_msg()
        else:
            message = Float64MultiArray(data=efforts)
        self._command.publish(message)


class GripperAction:
    """Sends the grip as goals, at no more than ``goal_hz``: the closed position, and an effort.

    A goal that holds an object never reaches its position: the goal stalls, and may be aborted.
    The gripper goes on gripping then, as it does when a goal is refused or lost. A goal is
    replaced by the next one and never cancelled, which would end the grip. ``/diagnostics`` says
    what becomes of the last goal. When the next goal is sent:

    - A goal is sent when the wanted effort is not that of the last goal.
    - The next goal waits until the last one is answered; then the newest effort follows at once.
    - A goal that was refused, or given up, is sent again.
    - A server that has come after the last goal gets a goal at once. The server before may have
      been killed, and no answer of it is expected any more.
    """

    def __init__(self, node: Node, config: GraspConfig) -> None:
        # Only actions need this package, which is not always installed.
        from control_msgs.action import GripperCommand, ParallelGripperCommand

        self._node, self._config = node, config
        simple = config.command_type == GRIPPER_COMMAND
        self._type: Any = GripperCommand if simple else ParallelGripperCommand
        self._client = ActionClient(node, self._type, config.command_topic)
        # The servers, by identifiers that no other process has: those of the last search, those of
        # the last two, and those that the last goal was sent to.
        self._found = self._servers = self._addressed = frozenset[tuple[int, ...]]()
        self._wanted, self._effort, self._sent_s = 0.0, 0.0, -math.inf
        # The last goal's request, and its end if it was accepted.
        self._request: Future | None = None
        self._end = Future()
        self._complaint: list[tuple[bytes, str]] = []
        self._diagnostics = Diagnostics(node)
        node.create_timer(SEARCH_S, self._search, clock=STEADY)
        node.create_timer(GOAL_REPORT_S, self._report, clock=STEADY)

    def send(self, force_n: float) -> None:
        """Have a force commanded, by a goal now or as soon as one may be sent."""
        self._wanted = self._config.command_factor * force_n
        self._advance()

    def _search(self) -> None:
        """Find the servers that are there."""
        of_type = f'control_msgs/action/{self._type.__name__}_FeedbackMessage'
        topic = f'{self._config.command_topic}/_action/feedback'
        infos = self._node.get_publishers_info_by_topic(topic)
        found = frozenset(tuple(each.endpoint_gid) for each in infos if each.topic_type == of_type)
        self._servers, self._found = found & self._found, found
        self._addressed &= self._found
        self._advance()

    def _advance(self) -> None:
        """Send a goal of the newest effort, if one is due."""
        config, wanted, age_s = self._config, self._wanted, time.monotonic() - self._sent_s
        answer = self._request.result() if self._request else None
        all_addressed = self._servers <= self._addressed
        if self._request and answer is None and all_addressed and age_s < ANSWER_S:
            return
        failed = answer is None or (not answer.accepted and age_s > GOAL_REPORT_S)
        effort = self._effort if all_addressed and not failed else 0.0
        too_soon = age_s < 1.0 / config.goal_hz
        if too_soon or not self._servers or LOWER_SHARE * effort <= wanted <= effort:
            return
        goal, n = self._type.Goal(), len(config.command_joints)
        if config.command_type == GRIPPER_COMMAND:
            goal.command.position, goal.command.max_effort = config.closed_position, wanted
        else:
            goal.command.name = list(config.command_joints)
            goal.command.position, goal.command.effort = [config.closed_position] * n, [wanted] * n
        self._effort, self._addressed, self._sent_s = wanted, self._servers, time.monotonic()
        self._request, self._end = self._client.send_goal_async(goal), Future()
        self._request.add_done_callback(self._on_answer)

    def _on_answer(self, request: Future) -> None:
        goal: Any = request.result()
        if request is self._request and goal.accepted:  # Else a later goal has replaced it.
            self._end = goal.get_result_async()
        self._advance()

    def _state(self) -> tuple[bytes, str]:
        """Return what has become of the last goal, and how bad that is."""
        if not self._found:
            return ERROR, f'{self._config.command_topic} has no server'
        if self._request is None:
            return OK, 'the gripper is there'
        if not self._found <= self._addressed:
            return WARN, 'another server has come, which gets it next'
        if not self._request.done():
            late = time.monotonic() - self._sent_s > GOAL_REPORT_S
            return (ERROR, 'no answer yet') if late else (OK, 'sent')
        if not self._request.result().accepted:
            return ERROR, 'refused, the grip stays as it is'
        if not self._end.done():
            return OK, 'under way'
        end: Any = self._end.result()
        if end.result.reached_goal or end.result.stalled:
            reached = end.result.reached_goal
            words = 'reached its position' if reached else 'stalled, as on an object'
            return OK, f'{words}, the grip stays as it is'
        return WARN, 'ended, neither reached nor stalled: does another node command the gripper?'

    def _report(self) -> None:
        """Publish what has become of the last goal; log it if that is bad news."""
        level, words = self._state()
        goal = f'goal of effort {self._effort:.3g}' if self._request else 'no goal yet'
        complaints = [(level, f'{goal}: {words}')]
        if level != OK and complaints != self._complaint:
            self._node.get_logger().warning(f'{goal}: {words}')
        self._complaint = complaints[:1]
        if len(self._found) > 1:
            words = f'there are {len(self._found)} servers, allowed: 1'
            complaints.append((WARN, f'{words} (one that was killed counts for some 20 s)'))
        each = make_status('gripper', '', complaints, {})
        self._diagnostics.publish([each], self._config.command_topic)
