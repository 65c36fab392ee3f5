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
from slip_detector.parameters import RecordingConfig, default_channel_names, name_list, refuse
from slip_detector.recordings.bag_storage import BagStorage, Message, make_typestore
from slip_detector.recordings.labels import (
    Labels,
    label_times,
    take_accuracy_and_kind,
)
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


class _Piece(NamedTuple):
    """The rows of some messages, one after the other.

    Attributes
    ----------
    volts : ndarray, shape (n, channels)
    stamps_ns, received_ns, counts : ndarray of int, shape (m,)
        Stamp of each message, or the time of receipt where that is 0 or there is none, as in the
        detector; time of receipt; and number of rows.
    """

    volts: Floats
    stamps_ns: Stamps
    received_ns: Stamps
    counts: Ints


class _TopicReader:
    """Reads the rows of a topic.

    Attributes
    ----------
    channels : int
        Number of channels in the first message; 0 before the first message.
    names : tuple of str
        Names of the channels in the first message; empty if it has none.
    dropped : int
        Number of messages that were left out in the last reading: they cannot be decoded, or have
        other channels or names.
    """

    names: tuple[str, ...]

    def __init__(self, storage: BagStorage, topic: Topic, field: str) -> None:
        self._storage, self._topic, self._typestore = storage, topic, make_typestore(topic)
        self._field, self._numbers_of = field, FieldReader(field)
        is_joint_state = topic.msgtype == JOINT_STATE and field in JOINT_FIELDS
        self._joint_states = JointStateReader(field) if is_joint_state else None
        self._error: Exception | str = f'the field {field} is empty in every message'
        self.channels, self.names, self.dropped = 0, (), 0

    def pieces(self) -> Iterator[_Piece]:
        """Yield some thousands of rows at a time; a ValueError when no message has channels."""
        messages, most = self._storage.messages(self._topic), FIRST_MESSAGES
        self.dropped = 0
        while read := list(itertools.islice(messages, most)):
            parts, received, counts = list[Samples](), list[int](), list[int]()
            for samples, sources in self._samples_of(read):
                if samples.volts.size and self._fits(samples):
                    parts.append(samples)
                    received += [received_ns for received_ns, _ in sources]
                    counts += [len(samples.volts) // len(sources)] * len(sources)
            if not self.channels:
                raise ValueError(f'{self._error}; --field (recording_field) names one')
            self.dropped += len(read) - len(received)
            if parts:
                joined, received_ns = parts[0].then(*parts[1:]), np.array(received, np.int64)
                stamps_ns = np.where(joined.stamps_ns == 0, received_ns, joined.stamps_ns)
                yield _Piece(joined.volts, stamps_ns, received_ns, np.array(counts, np.int64))
            # As many as give the usual number of rows.
            most = max(1, PIECE_ROWS * len(read) // max(1, sum(counts)))

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
        message = self._typestore.deserialize_cdr(raw, self._topic.msgtype)
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
        topic = self._find_rows_topic(config.recording_topic)
        usual = 'position' if topic.msgtype == JOINT_STATE else 'data'
        field = config.recording_field or usual
        self.input = {'input_type': topic.msgtype, 'input_field': field}
        label_topic = self._find_label_topic(config, topic)
        self.has_truth |= label_topic is not None
        #: Whether a Bool is the label: it has no stamp, and holds for rows received after it.
        self._has_states = label_topic is not None and label_topic.msgtype == BOOL
        self._edges_ns: Stamps | None = None
        if labels is None:
            self.accuracy_s, self.kind = take_accuracy_and_kind(self._storage.custom_data)
            if label_topic is not None:
                self._edges_ns = self._read_edges(label_topic, config.recording_still_m)
        self._reader = reader = _TopicReader(self._storage, topic, field)
        first = next(reader.pieces(), None)
        if first is None:
            raise ValueError(f'has no samples on {topic.name}{self._found_damage}')
        self.channel_names = reader.names or default_channel_names(reader.channels)
        self._per_message = int(np.median(first.counts))
        self.n_rows = self._storage.counts[topic.name] * self._per_message
        message_hz = measure_rate(first.stamps_ns, f'the stamps on {topic.name}')
        self.sample_rate_hz = require_rate(message_hz * self._per_message)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the topic, some thousands at a time."""
        edges_ns, last_ns = self._edges_ns, None
        self.counts.damage = '; '.join(self._storage.damage)
        for piece in self._reader.pieces():
            stamps_ns = self._spread(piece, last_ns)
            last_ns = int(stamps_ns[-1])
            rows = Samples(piece.volts, stamps_ns)
            if edges_ns is not None:
                late_ns = np.repeat(piece.received_ns - piece.stamps_ns, piece.counts)
                at_ns = stamps_ns + (late_ns if self._has_states else 0)
                rows = rows._replace(**label_times(at_ns, edges_ns, self.accuracy_s))
            yield rows
        self.counts.dropped += self._reader.dropped * self._per_message

    def _spread(self, piece: _Piece, last_ns: 'int | None') -> Stamps:
        """Return the stamp of each row.

        A message with several samples has the stamp of the last one. The others are spread evenly
        over the time since the previous message or, after a gap, have their nominal period.
        """
        ends_ns, counts = piece.stamps_ns, piece.counts
        usual_ns = counts * (1e9 / self.sample_rate_hz)
        spans_ns = np.diff(ends_ns, prepend=ends_ns[0] if last_ns is None else last_ns)
        near = (spans_ns > 0) & (spans_ns < GAP_PERIODS * usual_ns)
        steps_ns = np.where(near, spans_ns, usual_ns) / counts
        left = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(len(piece.volts))
        before_ns = np.rint(left * np.repeat(steps_ns, counts)).astype(np.int64)
        return np.asarray(np.repeat(ends_ns, counts) - before_ns)

    def _read_edges(self, topic: Topic, still_m: float) -> Stamps:
        """Return when slip begins and ends by a topic."""
        field = 'data' if self._has_states else 'position'
        pieces = list(_TopicReader(self._storage, topic, field).pieces())
        values = np.concatenate([piece.volts for piece in pieces])
        stamps_ns = np.concatenate([piece.stamps_ns for piece in pieces])
        if (np.diff(stamps_ns) < 0).any():
            refuse(f'the times on {topic.name} fall', 'rising, or --labels (recording_labels)')
        if self._has_states:
            return np.asarray(stamps_ns[np.diff(values[:, 0] != 0.0, prepend=False)])
        # Slip lasts between two positions that differ, including the times of both (Eq. 9).
        moves = (np.abs(np.diff(values, axis=0)) > still_m).any(axis=1)
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

    def _find_label_topic(self, config: RecordingConfig, rows_topic: Topic) -> 'Topic | None':
        """Find the topic of the label: that in the namespace of the rows, else the only one."""
        truth, position = config.recording_truth_topic, config.recording_position_topic
        usual = RecordingConfig()
        others = [topic for topic in self._storage.topics if topic != rows_topic]
        known = name_list([topic.name for topic in others if topic.msgtype in (BOOL, JOINT_STATE)])
        wanted = f'topic {truth} (Bool) or {position} (JointState)'
        self.label_name = f'{wanted}, there are: {known or "none"}'
        for name, msgtype in ((truth, BOOL), (position, JOINT_STATE)):
            alike = [topic for topic in others if topic.msgtype == msgtype]
            beside = f'{rows_topic.name.rpartition("/")[0]}/{name}'
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
