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

"""A splitter of byte streams at a delimiter, and the form of the samples that decoders return."""

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
        When each sample was taken, by the sender's clock with its wraps removed; None where the
        sender does not send times.
    clock_restarted : bool
        Whether these times are unrelated to the times before.

    Examples
    --------
    >>> samples = DecodedSamples(np.array([[4.3, 4.2]]), [2_000_000], clock_restarted=False)
    >>> samples.volts.shape, samples.times_ns
    ((1, 2), [2000000])
    """

    volts: NDArray[np.float64]
    times_ns: list[int] | None
    clock_restarted: bool


class ByteSplitter:
    """Splits a stream of bytes at a delimiter.

    Parameters
    ----------
    delimiter
        One byte.
    longest
        Largest length of a piece in bytes; longer pieces are dropped.
    counts
        Counts what is dropped, as ``overlong`` and ``garbage_bytes``.

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
        """Drop the incomplete piece after an interruption of the stream."""
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
