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

import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.chain.layout import flag_layout, flag_names
from slip_detector.chain.samples import Bools
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.nodes import messages
from slip_detector.parameters import DetectorConfig
from slip_detector.recordings.messages import STATES, JointStateWriter

#: Longest silence of ``slip`` that the publisher promises, in periods of the heartbeat.
DEADLINE_BEATS = 2.0

#: Longest time, in seconds, for which a detector waits until subscribers have acknowledged; at the
#: end of a process its detectors wait one after the other.
ACKNOWLEDGED_S = 0.3


class Outputs:
    """The publishers of the present configuration, and the latest decisions.

    All topics follow from one state: the row of flags that was published last, and, at its end,
    whether any group could vote.

    Attributes
    ----------
    onsets : int
        Number of onsets that were published.
    slip_subscribers, envelope_subscribers : callable
        Return the number of subscribers to ``slip`` and to the envelope.
    """

    def __init__(self, node: Node, config: DetectorConfig) -> None:
        self._node = node
        # By topic and deadline.
        self._publishers: dict[tuple[str, int], Publisher] = {}
        # What each column of flags is of (slip, group, channel, ...), and the name of the group or
        # channel; the last column is slip_valid.
        self._columns: list[tuple[str, str]] = []
        self._states = b''  # A byte for each column.
        self.onsets = 0
        # Stamps of the latest sample, or 0, and of the last onset.
        self._at_ns = self._onset_ns = 0
        self._frame_id = ''
        self._messages = (Bool(data=False), Bool(data=True))
        self.configure(config)

    @property
    def slip(self) -> bool:
        """The decision that was published last."""
        return bool(self._states[0])

    @property
    def valid(self) -> bool:
        """Whether any group could vote on the decision that was published last."""
        return bool(self._states[-1])

    def configure(self, config: DetectorConfig) -> None:
        """Publish by another configuration.

        Decisions on groups and channels of the same names are carried over. Publishers that stay
        the same are kept. The others are destroyed once all have published the present state; on a
        topic that ends the state is OFF.
        """
        self._config = config
        before, self._publishers = self._publishers, {}

        def publisher(message_type: Any, topic: str, qos: QoSProfile) -> Publisher:
            key = topic, qos.deadline.nanoseconds
            found = before.pop(key, None) or self._node.create_publisher(message_type, topic, qos)
            self._publishers[key] = found
            return found

        beat = messages.heartbeat_qos(DEADLINE_BEATS / config.heartbeat_hz)
        self._slip = publisher(Bool, 'slip', beat)
        self.slip_subscribers = self._slip.get_subscription_count
        self._slip_valid = publisher(Bool, 'slip_valid', beat)
        self._state = publisher(JointState, 'slip_state', beat)
        self._onset = publisher(Header, 'slip_onset', messages.event_qos())
        self._writer: JointStateWriter | None = None
        self._envelope = publisher(JointState, '~/envelope', messages.sensor_qos())
        self.envelope_subscribers = self._envelope.get_subscription_count
        states = dict(zip(self._columns, self._states, strict=True))
        self._columns = [*flag_names(config), ('slip_valid', '')]
        self._states = bytes(states.get(column, False) for column in self._columns)
        published = {'group': config.publish_groups, 'channel': config.publish_channels}
        disabled = {('channel', config.names[channel - 1]) for channel in config.disabled_channels}
        # By column, the publisher of its changes; without slip, column 0.
        self._listeners = {
            column: publisher(Bool, f'slip/{part}/{name}', messages.state_qos())
            for column, (part, name) in enumerate(self._columns)
            if published.get(part) and (part, name) not in disabled
        }
        flags = flag_layout(config)
        self._can_vote = slice(flags.can_vote_at, flags.channels_at)
        for column, each in self._listeners.items():
            each.publish(self._messages[self._states[column]])
        self.beat()
        for (topic, _), each in before.items():
            if topic.startswith('slip/'):  # The other topics go on, by another publisher.
                each.publish(self._messages[False])
        self.received(before.values())
        for each in before.values():
            self._node.destroy_publisher(each)

    def destroy(self) -> None:
        """Destroy the publishers, once subscribers have what was published."""
        self.received()
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)

    def end(self) -> None:
        """Publish all decisions as OFF and not valid, even those that are, and destroy."""
        self._states = b'\x01' * len(self._states)
        self.withdraw()
        self.destroy()

    def received(self, publishers: Iterable[Publisher] | None = None) -> bool:
        """Return whether all subscribers have what is published; wait for them briefly."""
        until_s = time.monotonic() + ACKNOWLEDGED_S
        for publisher in self._publishers.values() if publishers is None else publishers:
            left_s = max(0.0, until_s - time.monotonic())
            if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
                return False
        return True

    def withdraw(self) -> None:
        """Publish all decisions as OFF and not valid, for late subscribers too."""
        self.announce(np.zeros(len(self._states) - 1, np.bool_), 0, self._frame_id)

    def announce(self, flags: Bools, at_ns: int, frame_id: str, *, settled: bool = True) -> None:
        """Publish the decisions on a sample that differ from those on the sample before.

        Parameters
        ----------
        flags : ndarray, shape (k,)
            A row of :attr:`.SlipResult.flags`.
        at_ns, frame_id
            Stamp and frame of the sample.
        settled
            Whether a change of ``slip`` to ON is an onset. Shortly after a change of parameters it
            may be a consequence of the new parameters.
        """
        self._at_ns = at_ns
        if frame_id != self._frame_id:
            self._frame_id, self._writer = frame_id, None
        flags_bytes, before = flags.tobytes(), self._states
        states = flags_bytes + (b'\x01' if 1 in flags_bytes[self._can_vote] else b'\x00')
        if states == before:
            return
        self._states = states
        slip, was_on, valid, was_valid = states[0], before[0], states[-1], before[-1]
        onset = slip > was_on and settled
        if onset:
            self._onset_ns = at_ns
        if valid < was_valid:  # Before slip: an OFF that follows is not reliable.
            self._slip_valid.publish(self._messages[valid])
        # First, as the search for the other changes takes a tenth of the latency.
        if slip != was_on:
            self._slip.publish(self._messages[slip])
        if slip != was_on or valid != was_valid:
            self._publish_state()
        differ = np.frombuffer(states, np.uint8) != np.frombuffer(before, np.uint8)
        for column in np.flatnonzero(differ).tolist():
            if column in self._listeners:
                self._listeners[column].publish(self._messages[states[column]])
        if onset:
            self.onsets += 1
            self._onset.publish(Header(stamp=messages.time_message(at_ns), frame_id=frame_id))
        if valid > was_valid:
            self._slip_valid.publish(self._messages[valid])

    def _publish_state(self) -> None:
        """Publish slip and slip_valid as of the latest sample, and when the last onset was."""
        at_ns = self._at_ns or self._node.get_clock().now().nanoseconds
        header = Header(stamp=messages.time_message(at_ns), frame_id=self._frame_id)
        values = float(self.slip), float(self.valid), self._onset_ns * 1e-9
        self._state.publish(JointState(header=header, name=STATES, position=values))

    def show_envelope(self, at_ns: int, result: SlipResult) -> None:
        """Publish the levels of the last row, which are compared with the threshold.

        The level of a channel that is not valid is NaN.
        """
        if self._writer is None:
            self._writer = JointStateWriter(self._frame_id, self._config.names, efforts=True)
        effort = result.channels[-1].astype(np.float64)
        level = np.where(result.valid[-1], result.level[-1], np.nan)
        self._envelope.publish(self._writer.serialize(at_ns, level, effort))

    def beat(self) -> None:
        """Repeat ``slip``, ``slip_valid`` and ``slip_state``."""
        self._slip.publish(self._messages[self.slip])
        self._slip_valid.publish(self._messages[self.valid])
        self._publish_state()
