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

import math
import time

from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

from slip_detector.grasp.law import GraspLaw
from slip_detector.nodes.inputs import publishing_nodes
from slip_detector.nodes.messages import create_publisher, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.nodes.rclpy_internals import ROS_ERROR
from slip_detector.parameters.fields import listed, shown
from slip_detector.parameters.grasp import JOINT_STATE, GraspConfig

#: Length of the queues, so that no change is missed while this node is busy.
DEPTH = 100

#: Most command periods that count as passed between two commands. A longer time is a stall of this
#: node, of which neither the gripper nor the detector knows.
PERIODS_COUNTED = 3

#: Period, in seconds, at which another publisher of the commands is looked for.
OTHERS_S = 1.0

#: Number of checks for silence within ``deadline_s``, and their shortest period in seconds.
LOOKS, SHORTEST_LOOK_S = 10, 1e-3


class GraspController(Node):
    """Commands the grip force of :class:`.GraspLaw` at a fixed rate and at each change of slip.

    ``slip`` is not relied on while ``slip_valid`` is false, nor when either topic has been silent
    for longer than ``deadline_s``: the detector may hang or have been killed, or the network may
    be down. A stall of this node itself (a stopped process, a busy machine) is no silence, as
    messages wait in the queues meanwhile. So silence is measured in calls of a timer, which is
    called only once after a stall, and not by the deadline of the middleware.

    Parameters
    ----------
    cli_args
        ROS arguments for this node, which override those of the process.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('grasp_controller', cli_args=cli_args)
        self.config = config = declare(self, GraspConfig)
        self._check_topic(config.command_topic)
        self._law = GraspLaw(config)
        self._slip = self._slip_valid = self._trusted = False
        # Topics that are silent; for each topic, the number of checks since its last message; and
        # whether both have been heard at the same time yet.
        self._silent = {'slip', 'slip_valid'}
        self._looks_ago = dict.fromkeys(self._silent, 0)
        self._heard = False
        # Time for which this node has run, and when it was last updated.
        self._ran_s, self._counted_s = 0.0, time.monotonic()
        message_type = JointState if config.command_type == JOINT_STATE else Float64MultiArray
        self._command = create_publisher(self, message_type, config.command_topic, state_qos())
        for topic, take in (('slip', self._on_slip), ('slip_valid', self._on_slip_valid)):
            self.create_subscription(Bool, topic, take, state_qos(DEPTH, config.deadline_s))
        # A clock that is set back must not stop the commands.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / config.command_hz, self._command_grip, clock=steady)
        look_s = max(config.deadline_s / LOOKS, SHORTEST_LOOK_S)
        self._looks_allowed = math.ceil(config.deadline_s / look_s)
        self.create_timer(look_s, self._look_for_silence, clock=steady)
        self._commanders: list[str] = []
        self.create_timer(OTHERS_S, self._look_for_others, clock=steady)
        self.get_logger().info(
            f'grip {config.grip_n:g} to {config.limit_n:g} N, waiting for the detector'
        )

    def _check_topic(self, name: str) -> None:
        """Raise a ValueError if the commands cannot be published on a topic of this name."""
        said = f'parameter command_topic is {shown(name)}, allowed: '
        try:
            taken = {self.resolve_topic_name(topic) for topic in ('slip', 'slip_valid')}
            if self.resolve_topic_name(name) in taken:
                raise ValueError(f'{said}a topic of its own, not one of the detector')
        except (ROS_ERROR, InvalidTopicNameException):
            raise ValueError(f'{said}at most 247 characters with the namespace') from None

    def _on_slip(self, message: Bool) -> None:
        self._note_heard('slip')
        changed, self._slip = message.data != self._slip, message.data
        if changed:
            self._command_grip()

    def _on_slip_valid(self, message: Bool) -> None:
        self._note_heard('slip_valid')
        changed, self._slip_valid = message.data != self._slip_valid, message.data
        if changed:
            self._command_grip()

    def _note_heard(self, topic: str) -> None:
        self._silent.discard(topic)
        self._looks_ago[topic] = 0

    def _look_for_silence(self) -> None:
        """Note which topics have been silent for too long."""
        silent = set(self._silent)
        for topic in self._looks_ago:
            self._looks_ago[topic] += 1
            if self._looks_ago[topic] > self._looks_allowed:
                silent.add(topic)
        if silent != self._silent:
            self._silent = silent
            self._command_grip()

    def _look_for_others(self) -> None:
        """Warn when another node commands the same gripper."""
        topic = self._command.topic_name
        names = publishing_nodes(self, topic)
        if len(names) > 1 and names != self._commanders:
            self.get_logger().error(
                f'{topic} is published by {listed(names)}: only one of them may'
            )
        self._commanders = names

    def _time_s(self) -> float:
        """Return the time for which this node has run, without its stalls."""
        now_s = time.monotonic()
        self._ran_s += min(now_s - self._counted_s, PERIODS_COUNTED / self.config.command_hz)
        self._counted_s = now_s
        return self._ran_s

    def _command_grip(self) -> None:
        """Command the force of the law, once both topics of the detector have been heard."""
        self._heard = self._heard or not self._silent
        trusted = self._slip_valid and not self._silent
        if trusted != self._trusted:
            self._trusted = trusted
            self._log_trust(trusted)
        before_n = self._law.force_n
        force_n = self._law.update(self._time_s(), self._slip, trusted)
        if self._slip and force_n > before_n >= self.config.grip_n:
            self.get_logger().info(f'slip: grip raised to {force_n:.2f} N')
        if self._heard:
            self._command.publish(self._command_of(force_n))

    def _command_of(self, force_n: float) -> JointState | Float64MultiArray:
        """Return the gripper's message for a force."""
        config = self.config
        joints = list(config.command_joints)
        efforts = [config.command_factor * force_n] * len(joints)
        if config.command_type != JOINT_STATE:
            return Float64MultiArray(data=efforts)
        message = JointState(name=joints, effort=efforts)
        message.header.stamp = self.get_clock().now().to_msg()
        return message

    def _log_trust(self, trusted: bool) -> None:
        if trusted:
            self.get_logger().info('slip is valid')
            return
        why = f'{" and ".join(sorted(self._silent))} silent' if self._silent else 'not valid'
        do = 'the grip opens' if self.config.on_invalid == 'open' else 'the grip stays as it is'
        self.get_logger().warning(f'slip cannot be relied on ({why}): {do}')
