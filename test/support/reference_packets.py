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

"""An independent encoder of packets, written from docs/packets.md, byte by byte."""

import zlib

#: How a value is sent: the kind of the packet, and the bytes of a value.
KINDS = {
    'int16': (0x12, 2), 'int24': (0x13, 3), 'int32': (0x14, 4),
    'uint16': (0x1A, 2), 'uint24': (0x1B, 3), 'uint32': (0x1C, 4),
}  # fmt: skip


def little(number, length, signed=False):
    return int(number).to_bytes(length, 'little', signed=signed)


def packet(samples, values, sequence, time_us, period_ns=0):
    """Return a packet of samples, lists of one number for each channel, the oldest first."""
    kind, length = KINDS[values]
    content = little(kind, 1) + little(len(samples[0]), 1) + little(len(samples), 2)
    content += little(sequence, 4) + little(time_us, 4) + little(period_ns, 4)
    for sample in samples:
        for value in sample:
            content += little(value, length, signed=values.startswith('int'))
    return content + little(zlib.crc32(content), 4)


def on_the_line(*packets):
    """Return packets in COBS, each with the zero that ends it."""
    line = b''
    for plain in packets:
        for run in plain.split(b'\0'):
            whole = len(run) // 254 * 254  # no zero follows on each of these 254 bytes
            line += b''.join(b'\xff' + run[k : k + 254] for k in range(0, whole, 254))
            line += little(len(run) - whole + 1, 1) + run[whole:]
        line += b'\0'
    return line
