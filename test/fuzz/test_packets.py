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

"""Packets, lines of text and noise on the wire of a sensor."""

import itertools

import numpy as np
from fuzz.fuzzing import fuzz, mutated_bytes
from hypothesis import strategies as st

from slip_detector.sources.live import DeviceClock
from slip_detector.sources.packets import PacketDecoder
from support.reference_packets import on_the_line, packet

CHANNELS = 3


def numbered(sequence, time_us, period_ns=1_000_000, samples=1):
    """Return a sound packet whose values follow from its number."""
    values = (np.arange(samples * CHANNELS).reshape(samples, CHANNELS) + sequence) % 30000
    return packet(values, 'int16', sequence, time_us, period_ns)


def is_numbered(rows):
    """Return whether rows are such as some packet of these tests has; shape (n, channels)."""
    values = np.rint(rows / 1e-3).astype(int)
    return (np.diff(values, axis=1) % 30000 == 1).all()


@st.composite
def streams(draw):
    """Draw what comes from a port: packets and what is none, and when how much of it arrives."""
    line, sequence, time_us = b'', draw(st.integers(0, 2**32 - 1)), draw(st.integers(0, 2**32 - 1))
    for _ in range(draw(st.integers(1, 12))):
        # Mostly the next one, else one that overlaps, comes again, or is of another start.
        sequence += draw(st.sampled_from([1, 1, 1, 0, -1, 2, 1000, 2**31]))
        time_us += draw(st.sampled_from([1000, 1000, 100, 0, -1000, 250_000, 2**31]))
        samples = draw(st.sampled_from([1, 1, 2, 7]))
        period_ns = draw(st.sampled_from([1_000_000, 1_000_000, 0, 1, 2**32 - 1]))
        sound = numbered(sequence % 2**32, time_us % 2**32, period_ns, samples)
        line += on_the_line(draw(mutated_bytes([sound], most=1)))
    line = draw(mutated_bytes([line], most=2))
    cuts = sorted(draw(st.lists(st.integers(0, len(line)), max_size=5)))
    steps_ns = st.sampled_from([0, 1, 1_000_000, 10**9])
    return [
        (line[begin:end], draw(steps_ns))
        for begin, end in zip([0, *cuts], [*cuts, len(line)], strict=True)
    ]


def check_packets(pieces):
    """Decode a stream in pieces and at once: the same samples, which were sent; stamps rise."""
    piecewise, whole = (PacketDecoder(CHANNELS, 'int16', 1e-3, 0.0) for _ in range(2))
    clock = DeviceClock()
    now_ns, stamps, volts = 10**18, [], [np.empty((0, CHANNELS))]
    for data, later_ns in pieces:
        now_ns += later_ns
        samples = clock.stamp(piecewise.feed(data), CHANNELS, now_ns)
        assert samples.volts.shape == (len(samples.stamps_ns), CHANNELS)
        stamps.extend(samples.stamps_ns.tolist())
        volts.append(samples.volts)
        assert is_numbered(samples.volts)
    assert all(a < b for a, b in itertools.pairwise(stamps)), stamps
    decoded = whole.feed(b''.join(data for data, _ in pieces))
    at_once = DeviceClock().stamp(decoded, CHANNELS, now_ns)
    np.testing.assert_array_equal(np.concatenate(volts), at_once.volts)
    assert whole.counts == piecewise.counts


#: Packets whose samples overlap in time, each in order of its own.
OVERLAPPING = [
    (on_the_line(*(numbered(k, 1500 * k, samples=4) for k in range(8))), 0),
    (on_the_line(numbered(8, 12_000, 1, 7)), 1),
]


def test_any_stream_gives_the_same_samples_however_it_is_cut_and_its_stamps_rise():
    fuzz(streams(), check_packets, corpus=[OVERLAPPING, [(b'', 0)]], few=60)
