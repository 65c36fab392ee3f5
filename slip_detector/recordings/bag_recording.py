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

"""Recordings in bags: a topic with the rows, and perhaps a topic with the true slip."""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.chain.stamps import GAP_PERIODS
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed, shown_name
from slip_detector.recordings.bag_storage import BagStorage
from slip_detector.recordings.labels import Labels
from slip_detector.recordings.message_decoder import MessageDecoder, MessageRows
from slip_detector.recordings.rate import checked_rate, rate_of
from slip_detector.recordings.reading_limit import MESSAGE_SHARE, PIECE_ROWS
from slip_detector.recordings.recording import Recording
from slip_detector.recordings.topics import BOOL, JOINT_STATE, Message, Topic, typestore_of
from slip_detector.recordings.truth import PlatformMotion, states_at

Bools = NDArray[np.bool_]
Stamps = NDArray[np.int64]

T = TypeVar('T')

#: The topic that is read if no other is configured.
TOPIC = 'voltages'

#: Number of messages that are decoded first, to find the rate and the samples per message.
FIRST_MESSAGES = 1024


class BagRecording(Recording):
    """A recording in a bag.

    Parameters
    ----------
    path
        The folder of the bag, or one of its files.
    config
        Topics of the rows and of the truth, and the field that has the channels.
    labels
        Labels written by hand, which take precedence over a topic with the truth; None: none.

    Raises
    ------
    ValueError
        When there is no such topic or field, or no sample; names the bag and its topics.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.recordings import write_recording
    >>> rows = Samples(np.full((4, 2), 4.3), np.arange(4) * 10_000_000, None)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'trial.mcap'
    >>> write_recording(path, [rows], 100.0, ['a', 'b'])
    >>> recording = BagRecording(path, RecordingConfig(), labels=None)
    >>> recording.channel_names, [piece.volts.shape for piece in recording.pieces()]
    (('a', 'b'), [(4, 2)])
    >>> folder.cleanup()
    """

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._storage = self._naming(lambda: BagStorage(path, self._limit))
        self._topic = topic = self._rows_topic(config.recording_topic)
        self._typestore = self._naming(lambda: typestore_of(topic))
        self._field = config.recording_field or self._usual_field(topic)
        truth = self._beside(config, 'recording_truth_topic', BOOL)
        position = self._beside(config, 'recording_position_topic', JOINT_STATE)
        self._truth_topic, self._position_topic = truth, None if truth else position
        self._still_m = config.recording_still_m
        self.labelled = bool(truth or position)

        decoder = self._decoder(topic, self._field)
        decoded, _ = next(self._decoded(topic, decoder), (None, None))
        if decoded is None or not len(decoded.volts):
            lost = f' ({self._storage.lost[0]})' if self._storage.lost else ''
            raise ValueError(f'{path}: has no samples on {topic.name}{lost}')
        self.named = bool(decoder.names)
        self.channel_names = decoder.names or default_channel_names(decoder.channels)
        message_hz = rate_of((decoded.stamps_ns - decoded.stamps_ns[0]) * 1e-9)
        if message_hz is None:
            raise ValueError(
                f'{path}: the stamps on {topic.name} do not rise, allowed: two or more messages, '
                'each with its time'
            )
        self._samples = int(np.median(decoded.samples))
        self.sample_rate_hz = checked_rate(message_hz * self._samples, path)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the topic, some thousands at a time."""
        self.counts.warnings = '; '.join(self._storage.doubts)
        truth_at = self._truth()
        decoder = self._decoder(self._topic, self._field)
        messages = 0
        first_ns = last_ns = None
        for decoded, received_ns in self._decoded(self._topic, decoder):
            messages += len(received_ns)
            self.counts.dropped += (len(received_ns) - len(decoded.which)) * self._samples
            if not len(decoded.volts):
                continue
            stamps_ns = self._stamps(decoded, last_ns)
            truth = None
            if truth_at is not None:
                late_ns = received_ns[decoded.which] - decoded.stamps_ns
                truth = truth_at(stamps_ns, np.repeat(late_ns, decoded.samples))
            first_ns = int(stamps_ns[0]) if first_ns is None else first_ns
            last_ns = int(stamps_ns[-1])
            yield Samples(decoded.volts, stamps_ns, truth)
        if self._storage.lost:
            end_s = ((last_ns or 0) - (first_ns or 0)) * 1e-9
            recorded = self._storage.counts.get(self._topic.name, 0)
            missing = recorded - messages
            much = f'{missing} of {recorded} messages on' if missing > 0 else 'what followed on'
            self.counts.damage = (
                f'{"; ".join(self._storage.lost)}: {much} {self._topic.name} is lost, '
                f'{messages} messages up to {end_s:.3f} s are read'
            )

    def _decoder(self, topic: Topic, field: str) -> MessageDecoder:
        typestore = self._typestore
        if topic is not self._topic:
            typestore = self._naming(lambda: typestore_of(topic))
        return self._naming(lambda: MessageDecoder(typestore, topic.msgtype, field))

    def _decoded(
        self, topic: Topic, decoder: MessageDecoder
    ) -> Iterator[tuple[MessageRows, Stamps]]:
        """Yield decoded messages of a topic, and the time at which each was received."""
        messages = self._storage.messages({topic.name})
        n = FIRST_MESSAGES
        while some := self._naming(lambda: self._some(messages, n)):  # noqa: B023
            _, received, raws = zip(*some, strict=True)
            decoded = self._naming(lambda: decoder.many(raws, received))  # noqa: B023
            self._limit.check_channels(decoder.channels)
            yield decoded, np.array(received, dtype=np.int64)
            if len(decoded.samples):
                n = max(1, PIECE_ROWS // max(1, int(np.median(decoded.samples))))

    def _some(self, messages: Iterator[Message], n: int) -> list[Message]:
        """Return the next messages, at most n, and at most as many as the memory limit allows."""
        some = []
        n_bytes = 0
        for message in islice(messages, n):
            size = len(message[2])
            self._limit.check(size, f'a message on {message[0]}', MESSAGE_SHARE)
            some.append(message)
            n_bytes += size
            if n_bytes >= self._limit.message_bytes:
                break
        return some

    def _stamps(self, decoded: MessageRows, last_ns: 'int | None') -> Stamps:
        """Return the stamp of each row.

        A message with several samples has the stamp of the last one. The others are spread evenly
        over the time since the previous message or, after a gap, have their nominal period.
        """
        ends_ns, samples = decoded.stamps_ns, decoded.samples
        if (samples == 1).all():
            return ends_ns
        period_ns = 1e9 / self.sample_rate_hz
        usual_ns = samples * period_ns
        spans_ns = np.diff(ends_ns, prepend=ends_ns[0] if last_ns is None else last_ns)
        near = (spans_ns > 0) & (spans_ns < GAP_PERIODS * usual_ns)
        spans_ns = np.where(near, spans_ns, usual_ns)
        before = np.repeat(np.cumsum(samples) - samples, samples)
        left = np.repeat(samples, samples) - 1 - (np.arange(samples.sum()) - before)
        steps_ns = np.repeat(spans_ns / np.maximum(samples, 1), samples)
        back_ns = np.rint(left * steps_ns).astype(np.int64)
        return np.asarray(np.repeat(ends_ns, samples) - back_ns)

    def _truth(self) -> 'Callable[[Stamps, Stamps], Bools] | None':
        """Return a function that gives the truth of rows; None if the bag does not have it.

        Its arguments are the stamps of the rows and their delays until receipt. A Bool has no
        stamp: it holds for the rows that were received after it. Positions have stamps like rows.
        """
        if self._labels is not None:
            return None
        if self._truth_topic is not None:
            topic = self._truth_topic
            typestore = self._naming(lambda: typestore_of(topic))
            decoder = MessageDecoder(typestore, BOOL, 'data')
            changes = [
                (received_ns, bool(self._naming(lambda: decoder.message(raw)).data))  # noqa: B023
                for _, received_ns, raw in self._storage.messages({topic.name})
            ]
            at_ns = np.array([at for at, _ in changes], dtype=np.int64)
            states = np.array([state for _, state in changes], dtype=bool)
            return lambda stamps_ns, late_ns: states_at(at_ns, states, stamps_ns + late_ns)
        if self._position_topic is not None:
            motion = PlatformMotion(self._still_m)
            decoder = self._decoder(self._position_topic, 'position')
            for decoded, _ in self._decoded(self._position_topic, decoder):
                if len(decoded.volts):
                    motion.add(decoded.stamps_ns, decoded.volts)
            return lambda stamps_ns, _: motion.at(stamps_ns)
        return None

    def _naming(self, act: Callable[[], T]) -> T:
        """Call a function and put the path of the bag in front of its errors."""
        try:
            return act()
        except ValueError as error:
            said = str(error)
            named = said.startswith(f'{self.path}: ')
            raise ValueError(said if named else f'{self.path}: {said}') from None

    def _rows_topic(self, name: str) -> Topic:
        """Find the topic that has the rows."""
        found = [topic for topic in self._storage.topics if _is_named(topic.name, name or TOPIC)]
        if len(found) == 1:
            return found[0]
        every = [f'{topic.name} ({topic.msgtype})' for topic in self._storage.topics]
        known = listed(every)
        if found:
            raise ValueError(
                f'{self.path}: has {listed([topic.name for topic in found])}, allowed: one of '
                'them, named by --topic (recording_topic)'
            )
        lost = f' ({self._storage.lost[0]})' if self._storage.lost else ''
        raise ValueError(
            f'{self.path}: has no topic {name or TOPIC}, there are: {known or "none"}{lost}; '
            '--topic (recording_topic) names one'
        )

    def _beside(self, config: RecordingConfig, parameter: str, msgtype: str) -> 'Topic | None':
        """Find a topic that labels the rows: in their namespace, else in any other."""
        name = getattr(config, parameter)
        alike = [topic for topic in self._storage.topics if topic.msgtype == msgtype]
        full = f'{self._topic.name.rpartition("/")[0]}/{name}'
        found = [topic for topic in alike if topic.name == full]
        found = found or [topic for topic in alike if _is_named(topic.name, name)]
        if len(found) == 1:
            # A topic without messages labels nothing.
            return found[0] if self._storage.counts.get(found[0].name, 1) else None
        if name == getattr(RecordingConfig, parameter):
            return None
        known = listed([topic.name for topic in found or alike])
        raise ValueError(
            f'{self.path}: parameter {parameter} is {name!r}, allowed: one topic of type '
            f'{msgtype}, there are: {known or "none"}'
        )

    def _usual_field(self, topic: Topic) -> str:
        """Return the field that usually has the channels in messages of this type."""
        if topic.msgtype == JOINT_STATE:
            return 'position'
        if topic.msgtype.endswith('MultiArray'):
            return 'data'
        known = self._typestore.fielddefs[topic.msgtype][1]
        fields = listed([name for name, _ in known])
        raise ValueError(
            f'{self.path}: {shown_name(topic.name)} is {shown_name(topic.msgtype)}, allowed: with '
            f'a field named by --field (recording_field), there are: {fields}'
        )


def _is_named(topic: str, name: str) -> bool:
    """Return whether a topic has this name; a name without leading / matches any namespace."""
    return topic == name or (not name.startswith('/') and f'/{topic}'.endswith(f'/{name}'))
