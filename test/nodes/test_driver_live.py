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

"""The driver node at real ports: serial and UDP, sound and broken streams, unplugged and back."""

import random
import signal
from collections import Counter

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray

from slip_detector.nodes.driver import GOOD
from slip_detector.nodes.health import ERROR, OK, WARN
from slip_detector.nodes.messages import stamp_ns, state_qos
from slip_detector.sources.packets import PacketDecoder
from support import reference_packets
from support.harness import ended_quietly, reliable_qos
from support.reference_packets import on_the_line
from support.sensors import SCALE_V, Sender, free_udp_port, make_packets, sending, vibration

RATE_HZ = 1000.0

#: Three seconds of a sensor at 1 kHz with 16 channels.
INTEGERS = np.random.default_rng(9).integers(-32768, 32768, (3000, 16))

#: What 115200 baud bring in half an hour, ten bits a byte; here as fast as the driver takes it.
NOISE_BYTES = 1800 * 11520
NOISE_PIECE = 1 << 14


class Listening:
    """A driver process that listens to a sensor, and all that it publishes."""

    def __init__(self, bench, parameters, others=0):
        self.bench = bench
        self.voltages = bench.listen(JointState, 'voltages', reliable_qos())
        self.process = bench.start_driver(parameters=parameters, others=others)
        bench.wait_for(lambda: 'listening' in self.process.log(), 'the driver to listen')

    @classmethod
    def to_port(cls, bench, port, others=0, **parameters):
        given = {'source': 'serial', 'serial_port': port.path, **parameters}
        listening = cls(bench, given, others)
        return listening, port.send

    @classmethod
    def to_udp(cls, bench, **parameters):
        number = free_udp_port()
        listening = cls(bench, {'source': 'udp', 'udp_port': number, **parameters})
        return listening, Sender(number).send

    def wait_for(self, samples):
        self.bench.wait_for(lambda: len(self.voltages) >= samples, f'{samples} samples')

    def rows(self):
        return np.array([message.position for message in self.voltages])

    def stamps_ns(self):
        return np.array([stamp_ns(message.header.stamp) for message in self.voltages])

    def counted(self):
        """Return what the driver said last of what it dropped or lost."""
        lines = [line for line in self.process.log().splitlines() if 'counted so far: ' in line]
        words = lines[-1].partition('counted so far: ')[2] if lines else ''
        counts = (word.split(' ') for word in words.split(', ') if word)
        return Counter({kind: int(n) for kind, n in counts if kind not in GOOD})

    def wait_for_counts(self, wanted):
        wanted = Counter({kind: n for kind, n in wanted.items() if n and kind not in GOOD})
        self.bench.wait_for(lambda: self.counted() == wanted, f'{wanted} to be counted')


def noise(rng):
    """Return half an hour of random bytes."""
    return [rng.randbytes(NOISE_PIECE) for _ in range(0, NOISE_BYTES, NOISE_PIECE)]


def spoilt_packets(rng):
    """Return packets as they should not come: sound ones among all kinds of others."""
    sound = make_packets(INTEGERS[:400], RATE_HZ)
    came = []
    for k, packet in enumerate(sound):
        came.append(packet)
        fault = k % 8
        if fault == 1:
            came.append(packet)
        elif fault == 2:
            came.append(sound[k - rng.randint(1, 100) % (k + 1)])
        elif fault == 3:
            flipped = bytearray(packet)
            flipped[rng.randrange(len(packet))] ^= 1 << rng.randrange(8)
            came.append(bytes(flipped))
        elif fault == 4:
            came.append(packet[: rng.randrange(len(packet))])
        elif fault == 5:
            came.append(
                reference_packets.packet(
                    INTEGERS[:1, : rng.choice([1, 15])], 'int16', k + 1, 1000 * k
                )
            )
        elif fault == 6:
            came.append(reference_packets.packet(INTEGERS[:1], 'int32', k + 1, 1000 * k))
        elif fault == 7:
            came.append(rng.randbytes(rng.randint(1, 300)))
    # Some are overtaken by the next one, some are lost.
    for k in range(50, len(came), 50):
        came[k], came[k + 1] = came[k + 1], came[k]
    del came[60:1000:60]
    return came


def test_a_spoilt_serial_stream_gives_the_sound_samples_and_counts_the_rest(bench, port):
    listening, send = Listening.to_port(bench, port)
    rng = random.Random(5)
    packets = spoilt_packets(rng)
    pieces = [on_the_line(packet) for packet in packets]
    for k in range(5, len(pieces), 20):
        # Bytes lost on the way, and noise, which may swallow the packet after it.
        pieces[k] = pieces[k][: rng.randrange(len(pieces[k]))]
        pieces[k + 1] = rng.randbytes(40) + pieces[k + 1]
    pieces += noise(rng)
    pieces += [b'\0', on_the_line(make_packets(INTEGERS[400:401], RATE_HZ, first=400)[0])]
    decoder = PacketDecoder(16, 'int16', SCALE_V, 0.0)
    received = [decoder.feed(piece) for piece in pieces]
    check_spoilt(listening, send, pieces, received, decoder.counts)


def test_a_spoilt_udp_stream_gives_the_sound_samples_and_counts_the_rest(bench):
    listening, send = Listening.to_udp(bench)
    rng = random.Random(6)
    pieces = spoilt_packets(rng)
    for k, packet in enumerate(make_packets(INTEGERS[:800], RATE_HZ)[400:]):
        pieces += [rng.randbytes(rng.randint(0, 200)) for _ in range(k % 5)] + [packet]
    decoder = PacketDecoder(16, 'int16', SCALE_V, 0.0)
    received = [[samples] if samples else [] for samples in map(decoder.decode, pieces)]
    check_spoilt(listening, send, pieces, received, decoder.counts)


def check_spoilt(listening, send, pieces, received, counts):
    """Send pieces of ``INTEGERS`` and check that what comes of them was sent, in its order."""
    rows = pass_on(listening, send, pieces, received, counts)
    sent = {tuple(row): k for k, row in enumerate((SCALE_V * INTEGERS).tolist())}
    places = [sent[tuple(row)] for row in rows.tolist()]
    assert places == sorted(set(places))
    assert len(places) > 200
    assert min(counts[fault] for fault in ('checksum', 'channels', 'kind', 'late')) > 20
    assert min(counts[fault] for fault in ('lost', 'broken')) > 5


def pass_on(listening, send, pieces, received, counts):
    """Send pieces; the node is to make of them what a decoder in the test does, and live on.

    ``received`` is what comes of each piece.
    """
    wanted = np.concatenate([samples.volts for of_piece in received for samples in of_piece])
    due = np.cumsum([0, *(len(of_piece) for of_piece in received)])
    with sending(send, pieces, 2000.0, listening.voltages, due):
        listening.wait_for(len(wanted))
        listening.wait_for_counts(counts)
    np.testing.assert_array_equal(listening.rows(), wanted)
    with ended_quietly(listening.process):
        pass
    return wanted


def test_datagrams_of_unlisted_senders_are_counted_and_not_taken(bench):
    number = free_udp_port()
    listening = Listening(bench, {'source': 'udp', 'udp_port': number})
    packets = make_packets(INTEGERS[:20], RATE_HZ)
    stranger, known = Sender(number, '127.0.0.2'), Sender(number)
    for mine, theirs in zip(packets[:10], packets[10:], strict=True):
        known.send(mine)
        stranger.send(theirs)
    listening.wait_for(10)
    listening.wait_for_counts({'unlisted_sender': 10})
    np.testing.assert_array_equal(listening.rows(), SCALE_V * INTEGERS[:10])


def test_a_sensor_that_is_pulled_out_takes_slip_valid_along_and_brings_it_back(bench, port):
    rate_hz = 380.0
    rows = vibration(100_000, rate_hz)
    pieces = [on_the_line(packet) for packet in make_packets(rows, rate_hz)]
    slip = bench.listen(Bool, 'slip', state_qos(depth=1000))
    valid = bench.listen(Bool, 'slip_valid', state_qos(depth=1000))
    bench.start('slip_detector')
    listening, send = Listening.to_port(bench, port, others=1)

    def slips():
        return bool(valid and slip and valid[-1].data and slip[-1].data)

    with sending(send, pieces, rate_hz):
        bench.wait_for(slips, 'slip')
        port.unplug()
        bench.wait_for(lambda: not valid[-1].data and not slip[-1].data, 'slip_valid to fall')
    bench.wait_for(lambda: 'cannot be read' in listening.process.log(), 'the log')
    port.plug_in()
    bench.wait_for(lambda: listening.process.log().count('listening to') == 2, 'the port')
    # The sensor was without power: it counts from 0 again.
    with sending(send, pieces, rate_hz):
        bench.wait_for(slips, 'slip after it was plugged in')
    assert np.all(np.diff(listening.stamps_ns()) > 0)


def test_what_waits_for_its_batch_is_sent_when_the_sensor_goes(bench, port):
    batches = bench.listen(Float32MultiArray, 'voltages', reliable_qos())
    given = {'source': 'serial', 'serial_port': port.path, 'samples_per_message': 10}
    driver = bench.start_driver(parameters=given)
    bench.wait_for(lambda: 'listening' in driver.log(), 'the driver to listen')
    rows = vibration(14, 380.0)
    for packet in make_packets(rows, 380.0):
        port.send(on_the_line(packet))
    bench.wait_for(lambda: batches, 'the first batch')
    # Its last packet may still be on its way.
    bench.wait_for(port.is_read, 'the rest to be read')
    port.unplug()
    bench.wait_for(lambda: len(batches) == 2, 'the rest')
    assert [batch.layout.dim[0].size for batch in batches] == [10, 4]


def test_diagnostics_tell_of_a_sensor_that_sends_spoilt_packets_stops_and_is_gone(bench, port):
    _, send = Listening.to_port(bench, port)
    heard = bench.listen(DiagnosticArray, '/diagnostics', 10)

    def told(level, words):
        def said():
            return any(
                status.level == level and words in status.message
                for array in heard
                for status in array.status
            )

        bench.wait_for(said, f'{words!r} on /diagnostics')

    told(ERROR, 'no samples come; listening to')
    packets = [on_the_line(packet) for packet in make_packets(vibration(20_000, 380.0), 380.0)]
    with sending(send, packets, 380.0):
        told(OK, 'listening to')
    # Every other one: a second in which no sample comes at all is worse than a warning.
    half_spoilt = [
        packet[:9] + bytes([packet[9] % 255 + 1]) + packet[10:] if i % 2 else packet
        for i, packet in enumerate(packets[10_000:])
    ]
    with sending(send, half_spoilt, 380.0):
        told(WARN, 'dropped or lost in the last second: ')
    port.unplug()
    told(ERROR, 'cannot be read')
    (status,) = heard[-1].status
    assert status.name == 'slip_driver: sensor'
    assert status.hardware_id == 'fingertip'
    values = {pair.key: int(pair.value) for pair in status.values}
    assert values['samples'] == values['packets'] > 0
    assert values['garbage_bytes'] > 0


def test_a_sensor_that_was_reset_is_heard_again(bench):
    listening, send = Listening.to_udp(bench)
    packets = make_packets(INTEGERS[:1000], RATE_HZ)
    with sending(send, packets[500:] + packets, RATE_HZ, listening.voltages):
        listening.wait_for(1500)
    rows = listening.rows()
    np.testing.assert_array_equal(rows[:500], SCALE_V * INTEGERS[500:1000])
    np.testing.assert_array_equal(rows[500:], SCALE_V * INTEGERS[:1000])
    listening.wait_for_counts({'restarts': 1})
    assert np.all(np.diff(listening.stamps_ns()) > 0)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('there', [True, False])
def test_signals_end_a_driver_that_listens_cleanly(bench, port, number, there):
    path = port.path if there else f'{port.path}_not_there'
    process = bench.start('slip_driver', parameters={'source': 'serial', 'serial_port': path})
    bench.wait_for(lambda: str(path) in process.log(), 'the driver to look for the port')
    with ended_quietly(process, number):
        pass
