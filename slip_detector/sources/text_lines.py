"""Lines of text, as docs/packets.md describes them, to samples."""

import re
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from slip_detector.sources.byte_stream import ByteSplitter, DecodedSamples

#: A number on a line takes at most so many bytes, the comma included.
NUMBER_BYTES = 32

#: A line matches in one way at most, so that a long line that does not match costs no more.
NUMBER = rb'[ \t]*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?[ \t]*'


class LineDecoder:
    r"""Decodes lines of comma-separated volts.

    The first line is dropped, as reading may have begun within it. Text has no checksum: an
    altered or lost digit is not noticed if a number is left.

    Parameters
    ----------
    channels
        Numbers on a line.
    rate_hz
        Rate at which the sensor takes the lines; 0: it is not known when they are taken.

    Attributes
    ----------
    counts : Counter of str
        ``samples`` taken; lines dropped, by reason: ``partial`` (the first), ``channels``,
        ``numbers`` (something else than numbers), ``overlong``; ``garbage_bytes``, all their
        bytes.

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
        """Drop the incomplete line, and the next first line: reading was interrupted."""
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
