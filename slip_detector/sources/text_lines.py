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

"""Splits a stream of bytes, and decodes lines of text, which docs/packets.md describes."""

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from slip_detector.chain.samples import Samples

#: Largest number of bytes of a number on a line, with its comma.
NUMBER_BYTES = 32

#: A number on a line. Text can match in one way only, so that a long line that does not match
#: causes no backtracking.
NUMBER = rb'[ \t]*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?[ \t]*'


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


class LineDecoder:
    r"""Decodes lines of comma-separated volts.

    The first line is dropped, as reading may have begun within it. Text has no checksum: a wrong
    or lost digit is not noticed if what remains is a number.

    Parameters
    ----------
    channels
        Number of values on a line.
    rate_hz
        Rate at which the sensor takes the lines; 0 where it is not known.

    Attributes
    ----------
    counts : Counter of str
        Decoded ``samples``; dropped lines by reason: ``partial`` (the first line), ``channels``,
        ``numbers`` (something other than numbers), ``overlong``; ``garbage_bytes``, the bytes of
        dropped lines.

    Examples
    --------
    >>> decoder = LineDecoder(channels=2, rate_hz=1000.0)
    >>> [samples.volts.tolist() for samples in decoder.feed(b'4.31,4.29\n4.30,4.28\n')]
    [[[4.3, 4.28]]]
    >>> decoder.counts['partial']
    1
    """

    def __init__(self, channels: int, rate_hz: float) -> None:
        self.counts: Counter[str] = Counter()
        self._channels = channels
        self._period_ns = 1e9 / rate_hz if rate_hz else 0.0
        self._splitter = ByteSplitter(b'\n', channels * NUMBER_BYTES, self.counts)
        self._numbers = re.compile(NUMBER + rb'(?:,' + NUMBER + rb')*')
        self.restart()

    def restart(self) -> None:
        """Drop the incomplete line, and the next line, after an interruption."""
        self._splitter.restart()
        self._first = True
        self._lines = 0

    def feed(self, data: bytes) -> list[Samples]:
        """Take the next bytes; return the samples of the lines that they complete.

        Their stamps are by the sender's clock, from 0 on; there are none if its rate is unknown.
        """
        received = []
        for piece in self._splitter.feed(data):
            line = piece.removesuffix(b'\r')
            numbers = line.split(b',')
            if self._first:
                self._first, reason = False, 'partial'
            elif not line:
                continue
            elif not self._numbers.fullmatch(line):
                reason = 'numbers'
            elif len(numbers) != self._channels:
                reason = 'channels'
            elif not np.isfinite(volts := np.array([numbers], np.float64)).all():
                reason = 'numbers'
            else:
                self.counts['samples'] += 1
                self._lines += 1
                times_ns = [round(self._lines * self._period_ns)] if self._period_ns else []
                stamps_ns = np.array(times_ns, np.int64)
                received.append(Samples(volts, stamps_ns, new_stretch=self._lines == 1))
                continue
            self.counts[reason] += 1
            self.counts['garbage_bytes'] += len(piece)
        return received
