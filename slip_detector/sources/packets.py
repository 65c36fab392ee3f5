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

"""Decodes what a sensor sends, packets or lines of text, which docs/packets.md describes.

Nothing here reads a port or a clock. A decoder takes bytes in pieces of any length and returns
samples; bytes that are not part of a sample are dropped and counted.
"""

import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples

#: First byte of a packet by the type of its values: version 1 in the upper half; in the lower half
#: the number of bytes of a value, plus 8 where it is unsigned.
PACKET_KINDS = {
    'int16': 0x12, 'int24': 0x13, 'int32': 0x14,
    'uint16': 0x1A, 'uint24': 0x1B, 'uint32': 0x1C,
}  # fmt: skip

#: Kind, channels, samples, sequence number, time of the first sample in us, period in ns.
HEADER = struct.Struct('<BBHIII')
CHECKSUM = struct.Struct('<I')

#: Largest length of a packet; the first sample of a longer one would be too late for a grasp.
LONGEST_BYTES = 8192

#: Longest time that a packet of several samples spans, well below a wrap of the sender's time.
LONGEST_PACKET_NS = 60_000_000_000

#: A packet that is up to this many numbers behind the last one is late, or came twice. Where it is
#: further behind, its sender was reset.
MOST_BEHIND = 256

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

    def restart(self) -> None:
        """Drop the incomplete piece after an interruption of the stream."""
        self._counts['garbage_bytes'] += len(self._incomplete)
        self._incomplete = b''

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the pieces that the next bytes complete, without their delimiters."""
        *pieces, incomplete = (self._incomplete + data).split(self._delimiter)
        # One byte more than is allowed shows that the piece is too long.
        self._incomplete = incomplete[: self._longest + 1]
        for piece in pieces:
            if len(piece) <= self._longest:
                yield piece
                continue
            self._counts.update(overlong=1, garbage_bytes=len(piece))
        self._counts['garbage_bytes'] += len(incomplete) - len(self._incomplete)


class PacketDecoder:
    """Decodes packets, and drops those that are damaged, duplicated or out of order.

    Parameters
    ----------
    channels
        Number of channels.
    values
        Type of a value, a key of :data:`PACKET_KINDS`.
    scale_v, offset_v
        The volts of a value are offset + scale x value.

    Attributes
    ----------
    counts : Counter of str
        Decoded ``packets`` and ``samples``; ``overlap``, how many of these packets begin before
        the end of the packet before; ``lost`` packets, by the sequence numbers; dropped
        packets by reason: ``broken`` (not COBS, or too short), ``overlong``, ``checksum``,
        ``kind``, ``channels``, ``length``, ``period`` (0 between several samples, or a packet
        of more than a minute), ``no_time`` (its samples do not fit between the end of the packet
        before and its own end), ``late`` (came twice, or after a later packet, and was counted as
        lost then); ``restarts`` of the sender's clock or numbering; ``garbage_bytes``, the bytes
        of dropped packets except late ones.

    Examples
    --------
    >>> decoder = PacketDecoder(channels=2, values='int16', scale_v=0.001, offset_v=0.0)
    >>> packet = bytes.fromhex('1202010000000000 0000000000000000 d610c210')
    >>> packet += zlib.crc32(packet).to_bytes(4, 'little')
    >>> [samples.volts.tolist() for samples in decoder.decode(packet)]
    [[[4.3100000000000005, 4.29]]]
    >>> decoder.decode(packet[:-1]), decoder.counts['checksum']
    ([], 1)
    """

    def __init__(self, channels: int, values: str, scale_v: float, offset_v: float) -> None:
        self.counts: Counter[str] = Counter()
        self._channels, self._kind = channels, PACKET_KINDS[values]
        self._scale_v, self._offset_v = scale_v, offset_v
        self._value_bytes = self._kind & 7
        # COBS adds at most one byte for each 254 bytes.
        longest = LONGEST_BYTES + LONGEST_BYTES // 254 + 1
        self._splitter = ByteSplitter(b'\0', longest, self.counts)
        self.restart()

    def restart(self) -> None:
        """Drop the incomplete packet and forget the sequence number after an interruption."""
        self._splitter.restart()
        self._last: int | None = None  # Number of the last packet.
        # Times of the last packet and of its last sample, by the sender's clock.
        self._last_us = self._time_us = self._last_ns = 0

    def feed(self, data: bytes) -> list[Samples]:
        """Take the next bytes of a serial line; return the samples that they complete."""
        received = []
        for piece in self._splitter.feed(data):
            if piece:  # Zeros may stand on both sides of a packet.
                packet = cobs_decode(piece)
                # A piece that is not COBS counts as broken, like an empty packet.
                received += self.decode(packet or b'')
                self.counts['garbage_bytes'] += len(piece) if packet is None else 0
        return received

    def decode(self, packet: bytes) -> list[Samples]:
        """Take the packet of a datagram; return its samples, or nothing if it is dropped.

        Their stamps are by the sender's clock, with its wraps removed; ``new_stretch`` says that
        they are unrelated to the stamps before.
        """
        if fault := self.fault(packet):
            self.counts.update({fault: 1, 'garbage_bytes': len(packet)})
            return []
        _, channels, n, sequence, time_us, period_ns = HEADER.unpack_from(packet)
        if (clock_restarted := self._in_order(sequence, time_us)) is None:
            return []
        first_ns = 1000 * self._time_us
        last_ns = first_ns + (n - 1) * period_ns
        times_ns = first_ns + period_ns * np.arange(n)
        if not clock_restarted and first_ns <= self._last_ns:
            # A sender that stamps with the time of sending causes this after each packet that it
            # sent late. The last sample keeps its time; the others are spread evenly before it.
            free_ns = last_ns - self._last_ns
            if free_ns < n:
                self.counts['no_time'] += 1
                return []
            self.counts['overlap'] += 1
            times_ns = self._last_ns + np.arange(1, n + 1) * free_ns // n
        self._last_ns = last_ns
        self.counts.update(packets=1, samples=n)
        integers = self._integers(packet[HEADER.size : -CHECKSUM.size])
        volts = self._offset_v + self._scale_v * integers.astype(np.float64)
        return [Samples(volts.reshape(n, channels), times_ns, new_stretch=clock_restarted)]

    def fault(self, packet: bytes) -> str:
        """Return the reason why a packet is dropped; empty for a good packet."""
        data_bytes = len(packet) - HEADER.size - CHECKSUM.size
        if data_bytes < 0:
            return 'broken'
        if len(packet) > LONGEST_BYTES:
            return 'overlong'
        if zlib.crc32(packet[: -CHECKSUM.size]) != CHECKSUM.unpack_from(packet, -CHECKSUM.size)[0]:
            return 'checksum'
        kind, channels, n, _, _, period_ns = HEADER.unpack_from(packet)
        if kind != self._kind:
            return 'kind'
        if channels != self._channels:
            return 'channels'
        if not n or data_bytes != n * channels * self._value_bytes:
            return 'length'
        lasts_ns = (n - 1) * period_ns
        return '' if n == 1 or 0 < lasts_ns <= LONGEST_PACKET_NS else 'period'

    def _in_order(self, sequence: int, time_us: int) -> bool | None:
        """Return whether the sender's clock restarted before a packet; None: drop the packet."""
        clock_restarted = self._last is None
        if self._last is not None:
            ahead, passed_us = _steps(self._last, sequence), _steps(self._last_us, time_us)
            if -MOST_BEHIND <= ahead <= 0:
                self.counts['late'] += 1
                return None
            # A clock that stands still or runs backwards was restarted.
            clock_restarted = ahead < 0 or passed_us <= 0
            self.counts['lost'] += max(ahead - 1, 0)
            self.counts['restarts'] += clock_restarted
            self._time_us += 0 if clock_restarted else passed_us
        self._last, self._last_us = sequence, time_us
        return clock_restarted

    def _integers(self, data: bytes) -> NDArray[np.integer]:
        # The bytes become the upper ones of four; shifting them down keeps the sign.
        unused = 4 - self._value_bytes
        padded = np.zeros((len(data) // self._value_bytes, 4), np.uint8)
        padded[:, unused:] = np.frombuffer(data, np.uint8).reshape(-1, self._value_bytes)
        return padded.view('<u4' if self._kind & 8 else '<i4')[:, 0] >> 8 * unused


def _steps(before: int, after: int) -> int:
    """Return how far a counter of 32 bits went; negative: back, by less than half of its range."""
    return (after - before + 2**31) % 2**32 - 2**31


def cobs_decode(stuffed: bytes) -> bytes | None:
    r"""Undo Consistent Overhead Byte Stuffing: before each run of bytes stands its length, plus 1.

    Between two runs was a zero, unless the first one has 254 bytes.

    Returns
    -------
    bytes or None
        None where the bytes are not COBS: a code points past the end or is zero.

    Examples
    --------
    >>> cobs_decode(bytes([0x03, 0x11, 0x22, 0x02, 0x33])).hex(' ')
    '11 22 00 33'
    >>> cobs_decode(b'\x05\x11') is None
    True
    """
    out = bytearray()
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        run = stuffed[at + 1 : at + code]
        if len(run) != code - 1:
            return None
        at += code
        out += run + b'\0' if code < 255 and at < len(stuffed) else run
    return bytes(out)


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
        self._first, self._lines = True, 0

    def feed(self, data: bytes) -> list[Samples]:
        """Take the next bytes; return the samples of the lines that they complete.

        Their stamps are by the sender's clock, from 0 on; there are none if its rate is unknown.
        """
        received = []
        for piece in self._splitter.feed(data):
            line = piece.removesuffix(b'\r')
            has_numbers = self._numbers.fullmatch(line)
            volts = np.array([line.split(b',')] if has_numbers else [[np.nan]], np.float64)
            if self._first:
                self._first, reason = False, 'partial'
            elif not line:
                continue
            elif not np.isfinite(volts).all():
                reason = 'numbers'
            elif volts.shape[1] != self._channels:
                reason = 'channels'
            else:
                self.counts['samples'] += 1
                self._lines += 1
                times_ns = [round(self._lines * self._period_ns)] if self._period_ns else []
                stamps_ns = np.array(times_ns, np.int64)
                received.append(Samples(volts, stamps_ns, new_stretch=self._lines == 1))
                continue
            self.counts.update({reason: 1, 'garbage_bytes': len(piece)})
        return received
