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

"""The bytes of messages (CDR), and the numbers in them, for nodes and recordings.

JointState messages of one sensor differ in stamp and numbers only, so their bytes are read and
written without making a message object of each: an hour of samples in a bag in some seconds, and
a sample in the detector in some microseconds. Neither rclpy nor rosbags is needed for it.

Of other messages a :class:`FieldReader` gives the numbers that a path like ``pillars[].fz``
selects. A message is any object with the fields as attributes, such as one of rclpy or rosbags.
"""

import dataclasses
import re
import struct
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.fields import listed

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

#: Labels of the two dimensions of a ``*MultiArray`` that carries several samples.
BATCH_LABELS = ['sample', 'channel']

#: The first bytes of a message that is serialised as little-endian CDR.
LITTLE_ENDIAN = b'\x00\x01'

#: Length of the encapsulation header; alignment counts from its end.
ENCAPSULATION_BYTES = 4

STAMP = struct.Struct('<iI')
LENGTH = struct.Struct('<I')
DOUBLES = np.dtype('<f8')

#: First byte of a JointState after the stamp, where the texts begin.
TEXTS = ENCAPSULATION_BYTES + STAMP.size

#: The fields of a JointState that are lists of numbers, in their order.
JOINT_FIELDS = ('position', 'velocity', 'effort')

#: Number of groups of messages with equal texts and lengths; further messages are read one by one.
MOST_GROUPS = 32

_STEP = re.compile(r'(?P<name>[A-Za-z]\w*)(\[(?P<element>\d{0,9})\])?', re.ASCII)
_SYNTAX = 'names joined by dots, each perhaps with [] (all elements) or [2] (the third)'


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
    """

    rows: Floats
    stamp_ns: int | None
    names: list[str]
    frame_id: str
    number: int | None = None


class JointStateLayout(NamedTuple):
    """Where the parts of a serialised JointState are.

    Attributes
    ----------
    size : int
        Number of bytes.
    fixed : ndarray of int
        Places of texts and lengths, without the padding between them, which may have any value.
        In messages with equal bytes there the numbers are at the same places.
    fixed_bytes : bytes
    frame_id : str
    names : list of str
    numbers : dict
        Bytes of position, velocity and effort.
    """

    size: int
    fixed: NDArray[np.intp]
    fixed_bytes: bytes
    frame_id: str
    names: list[str]
    numbers: dict[str, slice]

    def fits(self, raw: bytes) -> bool:
        """Return whether another message has this layout, with the same texts."""
        if len(raw) != self.size:
            return False
        return np.frombuffer(raw, np.uint8)[self.fixed].tobytes() == self.fixed_bytes


def joint_state_layout(raw: bytes) -> JointStateLayout:
    """Find the parts of a serialised JointState.

    Raises
    ------
    ValueError
        When the message is cut off, or not serialised as on nearly all machines.
    """
    if not raw.startswith(LITTLE_ENDIAN):
        raise ValueError('not little-endian CDR')
    place = TEXTS
    fixed = [*range(len(LITTLE_ENDIAN))]

    def passed(n: int) -> bytes:
        nonlocal place
        begin, place = place, place + n
        if place > len(raw):
            raise ValueError('the message is cut off')
        return raw[begin:place]

    def fixed_part(n: int) -> bytes:
        fixed.extend(range(place, min(place + n, len(raw))))
        return passed(n)

    def length() -> int:
        passed(-place % LENGTH.size)
        return int(LENGTH.unpack(fixed_part(LENGTH.size))[0])

    def text() -> str:
        return fixed_part(length()).partition(b'\0')[0].decode(errors='replace')

    frame_id = text()
    names = [text() for _ in range(length())]
    numbers = {}
    for field in JOINT_FIELDS:
        n = length()
        passed(-(place - ENCAPSULATION_BYTES) % DOUBLES.itemsize if n else 0)
        passed(DOUBLES.itemsize * n)
        numbers[field] = slice(place - DOUBLES.itemsize * n, place)
    fixed_bytes = bytes(raw[i] for i in fixed)
    return JointStateLayout(len(raw), np.array(fixed), fixed_bytes, frame_id, names, numbers)


class JointStateReader:
    """Reads serialised JointState messages one by one, quickly if they resemble the last one.

    Examples
    --------
    >>> raw = JointStateWriter('tip', ['a', 'b']).written(5, np.array([4.1, 4.3]))
    >>> JointStateReader().read(raw)
    Sample(rows=array([[4.1, 4.3]]), stamp_ns=5, names=['a', 'b'], frame_id='tip', number=None)
    """

    def __init__(self) -> None:
        self._layout: JointStateLayout | None = None
        self._position = slice(0)
        self._texts = b''

    def read(self, raw: bytes) -> Sample:
        """Return the sample of a message, with a stamp of 0 if it has none.

        Raises
        ------
        ValueError
            As :func:`joint_state_layout`.
        """
        layout = self._layout
        if (
            layout is None
            or len(raw) != layout.size
            or raw[TEXTS : self._position.start] != self._texts
            or not raw.startswith(LITTLE_ENDIAN)
        ):
            if layout is None or not layout.fits(raw):  # else only the padding differs
                self._layout = layout = joint_state_layout(raw)
                self._position = layout.numbers['position']
            self._texts = raw[TEXTS : self._position.start]
        seconds, rest = STAMP.unpack_from(raw, ENCAPSULATION_BYTES)
        # A writable copy, aligned for float64.
        content = bytearray(raw[self._position])
        rows = np.ndarray((1, len(content) // DOUBLES.itemsize), DOUBLES, content)
        stamp_ns = seconds * 1_000_000_000 + rest
        return Sample(rows, stamp_ns, layout.names, layout.frame_id)


class JointStateGroup(NamedTuple):
    """Messages that differ in stamp and numbers only.

    Attributes
    ----------
    indices : ndarray of int, shape (n,)
        Their places among all messages.
    layout : JointStateLayout
    table : ndarray of uint8, shape (n, bytes)
    """

    indices: NDArray[np.intp]
    layout: JointStateLayout
    table: NDArray[np.uint8]

    @property
    def stamps_ns(self) -> Stamps:
        """The stamps, (n,)."""
        parts = slice(ENCAPSULATION_BYTES, TEXTS)
        stamps = np.ascontiguousarray(self.table[:, parts])
        seconds, rest = stamps[:, :4].view('<i4'), stamps[:, 4:].view('<u4')
        return np.asarray(seconds.astype(np.int64) * 1_000_000_000 + rest)[:, 0]

    def numbers(self, field: str) -> Floats:
        """Return the numbers of a field, (n, joints)."""
        return np.ascontiguousarray(self.table[:, self.layout.numbers[field]]).view(DOUBLES)


def joint_state_groups(raws: Sequence[bytes]) -> Iterator[JointStateGroup]:
    """Sort serialised JointState messages into groups that are read at once.

    What cannot be read is in no group.

    Examples
    --------
    >>> writer = JointStateWriter('thumb', ['a', 'b'])
    >>> raws = writer.many(np.array([[4.3, 4.2], [4.1, 4.0]]), np.array([5, 10]))
    >>> (group,) = joint_state_groups([b'', *raws])
    >>> group.indices.tolist(), group.stamps_ns.tolist(), group.numbers('position').tolist()
    ([1, 2], [5, 10], [[4.3, 4.2], [4.1, 4.0]])
    """
    sizes = np.array([len(raw) for raw in raws])
    left = np.arange(len(raws))
    groups = 0
    while len(left):
        raw = raws[left[0]]
        try:
            layout = joint_state_layout(raw)
        except ValueError:
            left = left[1:]
            continue
        like = left[sizes[left] == layout.size] if groups < MOST_GROUPS else left[:1]
        table = np.frombuffer(b''.join([raws[i] for i in like.tolist()]), np.uint8)
        table = table.reshape(len(like), layout.size)
        fits = (table[:, layout.fixed] == table[0, layout.fixed]).all(axis=1)
        groups += 1
        yield JointStateGroup(like[fits], layout, table if fits.all() else table[fits])
        left = np.setdiff1d(left, like[fits], assume_unique=True)


class JointStateWriter:
    """Serialises JointState messages that differ in stamp and numbers only.

    Parameters
    ----------
    frame_id, names
        Frame and joint names of all messages.
    efforts
        Whether they have efforts, one for each position.

    Examples
    --------
    >>> writer = JointStateWriter('thumb', ['a', 'b'], efforts=True)
    >>> raw = writer.written(5, np.array([4.1, 4.3]), np.array([0.0, 1.0]))
    >>> (group,) = joint_state_groups([raw])
    >>> group.numbers('effort').tolist()
    [[0.0, 1.0]]
    """

    def __init__(self, frame_id: str, names: Sequence[str], efforts: bool = False) -> None:
        raw = bytearray(LITTLE_ENDIAN).ljust(TEXTS, b'\0')

        def append(number: int, content: bytes, size: int) -> None:
            raw.extend(bytes(-len(raw) % LENGTH.size) + LENGTH.pack(number))
            raw.extend(bytes(-(len(raw) - ENCAPSULATION_BYTES) % size if content else 0) + content)

        def append_text(text: str) -> None:
            content = text.encode() + b'\0'
            append(len(content), content, 1)

        append_text(frame_id)
        append(len(names), b'', 1)
        for name in names:
            append_text(name)
        for n in (len(names), 0, len(names) if efforts else 0):
            append(n, bytes(DOUBLES.itemsize * n), DOUBLES.itemsize)
        numbers = joint_state_layout(bytes(raw)).numbers
        self._position, self._effort = numbers['position'], numbers['effort']
        # A memoryview: writing more or fewer bytes than a slice has is an error.
        self._raw = memoryview(raw)

    def written(self, stamp_ns: int, position: Floats, effort: 'Floats | None' = None) -> bytes:
        """Return one message."""
        STAMP.pack_into(self._raw, ENCAPSULATION_BYTES, *divmod(stamp_ns, 1_000_000_000))
        self._raw[self._position] = position.tobytes()
        if effort is not None:
            self._raw[self._effort] = effort.tobytes()
        return bytes(self._raw)

    def many(self, position: Floats, stamps_ns: Stamps) -> list[bytes]:
        """Return a message for each of the stamps, (n,), and positions, (n, joints)."""
        n, size = len(position), len(self._raw)
        table = np.tile(np.frombuffer(self._raw, np.uint8), (n, 1))
        stamps = np.stack(np.divmod(stamps_ns, 1_000_000_000), axis=1).astype('<u4')
        table[:, ENCAPSULATION_BYTES:TEXTS] = stamps.view(np.uint8)
        table[:, self._position] = np.ascontiguousarray(position, DOUBLES).view(np.uint8)
        content = table.tobytes()
        return [content[i : i + size] for i in range(0, n * size, size)]


class FieldReader:
    """Reads the numbers of one field out of messages.

    Parameters
    ----------
    path
        Names joined by dots, such as ``position`` or ``wrench.force.x``. ``[]`` means all
        elements of a list, as in ``pillars[].fz``, and ``[0]`` the first, as in
        ``tactiles[0].pressure``.

    Raises
    ------
    ValueError
        When the text is not such a path.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Pillar:
    ...     fz: float
    >>> @dataclass
    ... class Array:
    ...     pillars: list[Pillar]
    >>> FieldReader('pillars[].fz')(Array([Pillar(0.5), Pillar(0.25)]))
    array([[0.5 , 0.25]])
    """

    def __init__(self, path: str) -> None:
        self.path = path
        #: Name of each field and of its elements: '' for all, None for the field itself.
        self._steps: list[tuple[str, str | None]] = []
        for part in path.split('.'):
            match = _STEP.fullmatch(part)
            if not match:
                raise ValueError(f'field {path!r} has the part {part!r}, allowed: {_SYNTAX}')
            self._steps.append((match['name'], match['element']))

    def __call__(self, message: Any) -> Floats:
        """Return the numbers of the field.

        Parameters
        ----------
        message
            Any object that has the message's fields as attributes.

        Returns
        -------
        ndarray, shape (samples, channels)
            One row; several for the ``data`` of a ``*MultiArray`` whose layout has the two
            dimensions ``sample`` and ``channel``.

        Raises
        ------
        ValueError
            When there is no such field or it holds no numbers; names the existing fields.
        """
        found = [(type(message).__name__.rsplit('__', 1)[-1], message)]
        for k, (name, element) in enumerate(self._steps):
            inner = [self._field(value, name, where) for where, value in found]
            paths = [name if k == 0 else f'{where}.{name}' for where, _ in found]
            found = [
                part
                for where, value in zip(paths, inner, strict=True)
                for part in self._elements(value, element, where, k + 1 == len(self._steps))
            ]
            if not found:
                raise self._error(f'{paths[0]} is empty, allowed: at least one element')
        rows = np.concatenate([self._numbers(value, where) for where, value in found])
        layout = getattr(message, 'layout', None)
        labels = [dimension.label for dimension in layout.dim] if layout is not None else []
        if self.path == 'data' and labels == BATCH_LABELS:
            return self._as_laid_out(rows, layout)
        return rows.reshape(1, -1)

    def _error(self, text: str) -> ValueError:
        return ValueError(f'field {self.path}: {text}')

    def _field(self, message: Any, name: str, where: str) -> Any:
        known = field_names(message)
        if name not in known:
            raise self._error(f'{where} has no {name}, there are: {listed(known)}')
        return getattr(message, name)

    def _elements(
        self, value: Any, element: 'str | None', where: str, is_end: bool
    ) -> list[tuple[str, Any]]:
        """Return names and values of the elements that a step selects."""
        is_list = hasattr(value, '__len__') and not isinstance(value, (str, bytes))
        if element is None:
            if not is_end and not field_names(value):
                hint = f'{where}[] or {where}[0]' if is_list else 'the path to end here'
                raise self._error(f'{where} is no message, allowed: {hint}')
            return [(where, value)]
        if not is_list:
            raise self._error(f'{where} is no list, allowed: {where} without []')
        if element == '':
            return [(f'{where}[{i}]', one) for i, one in enumerate(value)]
        if int(element) >= len(value):
            raise self._error(f'{where} has {len(value)} elements, allowed: below that')
        return [(f'{where}[{int(element)}]', value[int(element)])]

    def _numbers(self, value: Any, where: str) -> Floats:
        """Return the numbers at the end of a path, (n,)."""
        inner = field_names(value)
        if inner:
            known = listed([f'{where}.{name}' for name in inner])
            raise self._error(f'{where} is a message, allowed: one of its fields: {known}')
        if isinstance(value, (str, bytes)):
            raise self._error(f'{where} is text, allowed: numbers')
        # NumPy reads the arrays of rclpy (array.array) through their buffer.
        array = np.asarray(value)
        if array.dtype.kind not in 'fiub':
            names = field_names(value[0])[:1] if len(value) else []
            hint = ''.join(f', such as {where}[].{name}' for name in names)
            raise self._error(f'{where} is no list of numbers, allowed: numbers{hint}')
        with np.errstate(invalid='ignore'):  # a signalling NaN warns
            return array.astype(np.float64).reshape(-1)

    def _as_laid_out(self, values: Floats, layout: Any) -> Floats:
        """Return the samples of a batch as rows."""
        samples, channels = (int(dimension.size) for dimension in layout.dim)
        begin = int(layout.data_offset)
        if begin + samples * channels != len(values):
            raise self._error(
                f'has {len(values)} numbers, allowed: {samples} x {channels}, as the layout says'
            )
        return values[begin:].reshape(samples, channels)


def field_names(message: Any) -> list[str]:
    """Return the names of a message's fields in order; empty for other objects."""
    if hasattr(message, 'get_fields_and_field_types'):  # a message of rclpy
        return list(message.get_fields_and_field_types())
    if dataclasses.is_dataclass(message):
        # The message classes of rosbags have the name of the type as a further field.
        names = [field.name for field in dataclasses.fields(message)]
        return [name for name in names if not name.startswith('__')]
    return []
