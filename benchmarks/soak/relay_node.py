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

"""A node that only relays: the least that a node can do with the detector's input and output."""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import sensor_qos, state_qos

#: Ten messages a second at 380 Hz, as the detector's heartbeat.
SAMPLES_A_MESSAGE = 38


class Relay(Node):
    """Takes each sample, and publishes as often as the detector repeats its decision."""

    def __init__(self) -> None:
        super().__init__('slip_relay')
        self._samples = 0
        self._slip = self.create_publisher(Bool, 'relay/slip', state_qos())
        self.create_subscription(JointState, 'voltages', self._on_voltages, sensor_qos())

    def _on_voltages(self, message: JointState) -> None:
        self._samples += 1
        if self._samples % SAMPLES_A_MESSAGE == 0:
            self._slip.publish(Bool(data=message.position[0] > 0.0))


def main() -> None:
    """Spin the relay until a signal comes."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Relay())


if __name__ == '__main__':
    main()
