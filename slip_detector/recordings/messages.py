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
import functools
import itertools
import re
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats, Samples
from slip_detector.parameters import name_list

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

#: Names of the positions of ``slip_state``.
STATES = ('slip', 'slip_valid', 'slip_onset')

_STEP = re.compile(r'(?P<name>[A-Za-z]\w*)(\[(?P<element>:|\d{0,9})\])?', re.ASCII)
_SYNTAX = 'names joined by dots, each perhaps with [], [2] or, one of them, [:]'


class JointStateLayout(NamedTuple):
    """Where the parts of a serialised JointState are.

    Attributes
    ----------
    frame_id : str
    names : tuple of str
    numbers : dict
        Bytes of position, velocity and effort.
    fixed : list of slice
        Bytes that are the same in all messages of a sensor: texts and lengths. The stamp and the
        numbers differ; padding may have any value.
    """

    frame_id: str
    names: tuple[str, ...]
    numbers: dict[str, slice]
    fixed: list[slice]


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
    fixed = [slice(ENCAPSULATION_BYTES)]

    def part(n: int, alignment: int) -> slice:
        nonlocal place
        begin = place + (ENCAPSULATION_BYTES - place) % alignment
        place = begin + n
        return slice(begin, place)

    def length() -> int:
        fixed.append(part(LENGTH.size, LENGTH.size))
        return int(LENGTH.unpack_from(raw, fixed[-1].start)[0])

    def text() -> str:
        fixed.append(part(length(), 1))
        return raw[fixed[-1]].partition(b'\0')[0].decode(errors='replace')

    try:
        frame_id = text()
        names = tuple(text() for _ in range(length()))
        numbers = {}
        for field in JOINT_FIELDS:
            n = length()
            numbers[field] = part(DOUBLES.itemsize * n, DOUBLES.itemsize if n else 1)
    except struct.error:
        place = len(raw) + 1
    if place > len(raw):
        raise ValueError('the message is cut off')
    return JointStateLayout(frame_id, names, numbers, fixed)


class JointStateReader:
    """Reads serialised JointState messages one by one, quickly if they resemble the last one.

    Examples
    --------
    >>> raw = JointStateWriter('tip', ['a', 'b']).serialize(5, np.array([4.1, 4.3]))
    >>> samples = JointStateReader().read(raw)
    >>> samples.volts, samples.stamps_ns, samples.names
    (array([[4.1, 4.3]]), array([5]), ('a', 'b'))
    """

    def __init__(self) -> None:
        self._size, self._position, self._texts = 0, slice(0), b''

    def read(self, raw: bytes) -> Samples:
        """Return the one sample of a message, with a stamp of 0 if it has none.

        Raises
        ------
        ValueError
            As :func:`joint_state_layout`.
        """
        is_alike = len(raw) == self._size and raw.startswith(LITTLE_ENDIAN)
        if not is_alike or raw[TEXTS : self._position.start] != self._texts:
            self._layout = joint_state_layout(raw)
            self._size, self._position = len(raw), self._layout.numbers['position']
            self._texts = raw[TEXTS : self._position.start]
        seconds, rest = STAMP.unpack_from(raw, ENCAPSULATION_BYTES)
        # A writable copy, aligned for float64.
        content = bytearray(raw[self._position])
        rows = np.ndarray((1, len(content) // DOUBLES.itemsize), DOUBLES, content)
        stamps_ns = np.array([seconds * 1_000_000_000 + rest])
        names, frame_id = self._layout.names, self._layout.frame_id
        return Samples(rows, stamps_ns, names=names, frame_id=frame_id)


def joint_state_table(raws: Sequence[bytes], field: str = 'position') -> 'Samples | None':
    """Read a field of serialised JointState messages at once; None if they are not alike.

    The rows of the samples are the numbers of the field, one row for each message.

    Examples
    --------
    >>> writer = JointStateWriter('thumb', ['a', 'b'])
    >>> rows = {5: np.array([4.3, 4.2]), 10: np.array([4.1, 4.0])}
    >>> table = joint_state_table([writer.serialize(at_ns, row) for at_ns, row in rows.items()])
    >>> table.stamps_ns.tolist(), table.volts.tolist()
    ([5, 10], [[4.3, 4.2], [4.1, 4.0]])
    """
    try:
        layout = joint_state_layout(raws[0])
    except ValueError:
        return None
    if len({*map(len, raws)}) > 1:
        return None
    content = np.frombuffer(b''.join(raws), np.uint8).reshape(len(raws), -1)
    places = np.r_[tuple(layout.fixed)]
    if (content[:, places] != content[0, places]).any():
        return None
    seconds, rest_ns = content[:, ENCAPSULATION_BYTES:TEXTS].copy().view('<i4').astype(np.int64).T
    rows = content[:, layout.numbers[field]].copy().view(DOUBLES)
    return Samples(rows, seconds * 1_000_000_000 + rest_ns, names=layout.names)


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
    >>> raw = writer.serialize(5, np.array([4.1, 4.3]), np.array([0.0, 1.0]))
    >>> joint_state_table([raw], 'effort').volts.tolist()
    [[0.0, 1.0]]
    """

    def __init__(self, frame_id: str, names: Sequence[str], efforts: bool = False) -> None:
        raw = bytearray(LITTLE_ENDIAN).ljust(TEXTS, b'\0')

        def append(number: int, content: bytes = b'', alignment: int = 1) -> None:
            raw.extend(bytes(-len(raw) % LENGTH.size) + LENGTH.pack(number))
            padding = (ENCAPSULATION_BYTES - len(raw)) % alignment if content else 0
            raw.extend(bytes(padding) + content)

        frame, *texts = (text.encode() + b'\0' for text in (frame_id, *names))
        append(len(frame), frame)
        append(len(names))
        for text in texts:
            append(len(text), text)
        for n in (len(names), 0, len(names) if efforts else 0):
            append(n, bytes(DOUBLES.itemsize * n), DOUBLES.itemsize)
        numbers = joint_state_layout(bytes(raw)).numbers
        self._position, self._effort = numbers['position'], numbers['effort']
        # A memoryview: writing more or fewer bytes than a slice has is an error.
        self._raw = memoryview(raw)

    def serialize(self, stamp_ns: int, position: Floats, effort: 'Floats | None' = None) -> bytes:
        """Return one message."""
        STAMP.pack_into(self._raw, ENCAPSULATION_BYTES, *divmod(stamp_ns, 1_000_000_000))
        self._raw[self._position] = position.tobytes()
        if effort is not None:
            self._raw[self._effort] = effort.tobytes()
        return bytes(self._raw)


class FieldReader:
    """Reads the numbers of one field out of messages, or of several, side by side.

    Parameters
    ----------
    path
        Names joined by dots, such as ``position`` or ``wrench.force.x``. ``[]`` means all
        elements of a list, as in ``pillars[].fz``, ``[0]`` the first, as in
        ``tactiles[0].pressure``, and ``[:]`` all, each in a row of its own, oldest first, as in
        ``tactiles[].pac[:]``. Several paths are separated by commas. A name may differ from the
        message's in case: ROS 2 has no capitals in the names of fields, ROS 1 has.

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
    ...     noise: list[int]
    >>> @dataclass
    ... class Array:
    ...     pillars: list[Pillar]
    >>> message = Array([Pillar(0.5, [1, 2]), Pillar(0.25, [3, 4])])
    >>> FieldReader('pillars[].fz')(message), FieldReader('pillars[].noise[:]')(message).tolist()
    (array([[0.5 , 0.25]]), [[1.0, 3.0], [2.0, 4.0]])
    """

    def __init__(self, path: str) -> None:
        self.path = path
        #: For each path, the name of each field and of its elements: '' for all, ':' for rows,
        #: None for the field itself.
        self._paths: list[list[tuple[str, str | None]]] = []
        for one in path.split(','):
            self._paths.append([])
            for part in one.strip().split('.'):
                match = _STEP.fullmatch(part)
                if not match or (match['element'] == ':' and '[:]' in one.partition('[:]')[2]):
                    raise ValueError(f'field {path!r} has the part {part!r}, allowed: {_SYNTAX}')
                self._paths[-1].append((match['name'], match['element']))

    def begins_in(self, kind: Any) -> bool:
        """Return whether all paths begin with a field of a class of messages."""
        return all(_own_name(steps[0][0], kind) for steps in self._paths)

    def __call__(self, message: Any) -> Floats:
        """Return the numbers of the field.

        Parameters
        ----------
        message
            Any object that has the message's fields as attributes.

        Returns
        -------
        ndarray, shape (samples, channels)
            One row, unless a path has ``[:]``; several too for the ``data`` of a ``*MultiArray``
            whose layout has the two dimensions ``sample`` and ``channel``.

        Raises
        ------
        ValueError
            When there is no such field or it holds no numbers; names the existing fields.
        """
        with np.errstate(invalid='ignore'):  # a signalling NaN warns
            parts = [self._rows(message, steps) for steps in self._paths]
        numbers = [len(rows) for rows in parts]
        if len({*numbers}) > 1:
            raise ValueError(f'field {self.path}: has {numbers} rows, allowed: as many of each')
        rows = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        layout = getattr(message, 'layout', None)
        labels = [dimension.label for dimension in layout.dim] if layout is not None else []
        if self.path == 'data' and layout is not None and labels == BATCH_LABELS:
            shape = [int(dimension.size) for dimension in layout.dim]
            return rows[0, int(layout.data_offset) :].reshape(shape)
        return rows

    def _rows(self, message: Any, steps: list[tuple[str, str | None]]) -> Floats:
        """Return the numbers at one path, (samples, channels)."""
        found: list[Sequence[Any]] = [[message]]  # of each row
        for name, element in steps:
            inner = [[self._inner(one, name, element) for one in row] for row in found]
            if element != ':':
                found = [list(itertools.chain(*values)) for values in inner]
            elif len({*map(len, inner[0])}) > 1:
                text = f'{name} has {[*map(len, inner[0])]} elements, allowed: as many in each'
                raise ValueError(f'field {self.path}: {text}')
            else:
                found = [*zip(*inner[0], strict=True)]
                if not found:  # No samples, of as many channels as there are lists.
                    return np.empty((0, len(inner[0])))
        if not found[0]:
            raise self._error(self.path, message)
        return np.stack([self._numbers(row) for row in found])

    def _inner(self, one: Any, name: str, element: str | None) -> list[Any]:
        """Return the field of a message, or those of its elements that are wanted."""
        if not (own := _own_name(name, one.__class__)):
            raise self._error(name, one)
        value = getattr(one, own)
        try:
            # NumPy's arrays and those of rclpy (array.array) are lists of numbers.
            values = [value] if element is None else list(value)
            return [values[int(element)]] if element and element != ':' else values
        except (TypeError, IndexError):
            raise self._error(f'{name}[{element}]', one) from None

    def _numbers(self, row: Sequence[Any]) -> Floats:
        """Return numbers, or lists of numbers, as an array."""
        if all(isinstance(one, int | float | np.number) for one in row):
            return np.array(row, np.float64)
        arrays = [np.asarray(one) for one in row]
        for array in arrays:
            if array.dtype.kind not in 'fiub':
                raise self._error(self.path, row[0])
        return np.concatenate([array.astype(np.float64).reshape(-1) for array in arrays])

    def _error(self, part: str, where: Any) -> ValueError:
        """Return the error that a part of the path gives no numbers, with the fields there."""
        is_list = isinstance(where, list) and len(where) > 0
        names = _field_names((where[0] if is_list else where).__class__)
        there = name_list([f'[].{name}' if is_list else name for name in names])
        return ValueError(f'field {self.path}: no numbers at {part}, there are: {there or "none"}')


@functools.cache
def _field_names(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields in a class of messages; empty for other classes."""
    if hasattr(kind, 'get_fields_and_field_types'):  # of rclpy
        return tuple(kind.get_fields_and_field_types())
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    # The message classes of rosbags have the name of the type as a further field.
    return tuple(one.name for one in fields if not one.name.startswith('__'))


@functools.cache
def _own_name(name: str, kind: Any) -> str:
    """Return which field of a message has this name, if need be but for case; '': none."""
    names = _field_names(kind)
    alike = [own for own in names if own.lower() == name.lower()]
    return name if name in names else alike[0] if alike else ''
