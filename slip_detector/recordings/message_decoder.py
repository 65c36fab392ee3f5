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

"""Decodes serialised messages (CDR) of a topic to rows, all messages of one layout at once."""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.recordings.field_paths import FieldReader
from slip_detector.recordings.message_layout import MessageLayout, channel_names, read_layout

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

#: Number of layouts that are kept; messages with further layouts are decoded one by one.
MOST_LAYOUTS = 32


class MessageRows(NamedTuple):
    """Rows of consecutive messages.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (m,)
        Stamps of the m messages.
    samples : ndarray of int, shape (m,)
        Number of rows in each message; their sum is n.
    which : ndarray of int, shape (m,)
        Index of each of these messages in the input. A message is left out if it cannot be
        decoded, or has other channels or names than the first one.

    Examples
    --------
    >>> stamps_ns, one_each = np.array([0, 10]), np.array([1, 1])
    >>> found = MessageRows(np.ones((2, 4)), stamps_ns, one_each, which=np.array([0, 2]))
    >>> found.which.tolist()  # message 1 could not be decoded
    [0, 2]
    """

    volts: Floats
    stamps_ns: Stamps
    samples: Stamps
    which: NDArray[np.intp]


class _LayoutGroup(NamedTuple):
    """Messages of one layout: indices, volts (m, samples, channels), stamps and names."""

    which: NDArray[np.intp]
    volts: Floats
    stamps_ns: Stamps
    names: tuple[str, ...]


class MessageDecoder:
    """Decodes the messages of one type.

    Parameters
    ----------
    typestore
        The type store of rosbags that defines the type.
    msgtype
        Name of the type, for example ``sensor_msgs/msg/JointState``.
    field
        Path of the field whose numbers are the channels.

    Attributes
    ----------
    channels : int
        Number of channels in the first message; 0 before the first message.
    names : tuple of str
        Names of the channels in the first message; empty if it has none.

    Examples
    --------
    >>> from slip_detector.recordings.message_encoder import JointStateEncoder
    >>> from slip_detector.recordings.topics import JOINT_STATE, standard_typestore
    >>> encoder = JointStateEncoder(standard_typestore(), 'tip', ['a', 'b'])
    >>> raws = encoder.many(np.array([[4.3, 4.2], [4.1, 4.0]]), np.array([5, 10]))
    >>> decoder = MessageDecoder(standard_typestore(), JOINT_STATE, 'position')
    >>> decoder.many(raws, received_ns=[0, 0]).volts.tolist(), decoder.names
    ([[4.3, 4.2], [4.1, 4.0]], ('a', 'b'))
    """

    def __init__(self, typestore: Any, msgtype: str, field: str) -> None:
        self._typestore, self._msgtype = typestore, msgtype
        self._field = FieldReader(field)
        self._layouts: dict[int, list[MessageLayout]] = {}
        self.channels = 0
        self.names: tuple[str, ...] = ()

    def one(self, raw: bytes) -> tuple[Floats, int | None, tuple[str, ...]]:
        """Decode one message.

        Returns
        -------
        rows : ndarray, shape (samples, channels)
        stamp_ns : int or None
            Stamp of the header; None if the message has no header.
        names : tuple of str

        Raises
        ------
        ValueError
            When the message cannot be decoded or has no such field.
        """
        message = self.message(raw)
        rows = self._field(message)
        stamp = getattr(getattr(message, 'header', None), 'stamp', None)
        stamp_ns = None if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        return rows, stamp_ns, channel_names(message, rows.shape[1])

    def message(self, raw: bytes) -> Any:
        """Decode one message as an object with its fields as attributes.

        Raises
        ------
        ValueError
            When the bytes are not a message of this type.
        """
        try:
            return self._typestore.deserialize_cdr(raw, self._msgtype)
        except Exception as error:  # generated code of rosbags may raise anything
            raise ValueError(f'a message is no {self._msgtype} ({error})') from None

    def many(self, raws: Sequence[bytes], received_ns: Sequence[int]) -> MessageRows:
        """Decode messages, at least one.

        Parameters
        ----------
        raws
            The messages, oldest first.
        received_ns
            Time of receipt of each. As in the detector, it is the stamp of a message without
            header or with the stamp 0.

        Raises
        ------
        ValueError
            As in :meth:`one`, until a first message has been decoded; also if no message has
            channels.
        """
        try:
            received = np.array(received_ns, dtype=np.int64)
        except OverflowError:
            raise ValueError('a message was received beyond the year 2262') from None
        lengths = np.array([len(raw) for raw in raws])
        groups: list[_LayoutGroup] = []
        for length in np.unique(lengths).tolist():
            groups += self._groups(raws, received, np.flatnonzero(lengths == length))
        groups.sort(key=lambda group: int(group.which[0]))
        if not self.channels:
            first = next((group for group in groups if group.volts.shape[2]), None)
            if first is None:
                raise ValueError(f'the field {self._field.path} is empty in every message')
            self.channels, self.names = first.volts.shape[2], first.names
        kept = [
            group
            for group in groups
            if group.volts.shape[2] == self.channels and group.names == self.names
        ]
        if not kept:
            nothing = np.empty(0, dtype=np.int64)
            return MessageRows(np.empty((0, self.channels)), nothing, nothing, nothing)
        samples = [np.full(len(group.which), group.volts.shape[1]) for group in kept]
        volts = [group.volts.reshape(-1, self.channels) for group in kept]
        if len(kept) == 1:
            return MessageRows(volts[0], kept[0].stamps_ns, samples[0], kept[0].which)
        which = np.concatenate([group.which for group in kept])
        n_of = np.concatenate(samples)
        order = np.argsort(which)
        of_rows = np.argsort(np.repeat(which, n_of), kind='stable')
        stamps_ns = np.concatenate([group.stamps_ns for group in kept])
        return MessageRows(
            np.concatenate(volts)[of_rows], stamps_ns[order], n_of[order], which[order]
        )

    def _groups(
        self, raws: Sequence[bytes], received_ns: Stamps, which: NDArray[np.intp]
    ) -> list[_LayoutGroup]:
        """Decode messages of the same length."""
        length = len(raws[which[0]])
        layouts = self._layouts.setdefault(length, [])
        joined = b''.join([raws[i] for i in which.tolist()])
        block = np.frombuffer(joined, np.uint8).reshape(len(which), length)
        groups: list[_LayoutGroup] = []
        tried = 0
        while len(which):
            if tried == len(layouts):
                made = self._make_layout(raws[which[0]])
                if made is None:
                    alone = [self._alone(raws[i], received_ns, i) for i in which.tolist()]
                    return groups + [group for group in alone if group is not None]
                layouts.append(made)
            layout = layouts[tried]
            tried += 1
            alike = layout.fits(block)
            if alike.any():
                mine = block if alike.all() else block[alike]
                stamps_ns = _or_received(layout.stamps_ns(mine), received_ns[which[alike]])
                volts = layout.rows(mine)
                groups.append(_LayoutGroup(which[alike], volts, stamps_ns, layout.names))
                which, block = which[~alike], block[~alike]
        return groups

    def _alone(self, raw: bytes, received_ns: Stamps, i: int) -> _LayoutGroup | None:
        """Decode one message; if that fails, return None unless none was decoded before."""
        try:
            rows, stamp_ns, names = self.one(raw)
        except ValueError:
            if not self.channels:
                raise
            return None
        own_ns = None if stamp_ns is None else np.array([stamp_ns])
        stamps_ns = _or_received(own_ns, received_ns[i : i + 1])
        return _LayoutGroup(np.array([i]), rows[np.newaxis], stamps_ns, names)

    def _make_layout(self, raw: bytes) -> MessageLayout | None:
        """Return the layout of a message; None if it cannot be found.

        The caller then decodes the message alone, which raises an error that tells what is wrong.
        """
        if sum(map(len, self._layouts.values())) >= MOST_LAYOUTS:
            return None
        try:
            return read_layout(raw, self._typestore, self._msgtype, self._field)
        except (ValueError, LookupError, struct.error):
            return None


def _or_received(stamps_ns: Stamps | None, received_ns: Stamps) -> Stamps:
    """Return the stamps of messages, with the time of receipt for a stamp that is missing or 0."""
    if stamps_ns is None:
        return received_ns
    return np.where(stamps_ns == 0, received_ns, stamps_ns)
