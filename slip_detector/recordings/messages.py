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
    """

    frame_id: str
    names: tuple[str, ...]
    numbers: dict[str, slice]


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

    def part(n: int, alignment: int) -> slice:
        nonlocal place
        begin = place + (ENCAPSULATION_BYTES - place) % alignment
        place = begin + n
        return slice(begin, place)

    def length() -> int:
        return int(LENGTH.unpack_from(raw, part(LENGTH.size, LENGTH.size).start)[0])

    def text() -> str:
        return raw[part(length(), 1)].partition(b'\0')[0].decode(errors='replace')

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
    return JointStateLayout(frame_id, names, numbers)


class JointStateReader:
    """Reads a field of serialised JointState messages, quickly if they resemble the last one.

    Parameters
    ----------
    field
        One of :data:`JOINT_FIELDS`.

    Examples
    --------
    >>> writer = JointStateWriter('tip', ['a', 'b'])
    >>> rows = {5: np.array([4.1, 4.3]), 10: np.array([4.2, 4.4])}
    >>> raws = [writer.serialize(at_ns, row) for at_ns, row in rows.items()]
    >>> samples = JointStateReader().read(raws)
    >>> samples.volts.tolist(), samples.stamps_ns.tolist(), samples.names
    ([[4.1, 4.3], [4.2, 4.4]], [5, 10], ('a', 'b'))
    """

    def __init__(self, field: str = 'position') -> None:
        self._fields = JOINT_FIELDS[: JOINT_FIELDS.index(field) + 1]
        self._size, self._numbers, self._layout = -1, slice(0), JointStateLayout('', (), {})
        #: What is the same in messages of a sensor, texts and lengths, and where it begins.
        self._fixed: list[tuple[bytes, int]] = []

    def read(self, raws: Sequence[bytes]) -> Samples:
        """Return a row for each of some messages, with a stamp of 0 if it has none.

        Raises
        ------
        ValueError
            As :func:`joint_state_layout`, or when the messages differ in texts or lengths.
        """
        if not self._is_alike(raws[0]):
            self._learn(raws[0])
        if len(raws) > 1 and not all(map(self._is_alike, raws)):
            raise ValueError('the messages differ in texts or lengths')
        # As a bytearray the rows are writable, and aligned for float64.
        content = bytearray().join([raw[self._numbers] for raw in raws])
        shape = len(raws), (self._numbers.stop - self._numbers.start) // DOUBLES.itemsize
        rows = np.ndarray(shape, DOUBLES, content)
        stamps = [STAMP.unpack_from(raw, ENCAPSULATION_BYTES) for raw in raws]
        stamps_ns = np.array([seconds * 1_000_000_000 + rest_ns for seconds, rest_ns in stamps])
        names, frame_id = self._layout.names, self._layout.frame_id
        return Samples(rows, stamps_ns, names=names, frame_id=frame_id)

    def _learn(self, raw: bytes) -> None:
        self._layout, self._size = joint_state_layout(raw), len(raw)
        self._fixed, begin = [(LITTLE_ENDIAN, 0)], TEXTS
        for field in self._fields:
            self._numbers = self._layout.numbers[field]
            self._fixed.append((raw[begin : self._numbers.start], begin))
            begin = self._numbers.stop

    def _is_alike(self, raw: bytes) -> bool:
        """Return whether the numbers of a message are in the same place as those of the last."""
        return len(raw) == self._size and all(raw.startswith(*part) for part in self._fixed)


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
    >>> JointStateReader('effort').read([raw]).volts.tolist()
    [[0.0, 1.0]]
    """

    def __init__(self, frame_id: str, names: Sequence[str], efforts: bool = False) -> None:
        number = LENGTH.pack(n := len(names))
        texts = b''.join([_pack_text(frame_id), number, *map(_pack_text, names), number])
        padding = -(STAMP.size + len(texts)) % DOUBLES.itemsize if n else 0
        self._texts, self._n_bytes = texts + bytes(padding), DOUBLES.itemsize * n
        #: The lengths of velocity and effort.
        self._lengths = LENGTH.pack(0) + LENGTH.pack(n if efforts else 0)

    def serialize(self, stamp_ns: int, position: Floats, effort: 'Floats | None' = None) -> bytes:
        """Return one message."""
        if position.nbytes != self._n_bytes:
            raise ValueError(f'{position.nbytes} bytes of positions, allowed: {self._n_bytes}')
        head = LITTLE_ENDIAN + b'\0\0' + STAMP.pack(*divmod(stamp_ns, 1_000_000_000))
        efforts = b'' if effort is None else effort.tobytes()
        return head + self._texts + position.tobytes() + self._lengths + efforts


def _pack_text(text: str) -> bytes:
    """Return a text after its length, with padding up to the next length."""
    content = text.encode() + b'\0'
    return LENGTH.pack(len(content)) + content + bytes(-len(content) % LENGTH.size)


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
        for single in path.split(','):
            self._paths.append([])
            for part in single.strip().split('.'):
                match = _STEP.fullmatch(part)
                if not match or (match['element'] == ':' and '[:]' in single.partition('[:]')[2]):
                    raise ValueError(f'field {path!r} has the part {part!r}, allowed: {_SYNTAX}')
                self._paths[-1].append((match['name'], match['element']))

    def begins_in(self, message_class: Any) -> bool:
        """Return whether all paths begin with a field of a class of messages."""
        return all(_find_field(steps[0][0], message_class) for steps in self._paths)

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
        rows = self._side_by_side([self._rows(message, steps) for steps in self._paths])
        with np.errstate(invalid='ignore'):  # a signalling NaN warns
            numbers: Floats = np.array(rows, np.float64).reshape(len(rows), -1 if rows else 0)
        dimensions = message.layout.dim if hasattr(message, 'layout') else []
        if self.path == 'data' and [dimension.label for dimension in dimensions] == BATCH_LABELS:
            shape = [int(dimension.size) for dimension in dimensions]
            return numbers.ravel()[int(message.layout.data_offset) :].reshape(shape)
        return numbers

    def _rows(self, value: Any, steps: Sequence[tuple[str, str | None]]) -> list[Sequence[Any]]:
        """Return the rows of numbers at the end of a path from a message, or those in a value."""
        if not steps:
            return [self._numbers(value)]
        (name, element), *rest = steps
        if not (own := _find_field(name, value.__class__)):
            raise self._error(name, value)
        inner = getattr(value, own)
        try:
            # NumPy's arrays and those of rclpy (array.array) are lists of numbers.
            elements = [inner] if element is None else list(inner)
            elements = [elements[int(element)]] if element and element != ':' else elements
        except (TypeError, IndexError):
            raise self._error(f'{name}[{element}]', value) from None
        if not elements and element != ':':
            raise self._error(name, value)
        parts = [self._rows(element_value, rest) for element_value in elements]
        return [*itertools.chain(*parts)] if element == ':' else self._side_by_side(parts)

    def _side_by_side(self, parts: list[list[Sequence[Any]]]) -> list[Sequence[Any]]:
        """Return as many rows as each part has, with the numbers of all parts."""
        if len(parts) == 1:
            return parts[0]
        if len({*map(len, parts)}) > 1:
            text = f'has {[*map(len, parts)]} rows, allowed: as many of each'
            raise ValueError(f'field {self.path}: {text}')
        return [[*itertools.chain(*row)] for row in zip(*parts, strict=True)]

    def _numbers(self, value: Any) -> Any:
        """Return a number, or a list of numbers, as a list."""
        if isinstance(value, int | float | np.number):
            return [value]
        numbers = np.asarray(value)
        if numbers.dtype.kind not in 'fiub':
            raise self._error(self.path, value)
        return numbers.ravel()

    def _error(self, part: str, where: Any) -> ValueError:
        """Return the error that a part of the path gives no numbers, with the fields there."""
        is_list = isinstance(where, list) and len(where) > 0
        names = _field_names((where[0] if is_list else where).__class__)
        there = name_list([f'[].{name}' if is_list else name for name in names])
        return ValueError(f'field {self.path}: no numbers at {part}, there are: {there or "none"}')


@functools.cache
def _field_names(message_class: Any) -> tuple[str, ...]:
    """Return the names of the fields in a class of messages; empty for other classes."""
    if hasattr(message_class, 'get_fields_and_field_types'):  # of rclpy
        return tuple(message_class.get_fields_and_field_types())
    fields = dataclasses.fields(message_class) if dataclasses.is_dataclass(message_class) else ()
    # The message classes of rosbags have the name of the type as a further field.
    return tuple(field.name for field in fields if not field.name.startswith('__'))


@functools.cache
def _find_field(name: str, message_class: Any) -> str:
    """Return which field of a message has this name, if need be but for case; '': none."""
    names = _field_names(message_class)
    alike = [own for own in names if own.lower() == name.lower()]
    return name if name in names else alike[0] if alike else ''
