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

"""The places of the numbers in a serialised message (CDR).

The places depend only on the type of the message and on the lengths of its texts and lists, so
they are found once for all messages with the same texts and lengths: a
:class:`~slip_detector.recordings.field_paths.FieldReader` reads a message in which each number is
replaced by its own place.
"""

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.recordings.field_paths import FieldReader

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Bytes = NDArray[np.uint8]

#: Length of the header of a CDR message; its second byte tells the byte order.
HEADER_BYTES = 4

#: NumPy's types of numbers by their names in message definitions.
DTYPES = {
    'bool': '?',
    'byte': 'u1',
    'char': 'u1',
    'octet': 'u1',
    'float32': 'f4',
    'float64': 'f8',
    **{f'int{8 * size}': f'i{size}' for size in (1, 2, 4, 8)},
    **{f'uint{8 * size}': f'u{size}' for size in (1, 2, 4, 8)},
}
_CODES = list(dict.fromkeys(DTYPES.values()))

#: A place is a float64: the index of the number's type times this factor, plus the byte at which
#: the number begins. It is exact for messages below 4 GB.
_TYPE_STEP = 2.0**32


class MessageLayout(NamedTuple):
    """The places of a field's numbers, and of the stamp, in messages with the same layout.

    Attributes
    ----------
    fixed : ndarray of int, shape (k,)
        Indices of the bytes of texts and lengths, which are the same in these messages.
    fixed_bytes : ndarray of uint8, shape (k,)
        These bytes.
    places : ndarray, shape (samples, channels)
        Type and place of each number of the field.
    stamp_bytes : tuple of int, or None
        Bytes at which seconds and nanoseconds of the header's stamp begin; None: no header.
    byte_order : str
        ``<`` or ``>``.
    names : tuple of str
        Names of the channels; empty if the message has none.

    Examples
    --------
    >>> from slip_detector.recordings.message_encoder import JointStateEncoder
    >>> from slip_detector.recordings.topics import JOINT_STATE, standard_typestore
    >>> encoder = JointStateEncoder(standard_typestore(), 'tip', ['a', 'b'])
    >>> first, second = encoder.many(np.array([[4.3, 4.2], [4.1, 4.0]]), np.array([5, 10]))
    >>> layout = read_layout(first, standard_typestore(), JOINT_STATE, FieldReader('position'))
    >>> layout.fits(np.frombuffer(second, np.uint8)[np.newaxis]).tolist(), layout.names
    ([True], ('a', 'b'))
    """

    fixed: NDArray[np.intp]
    fixed_bytes: Bytes
    places: Floats
    stamp_bytes: tuple[int, int] | None
    byte_order: str
    names: tuple[str, ...]

    def fits(self, messages: Bytes) -> NDArray[np.bool_]:
        """Return which of the messages, (m, bytes), have this layout, shape (m,)."""
        return np.asarray((messages[:, self.fixed] == self.fixed_bytes).all(axis=1))

    def stamps_ns(self, messages: Bytes) -> 'Stamps | None':
        """Return the stamps of messages of this layout, (m,); None if they have no header."""
        if self.stamp_bytes is None:
            return None
        seconds, rest = self.stamp_bytes
        stamps_ns = _number(messages, seconds, f'{self.byte_order}i4').astype(np.int64)
        stamps_ns *= 1_000_000_000
        stamps_ns += _number(messages, rest, f'{self.byte_order}u4')
        return stamps_ns

    def rows(self, messages: Bytes) -> Floats:
        """Return the numbers of messages of this layout, shape (m, samples, channels)."""
        with np.errstate(invalid='ignore'):  # a signalling NaN warns
            return self._rows(messages)

    def _rows(self, messages: Bytes) -> Floats:
        codes, begins = np.divmod(self.places.reshape(-1), _TYPE_STEP)
        first, begin = _CODES[int(codes[0])], int(begins[0])
        size = np.dtype(first).itemsize
        if (codes == codes[0]).all() and (np.diff(begins) == size).all():
            end = begin + size * self.places.size
            block = np.ascontiguousarray(messages[:, begin:end])
            rows = block.view(f'{self.byte_order}{first}').astype(np.float64)
        else:
            rows = np.stack(
                [
                    _number(messages, int(at), f'{self.byte_order}{_CODES[int(code)]}')
                    for code, at in zip(codes, begins, strict=True)
                ],
                axis=1,
                dtype=np.float64,
            )
        return rows.reshape(-1, *self.places.shape)


def _number(messages: Bytes, begin: int, dtype: str) -> NDArray[Any]:
    """Return the numbers that begin at the byte ``begin`` of each message, (m,)."""
    size = np.dtype(dtype).itemsize
    return np.ascontiguousarray(messages[:, begin : begin + size]).view(dtype)[:, 0]


def begin_of(place: float) -> int:
    """Return the byte at which the number of a place begins.

    Examples
    --------
    >>> from slip_detector.recordings.message_encoder import JointStateEncoder
    >>> from slip_detector.recordings.topics import JOINT_STATE, standard_typestore
    >>> encoder = JointStateEncoder(standard_typestore(), 'tip', ['a', 'b'])
    >>> (raw,) = encoder.many(np.array([[4.3, 4.2]]), np.array([5]))
    >>> layout = read_layout(raw, standard_typestore(), JOINT_STATE, FieldReader('position'))
    >>> begin_of(layout.places[0, 1]) - begin_of(layout.places[0, 0])
    8
    """
    return int(place % _TYPE_STEP)


def read_layout(raw: bytes, typestore: Any, msgtype: str, field: FieldReader) -> MessageLayout:
    """Find the layout of a message.

    Parameters
    ----------
    raw
        The message.
    typestore
        The type store of rosbags that defines the type.
    msgtype
        Name of the type.
    field
        Reader of the field whose numbers are the channels.

    Raises
    ------
    ValueError, LookupError, struct.error
        When the message is broken or lacks the field.

    Examples
    --------
    >>> from slip_detector.recordings.message_encoder import JointStateEncoder
    >>> from slip_detector.recordings.topics import JOINT_STATE, standard_typestore
    >>> encoder = JointStateEncoder(standard_typestore(), 'tip', ['a', 'b'])
    >>> first, second = encoder.many(np.array([[4.3, 4.2], [4.1, 4.0]]), np.array([5, 10]))
    >>> layout = read_layout(first, standard_typestore(), JOINT_STATE, FieldReader('position'))
    >>> layout.rows(np.frombuffer(second, np.uint8)[np.newaxis]).tolist()
    [[[4.1, 4.0]]]
    """
    reader = _LayoutReader(raw, typestore)
    message = reader.message(msgtype)
    places = field(message)
    # Some writers pad to a multiple of four.
    if not places.size or not 0 <= len(raw) - reader.position < HEADER_BYTES:
        raise ValueError('the message is empty or longer than its fields')
    stamp = getattr(getattr(message, 'header', None), 'stamp', None)
    fixed = np.array(reader.fixed, dtype=np.intp)
    return MessageLayout(
        fixed,
        np.frombuffer(raw, np.uint8)[fixed],
        places,
        None if stamp is None else (begin_of(stamp.sec), begin_of(stamp.nanosec)),
        reader.byte_order,
        channel_names(message, places.shape[1]),
    )


def channel_names(message: Any, channels: int) -> tuple[str, ...]:
    """Return the channel names of a message with names, such as JointState; else none.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> channel_names(SimpleNamespace(name=['a', 'b']), channels=2)
    ('a', 'b')
    >>> channel_names(SimpleNamespace(data=[4.3, 4.2]), channels=2)
    ()
    """
    names = getattr(message, 'name', ())
    if isinstance(names, str) or len(names) != channels:
        return ()
    return tuple(names) if all(isinstance(name, str) for name in names) else ()


class _LayoutReader:
    """Deserialises a message with the place of each number instead of the number."""

    def __init__(self, raw: bytes, typestore: Any) -> None:
        self._raw, self._typestore = raw, typestore
        self.position = HEADER_BYTES
        self.byte_order = '<' if raw[1] & 1 else '>'
        self.fixed: list[int] = list(range(HEADER_BYTES))

    def message(self, msgtype: str, real: bool = False) -> Any:
        """Return a message with places or, if ``real``, with numbers, which become fixed bytes."""
        # The layout of a MultiArray determines the shape of its data, so it must be fixed too.
        real = real or msgtype == 'std_msgs/msg/MultiArrayLayout'
        definition = self._typestore.get_msgdef(msgtype)
        values = [self._value(description, real) for _, description in definition.fields]
        return definition.cls(*values)

    def _value(self, description: Any, real: bool) -> Any:
        from rosbags.interfaces import Nodetype

        kind, inner = description
        if kind == Nodetype.NAME:
            return self.message(inner, real)
        if kind == Nodetype.BASE:
            return self._text() if inner[0] == 'string' else self._number(inner[0], real)
        element, count = inner
        if kind == Nodetype.SEQUENCE:
            count = self._length()
        if count > len(self._raw):
            raise ValueError('a list is longer than the message')
        if element[0] == Nodetype.BASE and element[1][0] != 'string' and not real:
            return self._places(element[1][0], count)
        return [self._value(element, real) for _ in range(count)]

    def _align(self, size: int) -> None:
        self.position += -(self.position - HEADER_BYTES) % size

    def _take(self, size: int) -> bytes:
        begin, self.position = self.position, self.position + size
        if self.position > len(self._raw):
            raise ValueError('the message is too short')
        return self._raw[begin : self.position]

    def _length(self) -> int:
        self._align(4)
        self.fixed.extend(range(self.position, self.position + 4))
        return int(struct.unpack(f'{self.byte_order}I', self._take(4))[0])

    def _text(self) -> str:
        length = self._length()
        text = self._take(length)
        self.fixed.extend(range(self.position - length, self.position))
        return text[:-1].decode()

    def _number(self, name: str, real: bool) -> Any:
        places = self._places(name, 1)
        if not real:
            return places[0]
        dtype = np.dtype(f'{self.byte_order}{DTYPES[name]}')
        begin = self.position - dtype.itemsize
        self.fixed.extend(range(begin, self.position))
        return np.frombuffer(self._raw[begin : self.position], dtype)[0]

    def _places(self, name: str, count: int) -> Floats:
        code = DTYPES[name]
        size = np.dtype(code).itemsize
        if count:
            self._align(size)
        begin = self.position
        self._take(size * count)
        return _TYPE_STEP * _CODES.index(code) + begin + size * np.arange(count, dtype=np.float64)
