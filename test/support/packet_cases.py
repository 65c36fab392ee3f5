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

"""Packets of three channels for the tests, and what a decoder makes of them."""

import numpy as np

from slip_detector.sources.packets import PacketDecoder
from support.reference_packets import packet

PERIOD_US = 1000


def decoder(channels=3):
    return PacketDecoder(channels, 'int16', scale_v=1e-3, offset_v=0.0)


def packets(n, first=0, samples=1):
    """Make packets whose integers differ all over; one a millisecond."""
    return [
        packet(values, 'int16', k, (k * samples * PERIOD_US) % 2**32, PERIOD_US * 1000)
        for k in range(first, first + n)
        for values in [(np.arange(samples * 3).reshape(samples, 3) + 7 * k) % 30000 - 9]
    ]


def integers(received):
    """Return the integers that were sent, by row."""
    volts = np.concatenate([np.empty((0, 3)), *(r.volts for r in received)])
    return np.round(volts / 1e-3).astype(int).tolist()


def sent_by(*some):
    """Return what a decoder of its own makes of packets, one by one."""
    return integers([samples for packet in some for samples in decoder().decode(packet)])
