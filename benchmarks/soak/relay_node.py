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

"""A node that only relays: the least that a node can do with the detector's input and output.

It is a process of its own and imports only the quality of service from the package.
"""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import sensor_qos, state_qos


class Relay(Node):
    """Subscribes and publishes as the detector does, with no chain between the two."""

    def __init__(self) -> None:
        super().__init__('slip_relay')
        self._on = False
        self._slip = self.create_publisher(Bool, 'slip', state_qos())
        self._slip.publish(Bool(data=False))
        self.create_subscription(JointState, 'voltages', self._on_voltages, sensor_qos())

    def _on_voltages(self, message: JointState) -> None:
        on = message.effort[0] > 0.0
        if on != self._on:
            self._on = on
            self._slip.publish(Bool(data=on))


def main() -> None:
    """Spin the relay until a signal comes."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Relay())


if __name__ == '__main__':
    main()
