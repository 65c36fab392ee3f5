"""The packets of a sensor, which docs/packets.md describes, to samples and back.

Nothing here reads a port or a clock. Bytes go in, in pieces of any length; samples come out, and
bytes that make no sample are dropped and counted.
"""

import struct
import zlib
from collections import Counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.byte_stream import ByteSplitter, DecodedSamples
from slip_detector.sources.cobs import cobs_decode

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

#: The longest packet: a longer one would bring its first sample too late for a grasp.
LONGEST_BYTES = 8192

#: Sequence numbers that are lower than before are taken for those of a sender that was reset when
#: they have risen for this long by the sender's clock, by at most this step from packet to packet.
RESTART_US, RESTART_STEP = 250_000, 4

_WRAP = 2**32
_HALF = 2**31


class PacketDecoder:
    """Decodes packets, and drops those that are damaged, duplicated or out of order.

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
        ``packets`` and ``samples`` taken; ``lost`` packets, by the sequence numbers; packets
        dropped, by reason: ``broken`` (not COBS, or too short), ``overlong``, ``checksum``,
        ``kind``, ``channels``, ``length``, ``period`` (0 between several samples),
        ``duplicate``, ``late`` (it came after a later one, and was counted as lost then);
        ``restarts`` of the sender's clock or numbering; ``garbage_bytes``, all bytes of dropped
        packets but the duplicate and late ones.

    Examples
    --------
    >>> decoder = PacketDecoder(channels=2, values='int16', scale_v=0.001, offset_v=0.0)
    >>> packet = encode([[4310, 4290]], 'int16', sequence=0, time_us=0)
    >>> decoder.decode(packet).volts.tolist()
    [[4.3100000000000005, 4.29]]
    >>> decoder.decode(packet[:-1]) is None, decoder.counts['checksum']
    (True, 1)
    """

    def __init__(self, channels: int, values: str, scale_v: float, offset_v: float) -> None:
        self.counts: Counter[str] = Counter()
        self._channels, self._kind = channels, KINDS[values]
        self._scale_v, self._offset_v = scale_v, offset_v
        self._value_bytes = self._kind & 7
        # What zeros COBS takes out it gives back in codes, one per 254 bytes.
        longest = LONGEST_BYTES + LONGEST_BYTES // 254 + 1
        self._splitter = ByteSplitter(b'\0', longest, self.counts)
        self.restart()

    @classmethod
    def from_config(cls, config: DriverConfig) -> 'PacketDecoder':
        """Make a decoder of the packets that the driver's parameters describe."""
        return cls(
            config.channels, config.packet_values, config.packet_scale_v, config.packet_offset_v
        )

    def restart(self) -> None:
        """Drop the incomplete packet, forget the sequence number: the line was interrupted."""
        self._splitter.restart()
        self._heard = False
        self._last = self._last_us = self._time_us = 0
        # Bit k is set when packet number last - k has come.
        self._seen = 0
        self._old_last, self._old_first_us = 0, -1

    def feed(self, data: bytes) -> list[DecodedSamples]:
        """Take the next bytes of a serial line; return the samples that they complete."""
        received = []
        for piece in self._splitter.feed(data):
            if not piece:  # Zeros may stand on both sides of a packet.
                continue
            packet = cobs_decode(piece)
            # What is not COBS is counted as an empty packet is: broken.
            samples = self.decode(packet or b'')
            self.counts['garbage_bytes'] += len(piece) if packet is None else 0
            if samples is not None:
                received.append(samples)
        return received

    def decode(self, packet: bytes) -> DecodedSamples | None:
        """Take a packet as a datagram carries it; return its samples, None if it is dropped."""
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
        return DecodedSamples(volts.reshape(n, channels), times_ns, clock_restarted)

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
        """Return whether the sender's clock restarted before this packet; None: drop it."""
        ahead = (sequence - self._last) % _WRAP
        if not self._heard:
            clock_restarted = True
        elif 0 < ahead < _HALF:
            self.counts['lost'] += ahead - 1
            self._seen = (self._seen << ahead if ahead < 64 else 0) & (2**64 - 1)
            # A clock that stands still or runs backwards has no relation to the times before.
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
        """Return whether the sender was reset, given a packet whose number is not higher.

        Late packets come between new ones, or end; those of a sender that was reset go on.
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


def encode(
    integers: ArrayLike, values: str, sequence: int, time_us: int, period_ns: int = 0
) -> bytes:
    """Make a packet as a datagram carries it.

    A serial line carries ``cobs_encode(packet)`` and a zero byte.

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
        When an integer is out of range for ``values``, or the packet is too long.

    Examples
    --------
    >>> encode([[1, -1]], 'int16', sequence=7, time_us=0).hex(' ', 4)
    '12020100 07000000 00000000 00000000 0100ffff db7b5845'
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
