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

"""Packets: the samples that were sent are decoded, and no others."""

import random
import zlib
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.cobs import cobs_decode, cobs_encode
from slip_detector.sources.packets import (
    CHECKSUM,
    HEADER,
    LONGEST_BYTES,
    PACKET_KINDS,
    PacketDecoder,
    encode,
)
from support.packet_cases import decoder, integers, on_the_line, packets, sent_by

#: Half an hour at 115200 baud, ten bits a byte.
HALF_AN_HOUR_BYTES = 115200 // 10 * 1800


@given(st.data())
def test_what_is_encoded_is_decoded(data):
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
    packet = encode(sent, values, data.draw(st.integers(0, 2**32 - 1)), 5, period_ns)
    (received,) = receiver.feed(cobs_encode(packet) + b'\0')
    np.testing.assert_array_equal(received.volts, offset_v + scale_v * np.array(sent, float))
    assert received.volts.dtype == np.float64
    assert np.diff(received.times_ns).tolist() == [period_ns] * (n - 1)
    assert +receiver.counts == {'packets': 1, 'samples': n}


@given(st.lists(st.integers(0, 40)), st.binary(max_size=200))
def test_any_cut_of_the_bytes_gives_the_same_samples_and_counts(cuts, noise):
    line = on_the_line(packets(3)) + noise + b'\0' + on_the_line(packets(4, first=4, samples=2))
    whole, piecewise = decoder(), decoder()
    wanted = whole.feed(line)
    received, at = [], 0
    for cut in [*cuts, len(line)]:
        received += piecewise.feed(line[at : at + cut])
        at += cut
    assert integers(received) == integers(wanted)
    assert [r.times_ns for r in received] == [r.times_ns for r in wanted]
    assert piecewise.counts == whole.counts


@given(st.data())
def test_a_corrupted_packet_is_never_taken_for_another(data):
    good = packets(1, samples=3)[0]
    line = bytearray(b'\0' + cobs_encode(good) + b'\0')
    kind = data.draw(st.sampled_from(['bits', 'cut', 'insert', 'swap']))
    at = data.draw(st.integers(1, len(line) - 2))
    if kind == 'bits':
        for i in data.draw(st.lists(st.integers(1, len(line) - 2), min_size=1, max_size=9)):
            line[i] ^= data.draw(st.integers(1, 255))
    elif kind == 'cut':
        del line[at : at + data.draw(st.integers(1, 9))]
    elif kind == 'insert':
        line[at:at] = data.draw(st.binary(min_size=1, max_size=9))
    else:
        line[at], line[-at] = line[-at], line[at]
    receiver = decoder()
    received = receiver.feed(bytes(line) + b'\0')
    # What was drawn may have undone itself; then the packet is as it was sent.
    assert received == [] or cobs_decode(bytes(line).strip(b'\0')) == good
    reasons = ('broken', 'checksum', 'overlong')
    assert bool(received) != any(receiver.counts[reason] for reason in reasons)


@pytest.mark.parametrize('seed', range(20))
def test_of_a_line_damaged_all_over_only_sound_packets_are_taken_in_order(seed):
    rng = random.Random(seed)
    wanted = sent_by(*packets(60))
    line = bytearray(on_the_line(packets(60)))
    for _ in range(rng.randint(1, 60)):
        at = rng.randrange(len(line))
        kind = rng.randrange(4)
        if kind == 0:
            line[at] = rng.randrange(256)
        elif kind == 1:
            del line[at : at + rng.randint(1, 40)]
        elif kind == 2:
            line[at:at] = rng.randbytes(rng.randint(1, 20))
        else:
            again = rng.randrange(len(line))
            line[at:at] = line[again : again + rng.randint(1, 100)]
    receiver = decoder()
    places = [wanted.index(row) for row in integers(receiver.feed(bytes(line)))]
    assert places == sorted(set(places))
    assert receiver.counts['packets'] == len(places)
    assert receiver.counts['garbage_bytes'] > 0


@pytest.mark.parametrize('bit', range(8 * len(packets(1)[0])))
def test_every_flipped_bit_of_a_datagram_is_noticed(bit):
    packet = bytearray(packets(1)[0])
    packet[bit // 8] ^= 1 << bit % 8
    receiver = decoder()
    assert receiver.decode(bytes(packet)) is None
    assert receiver.counts['checksum'] == 1


@pytest.mark.parametrize('length', range(len(packets(1)[0])))
def test_every_truncated_datagram_is_noticed(length):
    receiver = decoder()
    assert receiver.decode(packets(1)[0][:length]) is None
    assert receiver.counts['checksum'] + receiver.counts['broken'] == 1
    assert receiver.counts['garbage_bytes'] == length


def with_checksum(header, data):
    packet = HEADER.pack(*header) + data
    return packet + CHECKSUM.pack(zlib.crc32(packet))


@pytest.mark.parametrize(
    ('packet', 'reason'),
    [
        (encode([[1, 2]], 'int16', 0, 0), 'channels'),
        (encode([[1, 2, 3, 4]], 'int16', 0, 0), 'channels'),
        (encode([[1, 2, 3]], 'uint16', 0, 0), 'kind'),
        (encode([[1, 2, 3]], 'int32', 0, 0), 'kind'),
        (with_checksum((0x22, 3, 1, 0, 0, 0), bytes(6)), 'kind'),
        (with_checksum((PACKET_KINDS['int16'], 3, 2, 0, 0, 0), bytes(6)), 'length'),
        (with_checksum((PACKET_KINDS['int16'], 3, 1, 0, 0, 0), bytes(7)), 'length'),
        (with_checksum((PACKET_KINDS['int16'], 3, 0, 0, 0, 0), b''), 'length'),
        (with_checksum((PACKET_KINDS['int16'], 3, 1400, 0, 0, 0), bytes(8400)), 'overlong'),
        (encode([[1, 2, 3], [4, 5, 6]], 'int16', 0, 0, 0), 'period'),
    ],
)
def test_a_sound_packet_of_another_make_is_dropped_and_counted(packet, reason):
    receiver = decoder()
    assert receiver.decode(packet) is None
    assert receiver.counts == {reason: 1, 'garbage_bytes': len(packet)}


def test_the_packet_after_a_broken_one_is_taken():
    line = on_the_line(packets(3))
    assert integers(decoder().feed(b'\x09\x01garbage\0' + line)) == sent_by(*packets(3))
    # A lost delimiter costs two packets, a line that hangs costs one.
    first = len(cobs_encode(packets(1)[0]))
    receiver = decoder()
    assert integers(receiver.feed(line[:first] + line[first + 1 :])) == sent_by(packets(3)[2])
    receiver = decoder()
    assert integers(receiver.feed(b'\xff' * 3 * LONGEST_BYTES + b'\0' + line)) == sent_by(
        *packets(3)
    )
    assert receiver.counts['overlong'] == 1
    assert receiver.counts['garbage_bytes'] == 3 * LONGEST_BYTES


def test_after_an_interruption_the_rest_of_a_packet_is_not_joined_to_another():
    line = on_the_line(packets(2))
    receiver = decoder()
    receiver.feed(line[:10])
    receiver.restart()
    assert receiver.counts['garbage_bytes'] == 10
    assert integers(receiver.feed(line)) == sent_by(*packets(2))


def test_half_an_hour_of_noise_holds_no_packet():
    rng = random.Random(1)
    receiver = decoder(channels=16)
    received = []
    size = 1 << 16
    for _ in range(0, HALF_AN_HOUR_BYTES, size):
        received += receiver.feed(rng.randbytes(size))
    received += receiver.feed(b'\0')
    assert received == []
    assert receiver.counts['garbage_bytes'] > 0.99 * HALF_AN_HOUR_BYTES  # All but the zeros.
    assert receiver.counts['broken'] + receiver.counts['checksum'] > 50_000


def test_half_an_hour_of_noise_in_datagrams_holds_no_packet():
    rng = random.Random(4)
    receiver = decoder(channels=16)
    came = 0
    while came < HALF_AN_HOUR_BYTES:
        noise = rng.randbytes(rng.randint(0, 3000))
        came += len(noise)
        assert receiver.decode(noise) is None
    assert receiver.counts['garbage_bytes'] == came


def test_a_packet_amid_noise_is_found():
    rng = random.Random(2)
    sent = packets(50)
    line = b''.join(rng.randbytes(300) + b'\0' + on_the_line([packet]) for packet in sent)
    assert integers(decoder().feed(line)) == sent_by(*sent)


@pytest.mark.parametrize(
    ('numbers', 'values', 'words'),
    [
        ([[40000]], 'int16', '40000 to 40000, allowed: -32768 to 32767 for int16'),
        ([[-1]], 'uint24', '-1 to -1, allowed: 0 to 16777215 for uint24'),
        ([1, 2], 'int16', r'shape \(2,\), allowed: \(n, 1 to 255\)'),
        (np.zeros((1, 256)), 'int16', r'shape \(1, 256\)'),
        (np.zeros((0, 4)), 'int16', r'shape \(0, 4\)'),
        (np.zeros((3000, 4)), 'int16', '3000 rows, allowed: a packet of 8192 bytes'),
    ],
)
def test_what_has_no_room_is_not_sent(numbers, values, words):
    with pytest.raises(ValueError, match=words):
        encode(numbers, values, 0, 0)


def test_counts_are_of_one_decoder():
    one, other = decoder(), decoder()
    one.decode(b'')
    assert one.counts == Counter(broken=1, garbage_bytes=0)
    assert other.counts == Counter()


def test_a_packet_that_lasts_longer_than_a_minute_is_dropped():
    receiver = decoder(channels=1)
    assert receiver.decode(encode(np.ones((61, 1)), 'int16', 0, 0, 1_000_000_001)) is None
    assert receiver.counts['period'] == 1
    assert receiver.decode(encode(np.ones((61, 1)), 'int16', 1, 0, 1_000_000_000)) is not None
