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

"""Reads and writes serialised JointState messages faster than rclpy does."""

import contextlib
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from slip_detector.nodes.messages import stamp_ns, time_message

#: The first bytes of a message that is serialised as little-endian CDR.
LITTLE_ENDIAN = b'\x00\x01'

#: Length of the encapsulation header; alignment counts from its end.
ENCAPSULATION_BYTES = 4

STAMP = struct.Struct('<iI')

LENGTH = struct.Struct('<I')

#: First byte after the stamp, where the texts begin.
TEXTS = ENCAPSULATION_BYTES + STAMP.size

DOUBLES = np.dtype('<f8')


class Sample(NamedTuple):
    """The samples of one message.

    Attributes
    ----------
    rows : ndarray, shape (n, channels)
        Oldest first.
    stamp_ns : int or None
        Stamp of the last row; None: unknown.
    names : list of str
        Names of the channels; empty if the message has none.
    frame_id : str
        Frame of the fingertip; empty if the message has none.
    number : int or None
        Number of the message among those of its publisher; None if the message has a stamp of its
        own, or the middleware does not number messages.

    Examples
    --------
    >>> sample = Sample(np.array([[4.3, 4.2]]), 2_000_000_005, ['a', 'b'], 'tip', None)
    >>> sample._replace(stamp_ns=None).rows.shape
    (1, 2)
    """

    rows: NDArray[np.float64]
    stamp_ns: int | None
    names: list[str]
    frame_id: str
    number: int | None = None


class JointStateReader:
    """Reads messages that differ from a first one in stamp and positions only.

    The offset of the positions depends only on the texts and lengths before them. A message in
    which these are the same, byte by byte, has its positions at the same offset; padding bytes may
    have any value.

    Parameters
    ----------
    raw
        The first message, serialised.
    message
        The same message, deserialised by rclpy.

    Raises
    ------
    ValueError
        When it has no positions, or is not serialised as by Fast DDS.

    Examples
    --------
    >>> message = JointState(name=['a', 'b'], position=[4.1, 4.3])
    >>> reader = JointStateReader(serialize_message(message), message)
    >>> message.position[0] = 4.2
    >>> reader.read(serialize_message(message)).rows
    array([[4.2, 4.3]])
    """

    def __init__(self, raw: bytes, message: Any) -> None:
        if not raw.startswith(LITTLE_ENDIAN):
            raise ValueError('not little-endian CDR')
        self._names, self._frame_id = list(message.name), str(message.header.frame_id)
        texts, self._begin, self._n = places_in(raw)
        if self._n != len(message.position):
            raise ValueError('the positions are not where they should be')
        self._fixed = np.array([*range(len(LITTLE_ENDIAN)), *texts])
        self._end = self._begin + 8 * self._n
        if not self._n or raw[self._begin : self._end] != message.position.tobytes():
            raise ValueError('the positions are not where they should be')
        self._wanted = self._fixed_bytes(raw)
        # The same bytes with the padding between them, which rarely changes: quicker to compare.
        self._as_before = raw[TEXTS : self._begin]

    def read(self, raw: bytes) -> Sample | None:
        """Return the sample of a message; None if the message differs in other fields, too."""
        if len(raw) < self._end or not raw.startswith(LITTLE_ENDIAN):
            return None
        between = raw[TEXTS : self._begin]
        if between != self._as_before:
            if self._fixed_bytes(raw) != self._wanted:
                return None
            self._as_before = between
        seconds, rest = STAMP.unpack_from(raw, ENCAPSULATION_BYTES)
        # A writable copy, aligned for float64.
        rows = np.ndarray((1, self._n), DOUBLES, bytearray(raw[self._begin : self._end]))
        return Sample(rows, seconds * 1_000_000_000 + rest, self._names, self._frame_id)

    def _fixed_bytes(self, raw: bytes) -> bytes:
        content: bytes = np.frombuffer(raw, np.uint8)[self._fixed].tobytes()
        return content


class JointStateWriter:
    """Writes messages that differ in stamp and numbers only.

    Parameters
    ----------
    frame_id, names
        Frame and joint names of all messages.
    efforts
        Whether they have efforts, one for each position.

    Examples
    --------
    >>> from rclpy.serialization import deserialize_message
    >>> writer = JointStateWriter('thumb', ['a', 'b'])
    >>> message = deserialize_message(writer.written(5, np.array([4.1, 4.3])), JointState)
    >>> message.header.frame_id, message.position.tolist()
    ('thumb', [4.1, 4.3])
    """

    def __init__(self, frame_id: str, names: Sequence[str], efforts: bool = False) -> None:
        n = len(names)
        numbers = np.arange(1.0, 2 * n + 1)
        message = JointState(
            name=names, position=numbers[:n], effort=numbers[n:] if efforts else []
        )
        message.header.frame_id = frame_id
        raw: bytes = serialize_message(message)
        # Between positions and efforts are the number of velocities, 0, and that of efforts.
        begin = 0
        with contextlib.suppress(ValueError):  # The middleware serialises in another way.
            _, begin, _ = places_in(raw)
        end = begin + 8 * n
        self._position = slice(begin, end)
        self._effort = slice(end + 8, end + 8 + 8 * n if efforts else end + 8)
        found = raw[self._position] + raw[self._effort]
        self._raw: memoryview | None = None
        if raw.startswith(LITTLE_ENDIAN) and found == numbers[: n + n * efforts].tobytes():
            # A memoryview: writing more or fewer bytes than a slice has is an error.
            self._raw = memoryview(bytearray(raw))
        # Published as it is if the middleware serialises in another way.
        self._message = message

    def written(
        self,
        stamp_ns: int,
        position: NDArray[np.float64],
        effort: NDArray[np.float64] | None = None,
    ) -> bytes | JointState:
        """Return a message for a publisher, serialised if the format is known."""
        if self._raw is None:
            self._message.header.stamp = time_message(stamp_ns)
            self._message.position = position
            self._message.effort = [] if effort is None else effort
            return self._message
        STAMP.pack_into(self._raw, ENCAPSULATION_BYTES, *divmod(stamp_ns, 1_000_000_000))
        self._raw[self._position] = position.tobytes()
        if effort is not None:
            self._raw[self._effort] = effort.tobytes()
        return bytes(self._raw)


class JointStates(NamedTuple):
    """The content of many messages with as many positions as efforts, oldest first.

    Attributes
    ----------
    stamps_ns : ndarray of int, shape (n,)
    position, effort : ndarray, shape (n, joints)
    """

    stamps_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    effort: NDArray[np.float64]


def read_joint_states(raws: Sequence[bytes], joints: int) -> JointStates:
    """Read many serialised messages at once; those with another number of joints are left out.

    Examples
    --------
    >>> writer = JointStateWriter('thumb', ['a', 'b'], efforts=True)
    >>> raws = [writer.written(5 * k, np.array([k, 2.0]), np.ones(2)) for k in range(2)]
    >>> read = read_joint_states(raws, 2)
    >>> read.stamps_ns.tolist(), read.position.tolist(), read.effort[0].tolist()
    ([0, 5], [[0.0, 2.0], [1.0, 2.0]], [1.0, 1.0])
    """
    alike = _read_alike(raws, joints) if raws else None
    if alike is not None:
        return alike
    messages = []
    for raw in raws:
        with contextlib.suppress(RuntimeError):  # It is not a JointState.
            message = deserialize_message(raw, JointState)
            if len(message.position) == len(message.effort) == joints:
                messages.append(message)
    return JointStates(
        np.array([stamp_ns(message.header.stamp) for message in messages], np.int64),
        np.reshape([message.position for message in messages], (-1, joints)).astype(float),
        np.reshape([message.effort for message in messages], (-1, joints)).astype(float),
    )


def _read_alike(raws: Sequence[bytes], joints: int) -> JointStates | None:
    """Read messages that differ in stamp and numbers only; None if they differ in more."""
    size = len(raws[0])
    if not all(len(raw) == size and raw.startswith(LITTLE_ENDIAN) for raw in raws):
        return None
    try:
        fixed, begin, n = places_in(raws[0])
    except ValueError:
        return None
    end = begin + DOUBLES.itemsize * n
    # No velocities, and n efforts.
    counts = LENGTH.pack(0) + LENGTH.pack(n)
    effort_begin = end + len(counts)
    if n != joints or size < effort_begin + DOUBLES.itemsize * n:
        return None
    table = np.frombuffer(b''.join(raws), np.uint8).reshape(len(raws), size)
    fixed += range(end, effort_begin)
    if raws[0][end:effort_begin] != counts or (table[:, fixed] != table[0, fixed]).any():
        return None

    def numbers(first: int, kind: str, count: int) -> NDArray[Any]:
        kept = table[:, first : first + count * np.dtype(kind).itemsize]
        return np.ascontiguousarray(kept).view(kind)

    seconds = numbers(ENCAPSULATION_BYTES, '<i4', 1)[:, 0].astype(np.int64)
    rest = numbers(ENCAPSULATION_BYTES + 4, '<u4', 1)[:, 0].astype(np.int64)
    return JointStates(
        seconds * 1_000_000_000 + rest,
        numbers(begin, DOUBLES.str, n),
        numbers(effort_begin, DOUBLES.str, n),
    )


def places_in(raw: bytes) -> tuple[list[int], int, int]:
    """Return the offsets of texts, lengths and positions in a serialised message.

    They follow from the lengths in the message: a text that rclpy returns may be shorter, as it
    ends at the first zero.

    Returns
    -------
    fixed : list of int
        Offsets of the bytes of frame, names, their lengths and the number of positions, without
        padding.
    begin : int
        Offset of the first position.
    n : int
        Number of positions.

    Raises
    ------
    ValueError
        When the message ends before the positions.
    """
    fixed: list[int] = []
    place = TEXTS

    def number() -> int:
        nonlocal place
        place += -(place - ENCAPSULATION_BYTES) % LENGTH.size
        if place + LENGTH.size > len(raw):
            raise ValueError('the message is cut off')
        fixed.extend(range(place, place + LENGTH.size))
        place += LENGTH.size
        return int(LENGTH.unpack_from(raw, place - LENGTH.size)[0])

    def pass_text() -> None:
        nonlocal place
        length = number()
        if place + length > len(raw):
            raise ValueError('the message is cut off')
        fixed.extend(range(place, place + length))
        place += length

    pass_text()
    for _ in range(number()):
        pass_text()
    n = number()
    return fixed, place + -(place - ENCAPSULATION_BYTES) % 8, n
