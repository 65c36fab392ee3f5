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

"""Detects whether several publishers send on a topic at the same time."""

import time
from collections.abc import Callable

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from slip_detector.nodes.messages import sensor_qos
from slip_detector.nodes.rclpy_internals import publisher_counter

#: Most messages of a publisher that may be lost in a row; after a larger step of the numbers it
#: counts as another publisher.
MOST_LOST = 1000

#: Most publishers that can be distinguished.
MOST_SENDERS = 8


class Senders:
    """Detects by the numbers of messages whether several publishers send on a topic.

    The middleware numbers the messages of each publisher. With one publisher each message has the
    next number; if two publishers send, the numbers alternate between two sequences. A publisher
    that exists but does not send is ignored: one that was killed stays known for some twenty
    seconds, and one that is silent does no harm. If a topic has several publishers, the accepted
    one is replaced only after it has been silent for the window. If the middleware does not number
    messages, each publisher counts as sending.

    Parameters
    ----------
    window_s
        Time for which several publishers count as sending after they were heard in turns, and for
        which an accepted publisher may be silent.

    Examples
    --------
    >>> senders = Senders(window_s=1.0)
    >>> [senders.accepts(number, publishers=1) for number in (7, 8, 10)], senders.several
    ([True, True, True], False)
    >>> [senders.accepts(number, publishers=2) for number in (11, 1, 12, 2)], senders.several
    ([True, False, False, False], True)
    """

    def __init__(self, window_s: float) -> None:
        self.window_s = window_s
        # The last number of each sequence, that of the latest message at the end.
        self._rows: list[int] = []
        self._several_s = float('-inf')
        # The last number of the accepted publisher, and when it was heard.
        self._taken: int | None = None
        self._taken_s = float('-inf')

    @property
    def several(self) -> bool:
        """Whether several publishers have been heard in turns within the window."""
        return time.monotonic() - self._several_s < self.window_s

    def accepts(self, number: int | None, publishers: int) -> bool:
        """Note a message; return whether it comes from the only publisher that sends.

        Parameters
        ----------
        number
            The middleware's number of the message; None if it has none.
        publishers
            Number of publishers that are connected to the subscription.
        """
        if publishers < 2:
            self._rows = [] if number is None else [number]
            self._several_s = float('-inf')
            self._taken, self._taken_s = number, time.monotonic()
            return True
        if number is None:
            self._several_s = time.monotonic()
            return False
        now_s, before = time.monotonic(), number - 1
        known = before in self._rows
        if known:
            if self._rows[-1] != before:
                self._several_s = now_s
            self._rows.remove(before)
        self._rows = [*self._rows[1 - MOST_SENDERS :], number]
        goes_on = self._taken is not None and 0 <= before - self._taken <= MOST_LOST
        # Another publisher is accepted when the one before has been silent.
        if goes_on or (known and now_s - self._taken_s >= self.window_s):
            self._taken, self._taken_s = number, now_s
            return not self.several
        return False


class SenderWatch(Senders):
    """A subscription that detects whether several publishers send to it.

    Parameters
    ----------
    node
        The node that subscribes.
    message_class, topic
        What it subscribes to, with the quality of service of samples.
    call
        Called with each serialised message and the middleware's information on it, which it has to
        pass to :meth:`accepts_message`.
    window_s
        As for :class:`Senders`.
    """

    def __init__(
        self,
        node: Node,
        message_class: type,
        topic: str,
        call: Callable[[bytes, dict[str, int | None]], None],
        window_s: float,
    ) -> None:
        super().__init__(window_s)
        self._node = node
        self._subscription = node.create_subscription(
            message_class,
            topic,
            call,
            sensor_qos(),
            # Without this, each sample wakes a wait for events, of which there are none: this
            # quality of service is compatible with that of any publisher.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )
        self._publishers = publisher_counter(self._subscription)

    def destroy(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

    def accepts_message(self, info: dict[str, int | None]) -> bool:
        """Note a message; return whether it comes from the only publisher that sends."""
        return self.accepts(info['publication_sequence_number'], self._publishers())

    def names(self) -> list[str]:
        """Return the full names of the publishing nodes if several send; empty otherwise.

        Nodes that only have a publisher are included: the middleware does not tell who sends.
        """
        if not self.several:
            return []
        return publishing_nodes(self._node, self._subscription.topic_name)


def publishing_nodes(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that have a publisher of a topic.

    A node that was killed is among them for some twenty seconds.
    """
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{each.node_namespace.rstrip("/")}/{each.node_name}' for each in found)
