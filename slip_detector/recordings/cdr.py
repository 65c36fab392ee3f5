"""Serialised messages (CDR) of one topic as rows; those of one layout are decoded all at once.

Where each number of a message stands depends only on the lengths of the texts and lists in it.
So it is worked out once, by reading a message whose numbers are their own places through the same
:class:`~slip_detector.recordings.fields.FieldReader`, and every message with the same texts and
lengths is
cut at these places. One that differs is decoded on its own.
"""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.recordings.fields import FieldReader

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

#: CDR begins with four bytes of which the second says whether the least significant byte is first.
HEADER_BYTES = 4

#: Types of numbers, by the names that message definitions have for them.
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
#: A place and a type in one number: exact in float64 for messages below 4 GB.
_TYPE_STEP = 2.0**32


#: Once so many layouts were met, messages of others are decoded one by one.
MOST_LAYOUTS = 32


class Decoded(NamedTuple):
    """Rows of consecutive messages.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (m,)
        Of the m messages.
    samples : ndarray of int, shape (m,)
        How many rows each message has; n in all.
    which : ndarray of int, shape (m,)
        Which of the messages these are; one that cannot be decoded, or has other channels or
        names than the first one, is left out.
    """

    volts: Floats
    stamps_ns: Stamps
    samples: Stamps
    which: NDArray[np.intp]


class _Group(NamedTuple):
    """Messages of one layout: which, their (m, samples, channels), stamps and names."""

    which: NDArray[np.intp]
    volts: Floats
    stamps_ns: Stamps
    names: tuple[str, ...]


class _Layout(NamedTuple):
    """Where the numbers of a message stand."""

    fixed: NDArray[np.intp]  # places of the bytes of texts and lengths
    fixed_bytes: NDArray[np.uint8]
    places: Floats  # (samples, channels), place and type of each number
    stamp: tuple[int, int] | None  # places of sec and nanosec
    order: str
    names: tuple[str, ...]


class Decoder:
    """Decodes the messages of one type.

    Parameters
    ----------
    typestore
        Of rosbags, with the definition of the type.
    msgtype
        Name of the type, as ``sensor_msgs/msg/JointState``.
    field
        Path of the field whose numbers are the channels.

    Attributes
    ----------
    channels : int
        Of the first message; 0 before it.
    names : tuple of str
        What it calls them; empty where it does not.
    """

    def __init__(self, typestore: Any, msgtype: str, field: str) -> None:
        self._typestore, self._msgtype = typestore, msgtype
        self._field = FieldReader(field)
        self._layouts: dict[int, list[_Layout]] = {}
        self.channels = 0
        self.names: tuple[str, ...] = ()

    def one(self, raw: bytes) -> tuple[Floats, int | None, tuple[str, ...]]:
        """Decode one message.

        Returns
        -------
        rows : ndarray, shape (samples, channels)
        stamp_ns : int or None
            Of its header, where it has one.
        names : tuple of str

        Raises
        ------
        ValueError
            When it cannot be decoded or has no such field.
        """
        message = self.message(raw)
        rows = self._field(message)
        stamp = getattr(getattr(message, 'header', None), 'stamp', None)
        stamp_ns = None if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        return rows, stamp_ns, _names(message, rows.shape[1])

    def message(self, raw: bytes) -> Any:
        """Decode one message as an object with its fields as attributes.

        Raises
        ------
        ValueError
            When the bytes are no such message.
        """
        try:
            return self._typestore.deserialize_cdr(raw, self._msgtype)
        except Exception as error:  # The decoder is code that rosbags makes from the definition.
            raise ValueError(f'a message is no {self._msgtype} ({error})') from None

    def many(self, raws: Sequence[bytes], received_ns: Sequence[int]) -> Decoded:
        """Decode messages, at least one.

        Parameters
        ----------
        raws
            The messages, oldest first.
        received_ns
            When each was received: its stamp where it has no header.

        Raises
        ------
        ValueError
            As :meth:`one`, for the first messages; when none has any channels.
        """
        try:
            received = np.array(received_ns, dtype=np.int64)
        except OverflowError:
            raise ValueError('a message was received beyond the year 2262') from None
        lengths = np.array([len(raw) for raw in raws])
        groups: list[_Group] = []
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
            return Decoded(np.empty((0, self.channels)), nothing, nothing, nothing)
        samples = [np.full(len(group.which), group.volts.shape[1]) for group in kept]
        volts = [group.volts.reshape(-1, self.channels) for group in kept]
        if len(kept) == 1:
            return Decoded(volts[0], kept[0].stamps_ns, samples[0], kept[0].which)
        which = np.concatenate([group.which for group in kept])
        n_of = np.concatenate(samples)
        order = np.argsort(which)
        of_rows = np.argsort(np.repeat(which, n_of), kind='stable')
        stamps_ns = np.concatenate([group.stamps_ns for group in kept])
        return Decoded(np.concatenate(volts)[of_rows], stamps_ns[order], n_of[order], which[order])

    def _groups(
        self, raws: Sequence[bytes], received_ns: Stamps, which: NDArray[np.intp]
    ) -> list[_Group]:
        """Decode messages of one length."""
        length = len(raws[which[0]])
        layouts = self._layouts.setdefault(length, [])
        joined = b''.join([raws[i] for i in which.tolist()])
        block = np.frombuffer(joined, np.uint8).reshape(len(which), length)
        groups: list[_Group] = []
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
            alike = (block[:, layout.fixed] == layout.fixed_bytes).all(axis=1)
            if alike.any():
                mine, stamps_ns = block, received_ns[which[alike]]
                if not alike.all():
                    mine = block[alike]
                groups.append(_group(which[alike], mine, stamps_ns, layout))
                which, block = which[~alike], block[~alike]
        return groups

    def _alone(self, raw: bytes, received_ns: Stamps, i: int) -> _Group | None:
        """Decode one message; None where it cannot be done, but others could be before."""
        try:
            rows, stamp_ns, names = self.one(raw)
        except ValueError:
            if not self.channels:
                raise
            return None
        stamps_ns = received_ns[i : i + 1] if stamp_ns is None else np.array([stamp_ns])
        return _Group(np.array([i]), rows[np.newaxis], stamps_ns, names)

    def _make_layout(self, raw: bytes) -> _Layout | None:
        """Return the layout of a message; None where it cannot be told.

        What is wrong with such a message, decoding it on its own will say.
        """
        if sum(map(len, self._layouts.values())) >= MOST_LAYOUTS:
            return None
        try:
            return self.layout_of(raw)
        except (ValueError, LookupError, struct.error):
            return None

    def layout_of(self, raw: bytes) -> _Layout:
        """Return where the numbers of a message stand.

        Raises
        ------
        ValueError, LookupError, struct.error
            When that cannot be told.
        """
        walk = _Walk(raw, self._typestore)
        message = walk.message(self._msgtype)
        places = self._field(message)
        # Some pad to a multiple of four.
        if not places.size or not 0 <= len(raw) - walk.position < HEADER_BYTES:
            raise ValueError('the message is empty or longer than its fields')
        stamp = getattr(getattr(message, 'header', None), 'stamp', None)
        fixed = np.array(walk.fixed, dtype=np.intp)
        return _Layout(
            fixed,
            np.frombuffer(raw, np.uint8)[fixed],
            places,
            None if stamp is None else (_place(stamp.sec), _place(stamp.nanosec)),
            walk.order,
            _names(message, places.shape[1]),
        )


class Encoder:
    """Serialises rows as messages of JointState, which have all one layout.

    Parameters
    ----------
    typestore
        Of rosbags.
    frame_id
        Of the header of each.
    names
        Of the channels.
    """

    def __init__(self, typestore: Any, frame_id: str, names: Sequence[str]) -> None:
        msgtype = 'sensor_msgs/msg/JointState'
        types = typestore.types
        stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
        message = types[msgtype](
            header=types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame_id),
            name=list(names),
            position=np.zeros(len(names)),
            velocity=np.empty(0),
            effort=np.empty(0),
        )
        raw = bytes(typestore.serialize_cdr(message, msgtype))
        layout = Decoder(typestore, msgtype, 'position').layout_of(raw)
        assert layout.stamp is not None
        self._template = np.frombuffer(raw, np.uint8)
        self._stamp, self._rows = layout.stamp, _place(layout.places[0, 0])

    def many(self, volts: Floats, stamps_ns: Stamps) -> list[bytes]:
        """Serialise rows.

        Parameters
        ----------
        volts : ndarray, shape (n, c)
            The rows.
        stamps_ns : ndarray of int, shape (n,)
            Their stamps.
        """
        n, length = len(volts), len(self._template)
        block = np.tile(self._template, (n, 1))
        parts = np.stack(np.divmod(stamps_ns, 1_000_000_000), axis=1)
        for place, part in zip(self._stamp, parts.T, strict=True):
            block[:, place : place + 4] = part.astype('<u4')[:, np.newaxis].view(np.uint8)
        rows = np.ascontiguousarray(volts, dtype='<f8').view(np.uint8)
        block[:, self._rows : self._rows + rows.shape[1]] = rows
        content = block.tobytes()
        return [content[i : i + length] for i in range(0, n * length, length)]


def _group(
    which: NDArray[np.intp], block: NDArray[np.uint8], received_ns: Stamps, layout: _Layout
) -> _Group:
    """Cut messages of one layout, (m, length) bytes, at its places."""
    stamps_ns = received_ns
    if layout.stamp is not None:
        seconds, rest = layout.stamp
        stamps_ns = _cut(block, seconds, f'{layout.order}i4').astype(np.int64) * 1_000_000_000
        stamps_ns += _cut(block, rest, f'{layout.order}u4')
    volts = _gathered(block, layout.places.reshape(-1), layout.order)
    return _Group(which, volts.reshape(-1, *layout.places.shape), stamps_ns, layout.names)


def _place(number: float) -> int:
    return int(number % _TYPE_STEP)


def _names(message: Any, channels: int) -> tuple[str, ...]:
    """Return the names that a message gives its channels, as JointState does."""
    names = getattr(message, 'name', ())
    if isinstance(names, str) or len(names) != channels:
        return ()
    return tuple(names) if all(isinstance(name, str) for name in names) else ()


def _cut(block: NDArray[np.uint8], place: int, dtype: str) -> NDArray[Any]:
    """Return the number that stands at one place of each message, (n,)."""
    size = np.dtype(dtype).itemsize
    return np.ascontiguousarray(block[:, place : place + size]).view(dtype)[:, 0]


def _gathered(block: NDArray[np.uint8], places: Floats, order: str) -> Floats:
    """Return the numbers that stand at the places of each message, (n, places)."""
    codes, offsets = np.divmod(places, _TYPE_STEP)
    first, begin = _CODES[int(codes[0])], int(offsets[0])
    size = np.dtype(first).itemsize
    if (codes == codes[0]).all() and (np.diff(offsets) == size).all():
        end = begin + size * len(places)
        columns = np.ascontiguousarray(block[:, begin:end]).view(f'{order}{first}')
        return columns.astype(np.float64)
    return np.stack(
        [
            _cut(block, int(offset), f'{order}{_CODES[int(code)]}').astype(np.float64)
            for code, offset in zip(codes, offsets, strict=True)
        ],
        axis=1,
    )


class _Walk:
    """Walks through a serialised message and notes where its numbers stand."""

    def __init__(self, raw: bytes, typestore: Any) -> None:
        self._raw, self._typestore = raw, typestore
        self.position = HEADER_BYTES
        self.order = '<' if raw[1] & 1 else '>'
        self.fixed: list[int] = list(range(HEADER_BYTES))

    def message(self, msgtype: str, real: bool = False) -> Any:
        """Return a message of places in place of numbers; ``real``: of the numbers themselves."""
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
        return int(struct.unpack(f'{self.order}I', self._take(4))[0])

    def _text(self) -> str:
        length = self._length()
        text = self._take(length)
        self.fixed.extend(range(self.position - length, self.position))
        return text[:-1].decode()

    def _number(self, name: str, real: bool) -> Any:
        places = self._places(name, 1)
        if not real:
            return places[0]
        dtype = np.dtype(f'{self.order}{DTYPES[name]}')
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
