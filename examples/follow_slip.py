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

"""Act on slip, and hold on when the detector is silent.

``slip`` and ``slip_valid`` repeat ten times a second (``heartbeat_hz``). The subscriptions ask
for a deadline and for liveliness, so the middleware tells this node when they stop: the detector
has died, hangs, or cannot be reached. ``grasp_controller`` does more with the same topics.
"""

import contextlib

import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

#: Longest silence; no less than two heartbeats, which the detector offers. Fast DDS of Jazzy can
#: hold a detector up for half a second when another process joins (docs/nodes.md).
DEADLINE = Duration(seconds=1.0)

QOS = QoSProfile(
    depth=100,  # No change may be missed while this node is busy.
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,  # The last state comes at once.
    deadline=DEADLINE,
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,  # Only a message is a sign of life.
    liveliness_lease_duration=DEADLINE,
)


class SlipFollower(Node):
    """Logs what a gripper should do; replace :meth:`act` to move yours."""

    def __init__(self):
        super().__init__('slip_follower')
        # The last states; None: not heard yet, or silent.
        self._heard = {'slip': None, 'slip_valid': None}
        self._action = ''
        for topic in self._heard:
            self.create_subscription(
                Bool,
                topic,
                lambda message, topic=topic: self._take(topic, message.data),
                QOS,
                event_callbacks=SubscriptionEventCallbacks(
                    deadline=lambda event, topic=topic: self._take(topic, None),
                    liveliness=lambda event, topic=topic: self._on_liveliness(topic, event),
                ),
            )

    def _on_liveliness(self, topic, event):
        if event.alive_count == 0:
            self._take(topic, None)

    def _take(self, topic, state):
        self._heard[topic] = state
        if not self._heard['slip_valid'] or self._heard['slip'] is None:
            action = 'hold the grip: slip is not known'
        elif self._heard['slip']:
            action = 'raise the grip: slip'
        else:
            action = 'keep or relax the grip: no slip'
        if action != self._action:
            self._action = action
            self.act(action)

    def act(self, action):
        """Log the action; called when it changes."""
        self.get_logger().info(action)


def main():
    """Follow slip until Ctrl-C."""
    rclpy.init()
    node = SlipFollower()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
