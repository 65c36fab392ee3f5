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

"""Decodes lines of text, which docs/packets.md describes, to samples."""

import re
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from slip_detector.sources.byte_stream import ByteSplitter, DecodedSamples

#: Largest number of bytes of a number on a line, with its comma.
NUMBER_BYTES = 32

#: A number on a line. Text can match in one way only, so that a long line that does not match
#: causes no backtracking.
NUMBER = rb'[ \t]*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?[ \t]*'


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
        self._period_ns = 1e9 / rate_hz if rate_hz else None
        self._splitter = ByteSplitter(b'\n', channels * NUMBER_BYTES, self.counts)
        self._numbers = re.compile(NUMBER + rb'(?:,' + NUMBER + rb')*')
        self.restart()

    def restart(self) -> None:
        """Drop the incomplete line, and the next line, after an interruption."""
        self._splitter.restart()
        self._first = True
        self._lines = 0

    def feed(self, data: bytes) -> list[DecodedSamples]:
        """Take the next bytes; return the samples of the lines that they complete."""
        received = []
        for piece in self._splitter.feed(data):
            line = piece.removesuffix(b'\r')
            if self._first:
                self._first = False
                reason = 'partial'
            elif not line:
                continue
            elif not self._numbers.fullmatch(line):
                reason = 'numbers'
            elif line.count(b',') != self._channels - 1:
                reason = 'channels'
            else:
                volts = np.array([[float(number) for number in line.split(b',')]])
                if np.isfinite(volts).all():
                    received.append(self._received(volts))
                    continue
                reason = 'numbers'
            self.counts[reason] += 1
            self.counts['garbage_bytes'] += len(piece)
        return received

    def _received(self, volts: NDArray[np.float64]) -> DecodedSamples:
        self.counts['samples'] += 1
        self._lines += 1
        period_ns = self._period_ns
        times_ns = None if period_ns is None else [round(self._lines * period_ns)]
        return DecodedSamples(volts, times_ns, self._lines == 1)
