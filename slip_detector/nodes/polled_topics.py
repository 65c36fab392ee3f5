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

"""Subscriptions that are polled, so that many messages are taken at once."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slip_detector.nodes.rclpy_internals import receiver

#: Most messages of a topic that are taken at a poll: more than a queue of samples holds.
AT_MOST = 2000


class PolledTopics:
    """The subscriptions of a node that is not spun.

    An executor that wakes up for each message costs several times as much as the message. The
    object is true while it has subscriptions.

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
        """Subscribe; ``take`` gets each message and, if it has a second argument, its info."""
        subscription = self._node.create_subscription(
            message_type,
            topic,
            take,
            qos,
            # Events are not needed, and would only cost time.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=raw,
        )
        self._subscriptions.append(subscription)
        self._receivers.append(receiver(subscription, AT_MOST))

    def poll(self) -> None:
        """Pass on received messages, in the order in which the subscriptions were added."""
        for receive in self._receivers:
            receive()

    def close(self) -> None:
        """End all subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions, self._receivers = [], []
