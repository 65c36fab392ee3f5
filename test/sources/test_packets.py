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

"""Packets and lines of text: the samples that were sent are decoded, and no others."""

import re
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.packets import (
    CHECKSUM,
    HEADER,
    LONGEST_BYTES,
    MOST_BEHIND,
    PACKET_KINDS,
    LineDecoder,
    PacketDecoder,
    cobs_decode,
)
from support.pages import ROOT
from support.reference_packets import KINDS, on_the_line, packet

TEXT = (ROOT / 'docs' / 'packets.md').read_text(encoding='utf-8')

PERIOD_US = 1000


def decoder(channels=3):
    return PacketDecoder(channels, 'int16', scale_v=1e-3, offset_v=0.0)


def packets(n, first=0):
    """Make packets whose integers differ all over; one a millisecond."""
    return [
        packet([(np.arange(3) + 7 * k) % 30000 - 9], 'int16', k, k * PERIOD_US % 2**32)
        for k in range(first, first + n)
    ]


def integers(received):
    """Return the integers that were sent, by row."""
    volts = np.concatenate([np.empty((0, 3)), *(r.volts for r in received)])
    return np.round(volts / 1e-3).astype(int).tolist()


def sent_by(*some):
    """Return what a decoder of its own makes of packets, one by one."""
    return integers([samples for packet in some for samples in decoder().decode(packet)])


@given(st.data())
def test_encoded_packets_are_decoded(data):
    values = data.draw(st.sampled_from(sorted(PACKET_KINDS)))
    bits = int(values.removeprefix('u').removeprefix('int'))
    low, high = (0, 2**bits - 1) if values[0] == 'u' else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    channels, n = data.draw(st.integers(1, 20)), data.draw(st.integers(1, 9))
    numbers = st.one_of(st.sampled_from([low, -1, 0, 1, high]), st.integers(low, high))
    row = st.lists(numbers.map(lambda x: max(x, low)), min_size=channels, max_size=channels)
    sent = data.draw(st.lists(row, min_size=n, max_size=n))
    scale_v, offset_v = data.draw(st.sampled_from([(1.0, 0.0), (-2.5e-6, 1.25), (1e-3, -5.0)]))
    period_ns = data.draw(st.integers(1, 10**9))
    receiver = PacketDecoder(channels, values, scale_v, offset_v)
    sequence = data.draw(st.integers(0, 2**32 - 1))
    (received,) = receiver.feed(on_the_line(packet(sent, values, sequence, 5, period_ns)))
    np.testing.assert_array_equal(received.volts, offset_v + scale_v * np.array(sent, float))
    assert received.volts.dtype == np.float64
    assert np.diff(received.stamps_ns).tolist() == [period_ns] * (n - 1)
    assert +receiver.counts == {'packets': 1, 'samples': n}


def with_checksum(header, data):
    packet = HEADER.pack(*header) + data
    return packet + CHECKSUM.pack(zlib.crc32(packet))


@pytest.mark.parametrize(
    ('sent', 'reason'),
    [
        (packet([[1, 2]], 'int16', 0, 0), 'channels'),
        (packet([[1, 2, 3]], 'uint16', 0, 0), 'kind'),
        (with_checksum((0x22, 3, 1, 0, 0, 0), bytes(6)), 'kind'),
        (with_checksum((PACKET_KINDS['int16'], 3, 2, 0, 0, 0), bytes(6)), 'length'),
        (with_checksum((PACKET_KINDS['int16'], 3, 0, 0, 0, 0), b''), 'length'),
        (with_checksum((PACKET_KINDS['int16'], 3, 1400, 0, 0, 0), bytes(8400)), 'overlong'),
        (packet([[1, 2, 3], [4, 5, 6]], 'int16', 0, 0, 0), 'period'),
        (packet(np.ones((61, 3)), 'int16', 0, 0, 1_000_000_001), 'period'),
    ],
)
def test_a_sound_packet_of_another_make_is_dropped_and_counted(sent, reason):
    receiver = decoder()
    assert receiver.decode(sent) == []
    assert receiver.counts == {reason: 1, 'garbage_bytes': len(sent)}


def test_the_packet_after_a_broken_one_is_taken():
    line = on_the_line(*packets(3))
    assert integers(decoder().feed(b'\x09\x01garbage\0' + line)) == sent_by(*packets(3))
    # A lost delimiter costs two packets, a line that hangs costs one.
    first = len(on_the_line(packets(1)[0])) - 1
    receiver = decoder()
    assert integers(receiver.feed(line[:first] + line[first + 1 :])) == sent_by(packets(3)[2])
    receiver = decoder()
    hanging = b'\xff' * 3 * LONGEST_BYTES
    assert integers(receiver.feed(hanging + b'\0' + line)) == sent_by(*packets(3))
    assert receiver.counts['overlong'] == 1
    assert receiver.counts['garbage_bytes'] == len(hanging)


@pytest.mark.parametrize(
    ('plain', 'stuffed'),
    [
        (b'', b'\x01'),
        (b'\0', b'\x01\x01'),
        (b'\x11\x22\0\x33', b'\x03\x11\x22\x02\x33'),
        (bytes(range(1, 255)), b'\xff' + bytes(range(1, 255))),
        (bytes(range(1, 256)), b'\xff' + bytes(range(1, 255)) + b'\x02\xff'),
        (bytes(range(2, 256)) + b'\0', b'\xff' + bytes(range(2, 256)) + b'\x01\x01'),
        (bytes(range(3, 256)) + b'\0\x01', b'\xfe' + bytes(range(3, 256)) + b'\x02\x01'),
    ],
)
def test_stuffed_bytes_are_read_as_published(plain, stuffed):
    assert cobs_decode(stuffed) == plain


def test_the_tables_say_what_the_code_does():
    kinds = re.findall(r'^\| (0x\w+) \| `(\w+)` \| (\d) \|', TEXT, re.M)
    assert {name: int(kind, 16) for kind, name, _ in kinds} == PACKET_KINDS
    for kind, name, value_bytes in kinds:
        assert KINDS[name] == (int(kind, 16), int(value_bytes))
    assert f'at most {LONGEST_BYTES} bytes' in TEXT
    fields = re.findall(r'^\| (\d+) \| (\d+) \| (\w+) \|', TEXT, re.M)
    offsets = [int(offset) for offset, _, _ in fields]
    lengths = [int(length) for _, length, _ in fields]
    assert offsets == [sum(lengths[:k]) for k in range(len(lengths))]
    assert sum(lengths) == HEADER.size


def test_every_count_is_explained():
    explained = set(re.findall(r'`(\w+)`', TEXT))
    for doc in (PacketDecoder.__doc__, LineDecoder.__doc__):
        assert set(re.findall(r'``(\w+)``', doc.partition('counts :')[2])) <= explained


# --- lost, repeated and late packets, and the times of their samples ---------------------------


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_numbers_and_times_may_wrap(first, n):
    receiver = decoder(channels=1)
    received = []
    for k in range(n):
        # Both counters wrap somewhere near, at different packets.
        sequence, time_us = (first + k) % 2**32, (2**32 - 2500 + k * PERIOD_US) % 2**32
        received += receiver.feed(on_the_line(packet([[k]], 'int16', sequence, time_us)))
    times_ns = [r.stamps_ns[0] for r in received]
    assert np.diff(times_ns).tolist() == [PERIOD_US * 1000] * (n - 1)
    assert [r.new_stretch for r in received] == [True] + [False] * (n - 1)
    assert not receiver.counts['lost']


@given(st.randoms(use_true_random=False))
def test_any_order_of_datagrams_gives_samples_in_order_and_counts_the_rest(rng):
    sent = packets(60)
    came = sorted(sent * 2, key=lambda packet: sent.index(packet) + rng.uniform(0, 12))
    came = sent[:1] + [packet for packet in came if rng.random() > 0.2]
    receiver = decoder()
    received = [samples for each in came for samples in receiver.decode(each)]
    taken = integers(received)
    wanted = sent_by(*sent)
    assert taken == [row for row in wanted if row in taken]
    counts = receiver.counts
    assert counts['packets'] + counts['late'] == len(came)
    first, last = wanted.index(taken[0]), wanted.index(taken[-1])
    assert counts['packets'] + counts['lost'] == last - first + 1


def test_a_sender_that_began_again_is_believed():
    receiver = decoder()
    for sent in packets(10, first=MOST_BEHIND):
        assert receiver.decode(sent)
    received = [samples for sent in packets(400) for samples in receiver.decode(sent)]
    assert integers(received) == sent_by(*packets(400))
    assert [r.new_stretch for r in received] == [True] + [False] * (len(received) - 1)
    assert receiver.counts['restarts'] == 1
    assert receiver.counts['lost'] == receiver.counts['late'] == 0


def test_samples_that_begin_before_the_end_of_the_packet_before_are_spread_behind_it():
    receiver = decoder(channels=1)

    def times_us(sequence, time_us, n):
        sent = packet(np.ones((n, 1)), 'int16', sequence, time_us, PERIOD_US * 1000)
        return [(samples.stamps_ns / 1000).tolist() for samples in receiver.decode(sent)]

    assert times_us(0, 0, 4) == [[0, 1000, 2000, 3000]]
    assert times_us(1, 2000, 4) == [[3500, 4000, 4500, 5000]]
    assert times_us(2, 4000, 1) == []  # There is no time left for it.
    assert times_us(3, 6000, 2) == [[6000, 7000]]
    wanted = {'packets': 3, 'samples': 10, 'overlap': 1, 'no_time': 1}
    assert {name: receiver.counts[name] for name in (*wanted, 'lost')} == {**wanted, 'lost': 0}


MIXED_TEXT = st.lists(
    st.sampled_from([b'1', b'.5', b',', b'\n', b'\r\n', b'-', b'e9', b' ', b'nan', b'\0', b'\xff'])
).map(b''.join)


def rows(decoded, channels=3):
    return np.concatenate([np.empty((0, channels)), *(samples.volts for samples in decoded)])


def test_lines_are_read_as_people_write_them():
    receiver = LineDecoder(3, 0.0)
    text = b'rest of a line\n1,2,3\r\n -1.5e-3 ,\t+.5, 4.\n\n\r\n0,0,1E2\n'
    received = receiver.feed(text)
    assert rows(received).tolist() == [[1, 2, 3], [-1.5e-3, 0.5, 4], [0, 0, 100]]
    assert not any(len(r.stamps_ns) for r in received)
    assert receiver.counts == {'samples': 3, 'partial': 1, 'garbage_bytes': 14}


@pytest.mark.parametrize(
    ('line', 'reason'),
    [
        (b'1,2', 'channels'),
        (b',1,2', 'numbers'),
        (b'1,2,3 4', 'numbers'),
        (b'1,2,1_0', 'numbers'),
        (b'1,2,nan', 'numbers'),
        (b'1,2,1e999', 'numbers'),
        (b'1,2,3\0', 'numbers'),
        (b'1.0,2.0,3.1.0,2.0,3.0', 'numbers'),
        (b'1,2,' + b'3' * 200, 'overlong'),
    ],
)
def test_a_line_that_is_no_sample_is_dropped_and_counted(line, reason):
    receiver = LineDecoder(3, 0.0)
    received = receiver.feed(b'\n' + line + b'\n7,8,9\n')
    assert rows(received).tolist() == [[7, 8, 9]]
    assert receiver.counts[reason] == 1
    assert receiver.counts['garbage_bytes'] == len(line)


def test_a_long_line_that_is_nearly_right_is_refused_at_once():
    receiver = LineDecoder(16, 0.0)
    # A pattern that can match a number in several ways would try them all: 25 ** 16.
    assert receiver.feed(b'\n' + b','.join([b'1' * 25] * 16) + b'x\n') == []
    assert receiver.feed(b' ' * 400 + b'x\n') == []
    assert receiver.counts['numbers'] == 2


@given(MIXED_TEXT, st.lists(st.integers(0, 30)))
def test_any_cut_of_the_text_gives_the_same_samples_and_counts(text, cuts):
    text += b'\n1,2,3\n' + b'9' * 150 + b'\n4,5,6\n'
    whole, piecewise = LineDecoder(3, 100.0), LineDecoder(3, 100.0)
    wanted = whole.feed(text)
    received, at = [], 0
    for cut in [*cuts, len(text)]:
        received += piecewise.feed(text[at : at + cut])
        at += cut
    np.testing.assert_array_equal(rows(received), rows(wanted))
    assert [r.stamps_ns.tolist() for r in received] == [r.stamps_ns.tolist() for r in wanted]
    assert piecewise.counts == whole.counts


def test_lines_at_a_rate_have_times_that_restart_after_an_interruption():
    receiver = LineDecoder(1, 400.0)
    received = receiver.feed(b'\n1\n2\n3')
    receiver.restart()
    received += receiver.feed(b'4\n5\n6\n')
    assert rows(received, 1)[:, 0].tolist() == [1, 2, 5, 6]
    assert [r.new_stretch for r in received] == [True, False, True, False]
    assert np.diff([r.stamps_ns[0] for r in received])[[0, 2]].tolist() == [2_500_000] * 2
