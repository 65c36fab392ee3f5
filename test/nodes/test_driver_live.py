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

"""The driver node at a real port: sound and broken streams, unplugged and back.

What the decoders drop and count, and datagrams, are tested in ``test/sources``.
"""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray

from slip_detector.nodes.health import ERROR, OK, WARN
from slip_detector.nodes.messages import stamp_ns
from support.harness import reliable_qos
from support.reference_packets import on_the_line
from support.sensors import SCALE_V, make_packets, sending, vibration

RATE_HZ = 380.0


@pytest.fixture
def listening(bench, port):
    """Return what starts a driver that listens; it returns its process and its messages."""

    def start(kind=JointState, **parameters):
        voltages = bench.listen(kind, 'voltages', reliable_qos())
        given = {'source': 'serial', 'serial_port': port.path, **parameters}
        process = bench.start_driver(parameters=given)
        bench.wait_for(lambda: 'listening' in process.log(), 'the driver to listen')
        return process, voltages

    return start


def samples_of(array):
    """Return how many samples a driver says on ``/diagnostics`` that it has read."""
    (status,) = array.status
    return int({pair.key: pair.value for pair in status.values}.get('samples', 0))


def spoilt(packet):
    """Return a packet with another byte in it."""
    return packet[:9] + bytes([packet[9] % 255 + 1]) + packet[10:]


def test_what_waits_for_its_batch_is_sent_when_the_sensor_goes(bench, port, listening):
    _, batches = listening(Float32MultiArray, samples_per_message=10)
    heard = bench.listen(DiagnosticArray, '/diagnostics', 10)
    for packet in make_packets(vibration(14, RATE_HZ), RATE_HZ):
        port.send(on_the_line(packet))
    # What is still on the line when the sensor goes is lost, so the driver has to have it all.
    bench.wait_for(lambda: any(samples_of(array) == 14 for array in heard), 'all to be read')
    port.unplug()
    bench.wait_for(lambda: len(batches) == 2, 'the rest')
    assert [batch.layout.dim[0].size for batch in batches] == [10, 4]


def test_samples_are_published_and_faults_told_of_a_sensor_that_is_pulled_out_and_comes_back(
    bench, port, listening
):
    process, voltages = listening()
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
    integers = np.random.default_rng(9).integers(-32768, 32768, (20_000, 16))
    packets = make_packets(integers, RATE_HZ)
    with sending(port.send, map(on_the_line, packets), RATE_HZ):
        told(OK, 'listening to')
    # Every other one: a second in which no sample comes at all is worse than a warning.
    packets[10_001::2] = map(spoilt, packets[10_001::2])
    with sending(port.send, map(on_the_line, packets[10_000:]), RATE_HZ):
        told(WARN, 'dropped or lost in the last second: ')
    assert 'counted so far: ' in process.log()
    port.unplug()
    told(ERROR, 'cannot be read')
    (status,) = heard[-1].status
    assert status.name == 'slip_driver: sensor'
    assert status.hardware_id == 'fingertip'
    values = {pair.key: int(pair.value) for pair in status.values}
    assert values['samples'] == values['packets'] > 0
    bench.wait_for(lambda: len(voltages) == values['samples'], 'the samples')
    rows = np.array([message.position for message in voltages])
    sound_v = SCALE_V * integers
    first = int(np.flatnonzero((rows == sound_v[10_000]).all(axis=1))[0])
    np.testing.assert_array_equal(rows[:first], sound_v[:first])
    np.testing.assert_array_equal(rows[first:], sound_v[10_000::2][: len(rows) - first])
    port.plug_in()
    bench.wait_for(lambda: process.log().count('listening to') == 2, 'the port')
    # The sensor was without power: it counts from 0 again.
    with sending(port.send, map(on_the_line, packets), RATE_HZ):
        bench.wait_for(lambda: len(voltages) > len(rows) + 100, 'samples again')
    assert np.all(np.diff([stamp_ns(message.header.stamp) for message in voltages]) > 0)
