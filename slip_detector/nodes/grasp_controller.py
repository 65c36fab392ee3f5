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
from collections.abc import Callable

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

from slip_detector.grasp.law import GraspLaw
from slip_detector.nodes.inputs import publishing_nodes
from slip_detector.nodes.messages import STEADY, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.parameters.fields import name_list
from slip_detector.parameters.grasp import ACTIONS, JOINT_STATE, GraspConfig

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
        self._send: Callable[[float], None] = self._publish
        if config.command_type in ACTIONS:
            from slip_detector.nodes.gripper_action import GripperAction  # Few need it.

            self._send = GripperAction(self, config).send
        else:
            kind = JointState if config.command_type == JOINT_STATE else Float64MultiArray
            self._command = self.create_publisher(kind, config.command_topic, state_qos())
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
        names = publishing_nodes(self, topic)
        if len(names) > 1:
            words = f'{topic} is published by {name_list(names)}: only one of them may'
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
