"""A stream of bytes, cut at a delimiter, and the samples that are decoded from its pieces."""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class DecodedSamples(NamedTuple):
    """The samples of one packet or one line, oldest first.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    times_ns : list of int, length n, or None
        When each was taken by the sender's clock, without its wraps; None: the sender does not
        say.
    clock_restarted : bool
        Whether these times have no relation to the times before.
    """

    volts: NDArray[np.float64]
    times_ns: list[int] | None
    clock_restarted: bool


class ByteSplitter:
    """Cuts a stream of bytes at a delimiter.

    Parameters
    ----------
    delimiter
        One byte.
    longest
        Longer pieces are dropped.
    counts
        Where it counts what it drops, as ``overlong`` and ``garbage_bytes``.

    Examples
    --------
    >>> from collections import Counter
    >>> splitter = ByteSplitter(b',', 9, Counter())
    >>> list(splitter.feed(b'one,tw')), list(splitter.feed(b'o,'))
    ([b'one'], [b'two'])
    """

    def __init__(self, delimiter: bytes, longest: int, counts: Counter[str]) -> None:
        self._delimiter, self._longest, self._counts = delimiter, longest, counts
        self._incomplete = b''
        self._too_long = False

    def restart(self) -> None:
        """Drop the piece that is incomplete: the stream was interrupted."""
        self._counts['garbage_bytes'] += len(self._incomplete)
        self._incomplete, self._too_long = b'', False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the pieces that the next bytes complete, without their delimiters."""
        *pieces, incomplete = (self._incomplete + data).split(self._delimiter)
        self._incomplete = incomplete
        for piece in pieces:
            if self._too_long or len(piece) > self._longest:
                self._counts['overlong'] += 1
                self._counts['garbage_bytes'] += len(piece)
                self._too_long = False
            else:
                yield piece
        if len(incomplete) > self._longest:
            self._counts['garbage_bytes'] += len(incomplete)
            self._incomplete, self._too_long = b'', True
