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

"""Send packets of samples to slip_driver over UDP: ``python3 send_packets.py [ADDRESS [PORT]]``.

Only the standard library is needed. docs/packets.md describes the packet byte by byte.
"""

import contextlib
import itertools
import math
import random
import socket
import struct
import sys
import time
import zlib

#: Kind of the values: int16 (``packet_values``).
INT16 = 0x12

CHANNELS = 16
SAMPLES_PER_PACKET = 10
PERIOD_NS = 2_000_000


def packet(sequence, samples, period_ns):
    """Make a packet of samples of int16, of which the last was taken just now.

    Parameters
    ----------
    sequence
        Number of the packet: one more than that of the packet before.
    samples
        Lists of whole numbers, one for each channel, the oldest sample first.
    period_ns
        Time from sample to sample in ns.
    """
    n, channels = len(samples), len(samples[0])
    first_us = (time.monotonic_ns() - (n - 1) * period_ns) // 1000
    header = struct.pack(
        '<BBHIII', INT16, channels, n, sequence % 2**32, first_us % 2**32, period_ns
    )
    values = b''.join(struct.pack(f'<{channels}h', *sample) for sample in samples)
    return header + values + struct.pack('<I', zlib.crc32(header + values))


def send(samples_of_packets, period_ns, address=('127.0.0.1', 47380)):
    """Send a packet for each list of samples."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for sequence, samples in enumerate(samples_of_packets):
            sender.sendto(packet(sequence, samples, period_ns), address)


def simulated_samples():
    """Yield samples without end: every other second all channels vibrate at 25 Hz.

    A unit is a millivolt, which is the driver's default (``packet_scale_v``).
    """
    begin_s = time.monotonic()
    for first in itertools.count(0, SAMPLES_PER_PACKET):
        samples = []
        for n in range(first, first + SAMPLES_PER_PACKET):
            time_s = 1e-9 * n * PERIOD_NS
            vibration = 50 * math.sin(2 * math.pi * 25 * time_s) if time_s % 2 > 1 else 0
            samples.append([round(4300 + vibration + random.gauss(0, 1)) for _ in range(CHANNELS)])
        # Wait until the last of them would have been taken.
        time.sleep(max(0.0, begin_s + time_s - time.monotonic()))
        yield samples


def main():
    """Send the samples until Ctrl-C."""
    address = sys.argv[1] if len(sys.argv) > 1 else '127.0.0.1'
    port = int(sys.argv[2]) if len(sys.argv) > 2 else 47380
    with contextlib.suppress(KeyboardInterrupt):
        send(simulated_samples(), PERIOD_NS, (address, port))


if __name__ == '__main__':
    main()
