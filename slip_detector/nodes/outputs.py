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

"""The detector's publishers: decisions are published on change, slip and slip_valid repeatedly."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.chain.slip_chain import SlipResult
from slip_detector.nodes.messages import (
    event_qos,
    heartbeat_qos,
    sensor_qos,
    state_qos,
    time_message,
)
from slip_detector.nodes.rclpy_internals import ROS_ERROR
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fields import names_that_affect
from slip_detector.recordings.messages import JointStateWriter

#: Longest silence of ``slip`` that the publisher promises, in periods of the heartbeat.
DEADLINE_BEATS = 2.0

#: Parameters on which the topics and the columns of the decisions depend.
TOPIC_PARAMETERS = names_that_affect(DetectorConfig, 'outputs')


#: Most topics of channels, and most of groups: each is a publisher, which costs time and memory
#: here and in all nodes that discover it.
MOST_TOPICS = 1000


def check_topics(node: Node, config: DetectorConfig) -> None:
    """Check the number of topics of channels and groups, and the lengths of their names.

    Raises
    ------
    ValueError
        When there are too many, or a name is too long for a topic in the node's namespace.
    """
    groups = list(config.groups) if config.publish_groups else []
    channels = config.names if config.publish_channels else ()
    for parameter, names in (('publish_groups', groups), ('publish_channels', channels)):
        if len(names) > MOST_TOPICS:
            raise ValueError(
                f'parameter {parameter} is true with {len(names)} topics, allowed: at most '
                f'{MOST_TOPICS}, or false'
            )
    for parameter, kind, names in (
        ('groups', 'group', groups),
        ('channel_names', 'channel', channels),
    ):
        longest = max(names, key=len, default='')
        try:
            node.resolve_topic_name(f'slip/{kind}/{longest or kind}')
        except ROS_ERROR:
            raise ValueError(
                f'parameter {parameter} has a name of {len(longest)} characters, allowed: at most '
                f'247 in slip/{kind}/<name> and the namespace before it'
            ) from None


def columns_of(config: DetectorConfig) -> list[tuple[str, str, int]]:
    """Return what each column of :attr:`.SlipResult.flags` is: kind, name, and number of channels.

    Channels are the same only where there are as many.
    """
    n = config.channels
    return [
        ('slip', '', 0),
        *((kind, name, 0) for kind in ('group', 'can_vote') for name in config.groups),
        *((kind, name, n) for kind in ('channel', 'valid') for name in config.names),
    ]


class Outputs:
    """The publishers of one configuration, and the latest decisions.

    Parameters
    ----------
    node
        The detector.
    config
        Its parameters.
    before
        The outputs that these replace. Decisions, and publishers that stay the same, are taken
        over; the other publishers are destroyed once the new ones have published the present
        state.

    Attributes
    ----------
    onsets : int
        Number of onsets that were published.
    envelope_subscribers : callable
        Returns the number of subscribers to the envelope.
    """

    def __init__(
        self, node: Node, config: DetectorConfig, before: 'Outputs | None' = None
    ) -> None:
        self._node, self._config = node, config
        # By topic and deadline. Of `_before`, publishers that are used again are taken out.
        self._publishers: dict[tuple[str, int], Publisher] = {}
        self._before = {} if before is None else before._publishers
        self._new: list[Publisher] = []
        beat = heartbeat_qos(DEADLINE_BEATS / config.heartbeat_hz)
        self._slip = self._publisher(Bool, 'slip', beat)
        self._slip_valid = self._publisher(Bool, 'slip_valid', beat)
        self._onset = self._publisher(Header, 'slip_onset', event_qos())
        self._frame_id = ''
        self._writer: JointStateWriter | None = None
        self._envelope = self._publisher(JointState, '~/envelope', sensor_qos())
        self._columns = columns_of(config)
        disabled = {config.names[channel - 1] for channel in config.disabled_channels}
        published = {'group': config.publish_groups, 'channel': config.publish_channels}
        # By column, the publisher of its changes; without slip, column 0.
        self._listeners = {
            column: self._publisher(Bool, f'slip/{kind}/{name}', state_qos())
            for column, (kind, name, _) in enumerate(self._columns)
            if published.get(kind) and not (kind == 'channel' and name in disabled)
        }
        self._can_vote = slice(1 + len(config.groups), 1 + 2 * len(config.groups))
        self._messages = (Bool(data=False), Bool(data=True))
        self._all_off = np.zeros(len(self._columns), np.bool_)
        self._flags, self._valid, self.onsets = self._all_off, False, 0
        if before is not None:
            # Decisions on the same groups, and on channels if there are as many, are carried over.
            flags = dict(zip(before._columns, before._flags, strict=True))
            self._flags = np.array([flags.get(column, False) for column in self._columns])
            self._valid, self.onsets = before._valid, before.onsets
        self._flags_bytes = self._flags.tobytes()
        self.envelope_subscribers = self._envelope.get_subscription_count
        for column, publisher in [(0, self._slip), *self._listeners.items()]:
            if publisher in self._new:
                publisher.publish(self._messages[bool(self._flags[column])])
        if self._slip_valid in self._new:
            self._slip_valid.publish(self._messages[self._valid])
        if before is not None:
            before.destroy()

    def destroy(self) -> None:
        """Destroy the publishers."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
        self._publishers.clear()

    @property
    def slip(self) -> bool:
        """The decision that was published last."""
        return bool(self._flags[0])

    @property
    def valid(self) -> bool:
        """Whether any group could vote."""
        return self._valid

    def withdraw(self) -> None:
        """Publish all decisions as OFF and not valid, for late subscribers too."""
        self.announce(self._all_off, 0, '')

    def announce(
        self, flags: NDArray[np.bool_], at_ns: int, frame_id: str, *, settled: bool = True
    ) -> None:
        """Publish the decisions on a sample that differ from those on the sample before.

        Parameters
        ----------
        flags : ndarray, shape (k,)
            A row of :attr:`.SlipResult.flags`.
        at_ns, frame_id
            Stamp and frame of the sample.
        settled
            Whether a change of ``slip`` to ON is an onset: shortly after a change of parameters it
            may be a consequence of that.
        """
        flags_bytes = flags.tobytes()
        if flags_bytes == self._flags_bytes:
            return
        slip, was_on = flags_bytes[0], self._flags_bytes[0]
        before, self._flags, self._flags_bytes = self._flags, flags, flags_bytes
        valid = 1 in flags_bytes[self._can_vote]
        if valid < self._valid:  # Before slip, as an OFF that follows cannot be relied on.
            self._slip_valid.publish(self._messages[valid])
        # Before NumPy searches for the others, which takes a tenth of the latency.
        if slip != was_on:
            self._slip.publish(self._messages[slip])
        for column in np.flatnonzero(flags != before).tolist():
            publisher = self._listeners.get(column)
            if publisher is not None:
                publisher.publish(self._messages[bool(flags[column])])
        if slip > was_on and settled:
            self.onsets += 1
            self._onset.publish(Header(stamp=time_message(at_ns), frame_id=frame_id))
        if valid > self._valid:
            self._slip_valid.publish(self._messages[valid])
        self._valid = valid

    def show_envelope(self, at_ns: int, frame_id: str, result: SlipResult) -> None:
        """Publish the levels of the last row, which are compared with the threshold.

        The level of a channel that is not valid is NaN.
        """
        if self._writer is None or frame_id != self._frame_id:
            self._frame_id = frame_id
            self._writer = JointStateWriter(frame_id, self._config.names, efforts=True)
        effort = result.channels[-1].astype(np.float64)
        level = np.where(result.valid[-1], result.level[-1], np.nan)
        self._envelope.publish(self._writer.written(at_ns, level, effort))

    def beat(self) -> None:
        """Repeat ``slip`` and ``slip_valid``."""
        self._slip.publish(self._messages[self.slip])
        self._slip_valid.publish(self._messages[self._valid])

    def _publisher(self, message_type: Any, topic: str, qos: QoSProfile) -> Publisher:
        """Return the same publisher of the outputs before, or else create one.

        It has no callback for subscribers with an incompatible quality of service: rclpy would
        check for such events each time the executor waits, which for 24 publishers costs more than
        everything else together. Such a subscriber logs a warning anyway.
        """
        key = topic, qos.deadline.nanoseconds
        publisher = self._before.pop(key, None)
        if publisher is None:
            events = PublisherEventCallbacks(use_default_callbacks=False)
            publisher = self._node.create_publisher(
                message_type, topic, qos, event_callbacks=events
            )
            self._new.append(publisher)
        self._publishers[key] = publisher
        return publisher
