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

"""Recordings in bags: a topic with the rows, and perhaps one with the slip or a position."""

import contextlib
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats, Ints, Samples, Stamps
from slip_detector.chain.stamp_rules import GAP_PERIODS
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import name_list, refuse
from slip_detector.recordings.bag_storage import BagStorage, Message, make_typestore
from slip_detector.recordings.labels import Labels, label_times, take_accuracy_and_kind
from slip_detector.recordings.mcap import Topic
from slip_detector.recordings.messages import JOINT_FIELDS, FieldReader, JointStateReader
from slip_detector.recordings.rates import measure_rate, require_rate
from slip_detector.recordings.recording import PIECE_ROWS, Recording

JOINT_STATE = 'sensor_msgs/msg/JointState'
BOOL = 'std_msgs/msg/Bool'

#: The topic that is read if no other is configured.
TOPIC = 'voltages'

#: Number of messages that are decoded first, to find the rate and the samples per message.
FIRST_MESSAGES = 1024


class _Decoded(NamedTuple):
    """The rows of some messages, all messages that have rows one after the other.

    Attributes
    ----------
    volts : ndarray, shape (n, channels)
    stamps_ns, received_ns, counts : ndarray of int, shape (m,)
        Stamp of each message, or the time of receipt where that is 0 or there is none, as in the
        detector; time of receipt; and number of rows.
    dropped : int
        Number of messages that cannot be decoded, or have other channels or names.
    """

    volts: Floats
    stamps_ns: Stamps
    received_ns: Stamps
    counts: Ints
    dropped: int


class _Decoder:
    """Decodes the messages of a topic to rows.

    Attributes
    ----------
    channels : int
        Number of channels in the first message; 0 before the first message.
    names : tuple of str
        Names of the channels in the first message; empty if it has none.
    """

    names: tuple[str, ...]

    def __init__(self, topic: Topic, field: str) -> None:
        self._msgtype, self._typestore = topic.msgtype, make_typestore(topic)
        self._field, self._numbers_of = field, FieldReader(field)
        is_joint_state = topic.msgtype == JOINT_STATE and field in JOINT_FIELDS
        self._joint_states = JointStateReader(field) if is_joint_state else None
        self._error: Exception | str = f'the field {field} is empty in every message'
        self.channels, self.names = 0, ()

    def decode(self, messages: list[Message]) -> _Decoded:
        """Decode messages; a ValueError when none of those so far has channels."""
        parts, received, counts = list[Samples](), list[int](), list[int]()
        for samples, sources in self._samples_of(messages):
            if samples.volts.size and self._fits(samples):
                parts.append(samples)
                received += [received_ns for received_ns, _ in sources]
                counts += [len(samples.volts) // len(sources)] * len(sources)
        if not self.channels:
            raise ValueError(f'{self._error}; --field (recording_field) names one')
        volts = np.concatenate([np.empty((0, self.channels)), *(part.volts for part in parts)])
        stamps_ns = np.concatenate([np.empty(0, np.int64), *(part.stamps_ns for part in parts)])
        received_ns = np.array(received, np.int64)
        stamps_ns = np.where(stamps_ns == 0, received_ns, stamps_ns)
        dropped = len(messages) - len(received)
        return _Decoded(volts, stamps_ns, received_ns, np.array(counts, np.int64), dropped)

    def _samples_of(self, messages: list[Message]) -> Iterator[tuple[Samples, list[Message]]]:
        """Yield the samples of messages with one stamp each: at once if they are alike."""
        if self._joint_states:
            with contextlib.suppress(ValueError):  # They are not.
                yield self._joint_states.read([raw for _, raw in messages]), messages
                return
        for message in messages:
            try:
                samples = self._read(message[1])
            except Exception as error:  # generated code of rosbags may raise anything
                self._error = error
            else:
                yield samples, [message]

    def _read(self, raw: bytes) -> Samples:
        """Return the rows of a message, with its one stamp; 0: it has none."""
        if self._joint_states:
            return self._joint_states.read([raw])
        message = self._typestore.deserialize_cdr(raw, self._msgtype)
        stamp = getattr(getattr(message, 'header', None), 'stamp', None)
        stamp_ns = 0 if stamp is None else stamp.sec * 1_000_000_000 + stamp.nanosec
        names = getattr(message, 'name', ())
        is_list = isinstance(names, list) and all(isinstance(name, str) for name in names)
        rows, stamps_ns = self._numbers_of(message), np.array([stamp_ns], np.int64)
        return Samples(rows, stamps_ns, names=tuple(names) if is_list else ())

    def _fits(self, samples: Samples) -> bool:
        """Return whether rows have the channels and names of the first rows."""
        channels = samples.volts.shape[1]
        names = samples.names if len(samples.names) == channels else ()
        if not self.channels:
            self.channels, self.names = channels, names
        return (channels, names) == (self.channels, self.names)


class BagRecording(Recording):
    """A topic of a bag; labels written by hand take precedence over a topic with the truth."""

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._storage = BagStorage(path)
        self._found_damage = ''.join(f' ({line})' for line in self._storage.damage[:1])
        self._topic = self._find_rows_topic(config.recording_topic)
        usual = 'position' if self._topic.msgtype == JOINT_STATE else 'data'
        self._field = config.recording_field or usual
        self.input = {'input_type': self._topic.msgtype, 'input_field': self._field}
        self._label_topic = label_topic = self._find_label_topic(config)
        #: Whether a Bool is the label: it has no stamp, and holds for rows received after it.
        self._has_states = label_topic is not None and label_topic.msgtype == BOOL
        self._still_m = config.recording_still_m
        self.has_truth |= label_topic is not None
        if labels is None:
            self.accuracy_s, self.kind = take_accuracy_and_kind(self._storage.custom_data)
        decoder = _Decoder(self._topic, self._field)
        first = next(self._decoded(self._topic, decoder), None)
        if first is None or not len(first.volts):
            raise ValueError(f'has no samples on {self._topic.name}{self._found_damage}')
        self.channel_names = decoder.names or default_channel_names(decoder.channels)
        self._per_message = int(np.median(first.counts))
        self.n_rows = self._storage.counts[self._topic.name] * self._per_message
        message_hz = measure_rate(first.stamps_ns, f'the stamps on {self._topic.name}')
        self.sample_rate_hz = require_rate(message_hz * self._per_message)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the topic, some thousands at a time."""
        edges_ns, last_ns = self._edges_ns(), None
        self.counts.damage = '; '.join(self._storage.damage)
        for decoded in self._decoded(self._topic, _Decoder(self._topic, self._field)):
            self.counts.dropped += decoded.dropped * self._per_message
            if len(decoded.volts):
                stamps_ns = self._spread(decoded, last_ns)
                last_ns = int(stamps_ns[-1])
                rows = Samples(decoded.volts, stamps_ns)
                if edges_ns is not None:
                    late_ns = np.repeat(decoded.received_ns - decoded.stamps_ns, decoded.counts)
                    at_ns = stamps_ns + (late_ns if self._has_states else 0)
                    rows = rows._replace(**label_times(at_ns, edges_ns, self.accuracy_s))
                yield rows

    def _decoded(self, topic: Topic, decoder: _Decoder) -> Iterator[_Decoded]:
        """Yield the messages of a topic, some thousands of rows at a time."""
        messages = self._storage.messages(topic)
        most = FIRST_MESSAGES
        while read := list(itertools.islice(messages, most)):
            decoded = decoder.decode(read)
            yield decoded
            # As many as give the usual number of rows.
            most = max(1, PIECE_ROWS * len(read) // max(1, len(decoded.volts)))

    def _spread(self, decoded: _Decoded, last_ns: 'int | None') -> Stamps:
        """Return the stamp of each row.

        A message with several samples has the stamp of the last one. The others are spread evenly
        over the time since the previous message or, after a gap, have their nominal period.
        """
        ends_ns, counts = decoded.stamps_ns, decoded.counts
        usual_ns = counts * (1e9 / self.sample_rate_hz)
        spans_ns = np.diff(ends_ns, prepend=ends_ns[0] if last_ns is None else last_ns)
        near = (spans_ns > 0) & (spans_ns < GAP_PERIODS * usual_ns)
        steps_ns = np.where(near, spans_ns, usual_ns) / counts
        left = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(len(decoded.volts))
        before_ns = np.rint(left * np.repeat(steps_ns, counts)).astype(np.int64)
        return np.asarray(np.repeat(ends_ns, counts) - before_ns)

    def _edges_ns(self) -> 'Stamps | None':
        """Return when slip begins and ends by a topic; None if that is not the label."""
        topic = self._label_topic
        if self._labels is not None or topic is None:
            return None
        field = 'data' if self._has_states else 'position'
        parts = list(self._decoded(topic, _Decoder(topic, field)))
        values = np.concatenate([part.volts for part in parts])
        stamps_ns = np.concatenate([part.stamps_ns for part in parts])
        if (np.diff(stamps_ns) < 0).any():
            refuse(f'the times on {topic.name} fall', 'rising, or --labels (recording_labels)')
        if self._has_states:
            return np.asarray(stamps_ns[np.diff(values[:, 0] != 0.0, prepend=False)])
        # Slip lasts between two positions that differ, including the times of both (Eq. 9).
        moves = (np.abs(np.diff(values, axis=0)) > self._still_m).any(axis=1)
        changes = np.flatnonzero(np.diff(moves, prepend=False, append=False))
        return np.asarray(stamps_ns[changes] + np.arange(len(changes)) % 2)

    def _find_rows_topic(self, name: str) -> Topic:
        """Find the topic that has the rows."""
        topics = self._storage.topics
        found = _find_topics(topics, name or TOPIC)
        if len(found) == 1:
            return found[0]
        known = name_list([f'{topic.name} ({topic.msgtype})' for topic in found or topics])
        there = f'there are: {known or "none"}{self._found_damage}'
        what = f'has {len(found) or "no"} topics {name or TOPIC}, {there}'
        raise ValueError(f'{what}; --topic (recording_topic) names one')

    def _find_label_topic(self, config: RecordingConfig) -> 'Topic | None':
        """Find the topic of the label: that in the namespace of the rows, else the only one."""
        truth, position = config.recording_truth_topic, config.recording_position_topic
        usual = RecordingConfig()
        others = [topic for topic in self._storage.topics if topic != self._topic]
        known = name_list([topic.name for topic in others if topic.msgtype in (BOOL, JOINT_STATE)])
        wanted = f'topic {truth} (Bool) or {position} (JointState)'
        self.label_name = f'{wanted}, there are: {known or "none"}'
        for name, msgtype in ((truth, BOOL), (position, JOINT_STATE)):
            alike = [topic for topic in others if topic.msgtype == msgtype]
            beside = f'{self._topic.name.rpartition("/")[0]}/{name}'
            found = _find_topics(alike, beside) or _find_topics(alike, name)
            if len(found) == 1:
                return found[0]
            if name not in (usual.recording_truth_topic, usual.recording_position_topic):
                raise ValueError(f'has no {self.label_name}')
        return None


def _find_topics(topics: list[Topic], name: str) -> list[Topic]:
    """Return the topics of a name; a name without leading / matches any namespace."""
    ends = () if name.startswith('/') else f'/{name}'
    return [topic for topic in topics if topic.name == name or topic.name.endswith(ends)]
