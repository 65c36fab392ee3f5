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

"""Subscriptions whose messages are taken now and then, many at once, and not waited for."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slip_detector.nodes.rclpy_internals import receiver

#: Number of messages of a topic that are taken at once: more than a queue of samples holds.
AT_MOST = 2000


class PolledTopics:
    """The subscriptions of a node that nobody spins.

    To wait for each message, wake up and gather what has come costs several times as much as the
    message. It is true while there are any subscriptions.

    Parameters
    ----------
    node
        The node that subscribes.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._subscriptions: list[Subscription] = []
        self._receivers: list[Callable[[], None]] = []

    def __bool__(self) -> bool:
        return bool(self._subscriptions)

    def add(
        self,
        message_type: Any,
        topic: str,
        qos: QoSProfile,
        take: Callable[..., None],
        *,
        raw: bool = False,
    ) -> None:
        """Subscribe; each message goes to a function, which may ask for its information too."""
        subscription = self._node.create_subscription(
            message_type,
            topic,
            take,
            qos,
            # No events are awaited, and who waits for them would be woken at each message.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=raw,
        )
        self._subscriptions.append(subscription)
        self._receivers.append(receiver(subscription, AT_MOST))

    def poll(self) -> None:
        """Pass on what has come, in the order in which the subscriptions were added."""
        for receive in self._receivers:
            receive()

    def close(self) -> None:
        """End all subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions, self._receivers = [], []
