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

"""The driver node at real ports: serial and UDP, sound and broken streams, unplugged and back.

What the decoders drop and count is tested in ``test/sources``.
"""

import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray

from slip_detector.nodes.driver import NO_FAULTS
from slip_detector.nodes.health import ERROR, OK, WARN
from slip_detector.nodes.messages import stamp_ns, state_qos
from slip_detector.sources.packets import PacketDecoder
from support.harness import ended_quietly, reliable_qos
from support.reference_packets import on_the_line
from support.sensors import SCALE_V, Sender, free_udp_port, make_packets, sending, vibration

RATE_HZ = 380.0


@pytest.fixture
def listening(bench, port):
    """Return what starts a driver that listens: its process, its messages, what sends to it."""

    def start(source='serial', kind=JointState, others=0, **parameters):
        number = free_udp_port()
        where = {'serial_port': port.path} if source == 'serial' else {'udp_port': number}
        voltages = bench.listen(kind, 'voltages', reliable_qos())
        given = {'source': source, **where, **parameters}
        process = bench.start_driver(parameters=given, others=others)
        bench.wait_for(lambda: 'listening' in process.log(), 'the driver to listen')
        return process, voltages, port.send if source == 'serial' else Sender(number).send

    return start


def spoilt(packet):
    """Return a packet with another byte in it."""
    return packet[:9] + bytes([packet[9] % 255 + 1]) + packet[10:]


@pytest.mark.parametrize('source', ['serial', 'udp'])
def test_a_spoilt_stream_gives_the_sound_samples_and_counts_the_rest(bench, listening, source):
    process, voltages, send = listening(source)
    integers = np.random.default_rng(9).integers(-32768, 32768, (200, 16))
    pieces = []
    for k, packet in enumerate(make_packets(integers, RATE_HZ)):
        pieces += [[packet], [packet] * 2, [spoilt(packet)], [packet[:20]], [b'noise', packet]][
            k % 5
        ]
    decoder = PacketDecoder(16, 'int16', SCALE_V, 0.0)
    if source == 'serial':
        pieces = [*map(on_the_line, pieces)]
    decode = decoder.feed if source == 'serial' else decoder.decode
    received = [samples for piece in pieces for samples in decode(piece)]
    wanted = [f'{kind} {n}' for kind, n in decoder.counts.items() if n and kind not in NO_FAULTS]
    assert len(wanted) > 2

    def counted():
        last = process.log().rpartition('counted so far: ')[2].splitlines()[0].split(', ')
        return set(wanted) <= set(last)

    with sending(send, pieces, RATE_HZ):
        bench.wait_for(lambda: len(voltages) >= len(received), 'the samples')
        bench.wait_for(counted, f'{wanted} to be counted')
    rows = np.array([message.position for message in voltages])
    np.testing.assert_array_equal(rows, np.concatenate([each.volts for each in received]))


def test_a_sensor_that_is_pulled_out_takes_slip_valid_along_and_brings_it_back(
    bench, port, listening
):
    pieces = [*map(on_the_line, make_packets(vibration(100_000, RATE_HZ), RATE_HZ))]
    slip = bench.listen(Bool, 'slip', state_qos(depth=1000))
    valid = bench.listen(Bool, 'slip_valid', state_qos(depth=1000))
    bench.start('slip_detector')
    process, voltages, send = listening(others=1)

    def slips():
        return bool(valid and slip and valid[-1].data and slip[-1].data)

    with sending(send, pieces, RATE_HZ):
        bench.wait_for(slips, 'slip')
        port.unplug()
        bench.wait_for(lambda: not valid[-1].data and not slip[-1].data, 'slip_valid to fall')
    bench.wait_for(lambda: 'cannot be read' in process.log(), 'the log')
    port.plug_in()
    bench.wait_for(lambda: process.log().count('listening to') == 2, 'the port')
    # The sensor was without power: it counts from 0 again.
    with sending(send, pieces, RATE_HZ):
        bench.wait_for(slips, 'slip after it was plugged in')
    assert np.all(np.diff([stamp_ns(message.header.stamp) for message in voltages]) > 0)


def test_what_waits_for_its_batch_is_sent_when_the_sensor_goes(bench, port, listening):
    _, batches, send = listening(kind=Float32MultiArray, samples_per_message=10)
    for packet in make_packets(vibration(14, RATE_HZ), RATE_HZ):
        send(on_the_line(packet))
    bench.wait_for(lambda: batches, 'the first batch')
    # Its last packet may still be on its way.
    bench.wait_for(port.is_read, 'the rest to be read')
    port.unplug()
    bench.wait_for(lambda: len(batches) == 2, 'the rest')
    assert [batch.layout.dim[0].size for batch in batches] == [10, 4]


def test_diagnostics_tell_of_a_sensor_that_sends_spoilt_packets_stops_and_is_gone(
    bench, port, listening
):
    _, _, send = listening()
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
    packets = make_packets(vibration(20_000, RATE_HZ), RATE_HZ)
    with sending(send, map(on_the_line, packets), RATE_HZ):
        told(OK, 'listening to')
    # Every other one: a second in which no sample comes at all is worse than a warning.
    packets[10_001::2] = map(spoilt, packets[10_001::2])
    with sending(send, map(on_the_line, packets[10_000:]), RATE_HZ):
        told(WARN, 'dropped or lost in the last second: ')
    port.unplug()
    told(ERROR, 'cannot be read')
    (status,) = heard[-1].status
    assert status.name == 'slip_driver: sensor'
    assert status.hardware_id == 'fingertip'
    values = {pair.key: int(pair.value) for pair in status.values}
    assert values['samples'] == values['packets'] > 0


@pytest.mark.parametrize(('number', 'there'), [(signal.SIGINT, True), (signal.SIGTERM, False)])
def test_signals_end_a_driver_that_listens_cleanly(bench, port, number, there):
    path = port.path if there else f'{port.path}_not_there'
    process = bench.start('slip_driver', parameters={'source': 'serial', 'serial_port': path})
    bench.wait_for(lambda: str(path) in process.log(), 'the driver to look for the port')
    with ended_quietly(process, number):
        pass
