"""What sensors send, as bytes: binary packets and lines of text; docs/packets.md describes both.

Nothing here reads a port or a clock. Bytes go in, in whatever cuts they arrive; samples come out,
and whatever is no sample is dropped and counted.
"""

import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: First byte of a packet: version 1 in the upper half, in the lower the bytes of a value, plus 8
#: where it is unsigned.
KINDS = {
    'int16': 0x12,
    'int24': 0x13,
    'int32': 0x14,
    'uint16': 0x1A,
    'uint24': 0x1B,
    'uint32': 0x1C,
}

#: Kind, channels, samples, sequence number, time of the first sample in us, period in ns.
HEADER = struct.Struct('<BBHIII')
CHECKSUM = struct.Struct('<I')

#: No packet is longer: what comes later would be of no use to a grasp.
LONGEST_BYTES = 8192

#: A sender that begins again at a lower sequence number is believed after so much of its time, in
#: which not too many packets in a row are missing.
RESTART_US, RESTART_STEP = 250_000, 4

#: A number on a line takes at most so many bytes, the comma included.
NUMBER_BYTES = 32

#: There is only one way to match each, so that a long line that is none takes no longer.
NUMBER = rb'[ \t]*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?[ \t]*'

_WRAP = 2**32
_HALF = 2**31


class Received(NamedTuple):
    """The samples of one packet or one line, oldest first.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    times_ns : list of int, length n, or None
        When each was taken, by the sender's clock, which does not wrap here; None: not told.
    clock_restarted : bool
        These times have nothing to do with those before.
    """

    volts: NDArray[np.float64]
    times_ns: list[int] | None
    clock_restarted: bool


class PacketDecoder:
    """Packets to samples.

    Parameters
    ----------
    channels
        Channels of each sample.
    values
        How a value is sent, a key of :data:`KINDS`.
    scale_v, offset_v
        Volts of a value: offset + scale x value.

    Attributes
    ----------
    counts : Counter of str
        ``packets`` and ``samples`` taken; ``lost`` packets, by the sequence numbers; what was
        dropped, by reason: ``broken`` (not COBS, or too short), ``overlong``, ``checksum``,
        ``kind``, ``channels``, ``length``, ``period`` (none between several samples),
        ``duplicate``, ``late`` (overtaken by a later one, and lost until then); ``restarts`` of
        the sender's clock or numbering; ``garbage_bytes``, all the bytes of what was dropped,
        except for duplicate and late packets.
    """

    def __init__(self, channels: int, values: str, scale_v: float, offset_v: float) -> None:
        self.counts: Counter[str] = Counter()
        self._channels, self._kind = channels, KINDS[values]
        self._scale_v, self._offset_v = scale_v, offset_v
        self._value_bytes = self._kind & 7
        # What zeros COBS takes out it gives back in codes, one per 254 bytes.
        longest = LONGEST_BYTES + LONGEST_BYTES // 254 + 1
        self._splitter = _Splitter(b'\0', longest, self.counts)
        self.restart()

    def restart(self) -> None:
        """Forget the packet begun and the last sequence number: the line was interrupted."""
        self._splitter.restart()
        self._heard = False
        self._last = self._last_us = self._time_us = 0
        # Bit k: packet last - k came.
        self._seen = 0
        self._old_last, self._old_first_us = 0, -1

    def feed(self, data: bytes) -> list[Received]:
        """Take the next bytes of a serial line; return the samples that they complete."""
        received = []
        for piece in self._splitter.feed(data):
            if not piece:  # Zeros may stand on both sides of a packet.
                continue
            packet = cobs_decode(piece)
            # What is not COBS counts as an empty packet would: broken.
            samples = self.decode(packet or b'')
            self.counts['garbage_bytes'] += len(piece) if packet is None else 0
            if samples is not None:
                received.append(samples)
        return received

    def decode(self, packet: bytes) -> Received | None:
        """Take a packet as it is in a datagram; return its samples, or None if it is dropped."""
        fault = self.fault(packet)
        if fault:
            self.counts[fault] += 1
            self.counts['garbage_bytes'] += len(packet)
            return None
        _, channels, n, sequence, time_us, period_ns = HEADER.unpack_from(packet)
        clock_restarted = self._in_order(sequence, time_us)
        if clock_restarted is None:
            return None
        self.counts['packets'] += 1
        self.counts['samples'] += n
        integers = self._integers(packet[HEADER.size : -CHECKSUM.size])
        volts = self._offset_v + self._scale_v * integers.astype(np.float64)
        first_ns = 1000 * self._time_us
        times_ns = [first_ns + i * period_ns for i in range(n)]
        return Received(volts.reshape(n, channels), times_ns, clock_restarted)

    def fault(self, packet: bytes) -> str:
        """Say why a packet cannot be taken; empty: it can."""
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
        return '' if period_ns or n == 1 else 'period'

    def _in_order(self, sequence: int, time_us: int) -> bool | None:
        """Judge a packet by its number; None: drop it; else whether the clock begins anew."""
        ahead = (sequence - self._last) % _WRAP
        if not self._heard:
            clock_restarted = True
        elif 0 < ahead < _HALF:
            self.counts['lost'] += ahead - 1
            self._seen = (self._seen << ahead if ahead < 64 else 0) & (2**64 - 1)
            # A clock that stands still or runs backwards tells as little as one set anew.
            clock_restarted = not 0 < (time_us - self._last_us) % _WRAP < _HALF
            self.counts['restarts'] += clock_restarted
        elif self._restarted(sequence, time_us):
            clock_restarted = True
            self.counts['restarts'] += 1
            self._seen = 0
        else:
            behind = (_WRAP - ahead) % _WRAP
            self.counts['duplicate' if behind < 64 and self._seen >> behind & 1 else 'late'] += 1
            if behind < 64:
                self._seen |= 1 << behind
            return None
        self._time_us += 0 if clock_restarted else (time_us - self._last_us) % _WRAP
        self._heard, self._last, self._last_us = True, sequence, time_us
        self._seen |= 1
        self._old_first_us = -1
        return clock_restarted

    def _restarted(self, sequence: int, time_us: int) -> bool:
        """Tell a sender that began again from single packets that come late.

        Those that were overtaken come among fresh ones, or stop; a sender that was reset goes on.
        """
        if self._old_first_us < 0 or not 0 < (sequence - self._old_last) % _WRAP <= RESTART_STEP:
            self._old_first_us = time_us
        self._old_last = sequence
        return RESTART_US <= (time_us - self._old_first_us) % _WRAP < _HALF

    def _integers(self, data: bytes) -> NDArray[np.integer]:
        letter = 'u' if self._kind & 8 else 'i'
        if self._value_bytes != 3:
            return np.frombuffer(data, f'<{letter}{self._value_bytes}')
        # Three bytes go to the upper end of four, whose shift down brings the sign along.
        padded = np.zeros((len(data) // 3, 4), np.uint8)
        padded[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
        return padded.view(f'<{letter}4')[:, 0] >> 8


class LineDecoder:
    """Lines of comma-separated volts to samples.

    The line that was under way when reading began is dropped. Text has no checksum: a digit that
    was altered or lost on the way is not noticed, so long as a number is left.

    Parameters
    ----------
    channels
        Numbers on a line.
    rate_hz
        Lines are taken this often by the sender's clock; 0: when is not told.

    Attributes
    ----------
    counts : Counter of str
        ``samples`` taken; lines dropped, by reason: ``partial`` (the first), ``channels``,
        ``numbers`` (something else than numbers), ``overlong``; ``garbage_bytes``, all their
        bytes.
    """

    def __init__(self, channels: int, rate_hz: float) -> None:
        self.counts: Counter[str] = Counter()
        self._channels = channels
        self._period_ns = 1e9 / rate_hz if rate_hz else None
        self._splitter = _Splitter(b'\n', channels * NUMBER_BYTES, self.counts)
        self._numbers = re.compile(NUMBER + rb'(?:,' + NUMBER + rb')*')
        self.restart()

    def restart(self) -> None:
        """Forget the line begun: reading was interrupted."""
        self._splitter.restart()
        self._first = True
        self._lines = 0

    def feed(self, data: bytes) -> list[Received]:
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

    def _received(self, volts: NDArray[np.float64]) -> Received:
        self.counts['samples'] += 1
        self._lines += 1
        period_ns = self._period_ns
        times_ns = None if period_ns is None else [round(self._lines * period_ns)]
        return Received(volts, times_ns, self._lines == 1)


class _Splitter:
    """Cuts a stream of bytes at a delimiter; pieces longer than allowed are dropped, counted."""

    def __init__(self, delimiter: bytes, longest: int, counts: Counter[str]) -> None:
        self._delimiter, self._longest, self._counts = delimiter, longest, counts
        self._begun = b''
        self._too_long = False

    def restart(self) -> None:
        self._counts['garbage_bytes'] += len(self._begun)
        self._begun, self._too_long = b'', False

    def feed(self, data: bytes) -> Iterator[bytes]:
        *pieces, begun = (self._begun + data).split(self._delimiter)
        self._begun = begun
        for piece in pieces:
            if self._too_long or len(piece) > self._longest:
                self._counts['overlong'] += 1
                self._counts['garbage_bytes'] += len(piece)
                self._too_long = False
            else:
                yield piece
        if len(begun) > self._longest:
            self._counts['garbage_bytes'] += len(begun)
            self._begun, self._too_long = b'', True


def encode(
    integers: ArrayLike, values: str, sequence: int, time_us: int, period_ns: int = 0
) -> bytes:
    """Make a packet, as a datagram carries it; on a serial line ``cobs_encode`` and a zero follow.

    Parameters
    ----------
    integers : array_like of int, shape (n, c)
        The samples, oldest first.
    values
        How a value is sent, a key of :data:`KINDS`.
    sequence
        Number of the packet, one more than that of the packet before; wraps at 2**32.
    time_us
        When the first sample was taken; wraps at 2**32.
    period_ns
        From sample to sample; 0 is allowed for one.

    Raises
    ------
    ValueError
        When an integer or the packet has no room.
    """
    rows = np.asarray(integers, dtype=np.int64)
    kind = KINDS[values]
    bits = 8 * (kind & 7)
    low, high = (0, 2**bits - 1) if kind & 8 else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    if rows.ndim != 2 or not rows.size or rows.shape[1] > 255:
        raise ValueError(f'integers has the shape {rows.shape}, allowed: (n, 1 to 255)')
    if rows.min() < low or rows.max() > high:
        raise ValueError(
            f'integers has {rows.min()} to {rows.max()}, allowed: {low} to {high} for {values}'
        )
    data = rows.astype('<i8').view(np.uint8).reshape(-1, 8)[:, : kind & 7].tobytes()
    n, channels = rows.shape
    if HEADER.size + len(data) + CHECKSUM.size > LONGEST_BYTES:
        raise ValueError(f'integers has {n} rows, allowed: a packet of {LONGEST_BYTES} bytes')
    packet = HEADER.pack(kind, channels, n, sequence % _WRAP, time_us % _WRAP, period_ns) + data
    return packet + CHECKSUM.pack(zlib.crc32(packet))


def cobs_encode(data: bytes) -> bytes:
    """Stuff bytes so that none is zero: consistent overhead byte stuffing (COBS).

    Each zero is replaced by a code that says how far the next one is; where 254 bytes have none,
    a code stands in between.
    """
    out = bytearray()
    *runs, last = data.split(b'\0')
    for run in runs:
        _stuff(out, run)
        out += bytes([len(run) % 254 + 1]) + run[len(run) // 254 * 254 :]
    _stuff(out, last)
    if len(last) % 254 or not last:
        out += bytes([len(last) % 254 + 1]) + last[len(last) // 254 * 254 :]
    return bytes(out)


def _stuff(out: bytearray, run: bytes) -> None:
    for i in range(0, len(run) - 253, 254):
        out += b'\xff' + run[i : i + 254]


def cobs_decode(stuffed: bytes) -> bytes | None:
    """Undo :func:`cobs_encode`; None where a code points past the end."""
    out = bytearray()
    at, end = 0, len(stuffed)
    while at < end:
        code = stuffed[at]
        following = at + code
        if following > end or not code:
            return None
        out += stuffed[at + 1 : following]
        at = following
        if code < 255 and at < end:
            out.append(0)
    return bytes(out)
