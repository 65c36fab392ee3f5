"""Reads serialised JointState messages faster than rclpy does."""

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: The first bytes of a message that was serialised with the least significant byte first.
LITTLE_ENDIAN = b'\x00\x01'

#: So many bytes say how a message was serialised; alignment counts from behind them.
ENCAPSULATION_BYTES = 4

STAMP = struct.Struct('<iI')


class Sample(NamedTuple):
    """Samples of one message.

    Attributes
    ----------
    rows : ndarray, shape (n, channels)
        Oldest first.
    stamp_ns : int or None
        When the last one was taken; None: unknown.
    names : list of str
        Of the channels, where the message says them.
    frame_id : str
        Frame of the fingertip, where the message has one.
    """

    rows: NDArray[np.float64]
    stamp_ns: int | None
    names: list[str]
    frame_id: str


class JointStateReader:
    """Reads messages that differ from a first one in stamp and positions only.

    Where the positions stand depends only on the texts and lengths before them. A message that
    has the same ones, byte by byte, has its positions in the same place; the bytes of alignment
    between them may have any value.

    Parameters
    ----------
    raw
        The first message, serialised.
    message
        The same message as rclpy has read it.

    Raises
    ------
    ValueError
        When it has no positions, or was not serialised as Fast DDS does it.
    """

    def __init__(self, raw: bytes, message: Any) -> None:
        if not raw.startswith(LITTLE_ENDIAN):
            raise ValueError('not little-endian CDR')
        self._names, self._frame_id = list(message.name), str(message.header.frame_id)
        self._n = len(message.position)
        fixed = list(range(len(LITTLE_ENDIAN)))
        place = ENCAPSULATION_BYTES + STAMP.size

        def pass_by(size: int, text: int = 0) -> None:
            nonlocal place
            place += -(place - ENCAPSULATION_BYTES) % size
            fixed.extend(range(place, place + size + text))
            place += size + text

        for text in (self._frame_id, None, *self._names):
            pass_by(4, 0 if text is None else len(text.encode()) + 1)
        pass_by(4)
        self._fixed = np.array(fixed)
        self._begin = place + -(place - ENCAPSULATION_BYTES) % 8
        self._end = self._begin + 8 * self._n
        if not self._n or raw[self._begin : self._end] != message.position.tobytes():
            raise ValueError('the positions are not where they should be')
        self._wanted = self._fixed_bytes(raw)

    def read(self, raw: bytes) -> Sample | None:
        """Return the sample of a message; None where it differs in other fields too."""
        if len(raw) < self._end or self._fixed_bytes(raw) != self._wanted:
            return None
        seconds, rest = STAMP.unpack_from(raw, ENCAPSULATION_BYTES)
        row = np.frombuffer(raw, '<f8', self._n, self._begin).astype(np.float64)
        at_ns = seconds * 1_000_000_000 + rest
        return Sample(row.reshape(1, self._n), at_ns, self._names, self._frame_id)

    def _fixed_bytes(self, raw: bytes) -> bytes:
        content: bytes = np.frombuffer(raw, np.uint8)[self._fixed].tobytes()
        return content
