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

"""Live sources at a real pseudo terminal and at a real socket."""

import time

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import live, open_source
from slip_detector.sources.live import SENDER_SILENT_S
from support.reference_packets import on_the_line
from support.sensors import SCALE_V, Sender, free_udp_port, make_packets

DEADLINE_S = 60.0

INTEGERS = np.random.default_rng(4).integers(-30000, 30000, (60, 4))
PACKETS = make_packets(INTEGERS, 1000.0)


def source_at(path, **parameters):
    config = DriverConfig(source='serial', serial_port=str(path), channels=4, **parameters)
    source = open_source(config)
    source.start()
    return source


def read_until(source, condition, what):
    """Read until the condition holds, given all samples so far; returns them."""
    samples = Samples(np.empty((0, 4)), np.empty(0, np.int64))
    deadline = time.monotonic() + DEADLINE_S
    while not condition(samples):
        assert time.monotonic() < deadline, f'waited in vain for {what}: {source.state}'
        samples = samples.then(source.read(1))
    return samples


def read_rows(source, n):
    return read_until(source, lambda samples: len(samples.volts) >= n, f'{n} rows').volts


def test_a_port_that_is_pulled_out_is_found_again(port):
    source = source_at(port.path)
    assert source.connected
    assert source.state == f'listening to {port.path} at 115200 baud'
    packets = [*map(on_the_line, PACKETS)]
    port.send(b''.join(packets[:20]) + packets[20][:9])
    before = read_rows(source, 20)
    port.unplug()
    read_until(source, lambda _: not source.connected, 'the loss')
    assert source.state.startswith(f'{port.path}: cannot be read (')
    assert source.state.endswith('), trying again')
    port.plug_in()
    read_until(source, lambda _: source.connected, 'the port')
    # Numbering and clock begin again: it was another sensor, or one without power.
    port.send(b''.join(packets[:20]))
    after = read_rows(source, 20)
    np.testing.assert_array_equal(before, SCALE_V * INTEGERS[:20])
    np.testing.assert_array_equal(after, before)
    assert source.counts['lost'] == source.counts['late'] == source.counts['restarts'] == 0
    assert source.counts['garbage_bytes'] == 9
    source.close()


def test_a_port_that_another_driver_reads_is_left_to_it(port):
    one, other = source_at(port.path), source_at(port.path)
    assert one.connected
    assert not other.connected
    assert 'cannot be read' in other.state
    one.close()
    read_until(other, lambda _: other.connected, 'the port')
    other.close()


# --- datagrams ---------------------------------------------------------------------------------


class Heard:
    """A source, and senders that it hears from; a datagram is read when it is sent."""

    def __init__(self):
        self.port, listed = free_udp_port(), ('127.0.0.3', '127.0.0.1')
        config = DriverConfig(source='udp', udp_port=self.port, channels=4, udp_senders=listed)
        self.source = open_source(config)
        self.source.start()
        self._senders = []

    def sender(self, address='127.0.0.1'):
        self._senders.append(Sender(self.port, address))
        return self._senders[-1]

    def rows(self, sender, *packets):
        """Send packets and return the rows that come of them."""
        rows = [np.empty((0, 4))]
        for packet in packets:
            sender.send(packet)
            rows.append(self.source.read(1).volts)
        return np.concatenate(rows)

    def close(self):
        self.source.close()
        for sender in self._senders:
            sender.close()


@pytest.fixture
def heard():
    heard = Heard()
    yield heard
    heard.close()


def test_only_senders_that_are_listed_are_heard(heard):
    assert not heard.rows(heard.sender('127.0.0.2'), *PACKETS[:3]).size
    assert heard.source.counts['unlisted_sender'] == 3
    assert len(heard.rows(heard.sender('127.0.0.3'), *PACKETS[:3])) == 3


def test_two_sensors_are_not_taken_for_one(heard, monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr(live.time, 'monotonic', lambda: now_s[0])
    assert heard.source.state == f'listening on 127.0.0.1 port {heard.port}'
    one, other = heard.sender(), heard.sender()
    np.testing.assert_array_equal(heard.rows(one, *PACKETS[:3]), SCALE_V * INTEGERS[:3])
    assert len(heard.rows(other, *PACKETS[10:13])) == 0
    assert heard.source.counts['other_sender'] == 3
    now_s[0] += SENDER_SILENT_S
    # What is no packet takes nobody's place, and does not make a duplicate fresh.
    assert len(heard.rows(other, b'noise')) == 0
    assert len(heard.rows(one, PACKETS[2])) == 0
    assert heard.source.counts['late'] == 1
    # The other one may begin where it likes, once the first is silent.
    np.testing.assert_array_equal(heard.rows(other, PACKETS[0]), SCALE_V * INTEGERS[:1])
    assert len(heard.rows(one, PACKETS[3])) == 0


def test_a_port_in_use_is_named(heard):
    with pytest.raises(ValueError, match=r'udp_port is .*Address already in use.*a free port'):
        open_source(DriverConfig(source='udp', udp_port=heard.port)).start()


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'source': 'serial'}, "parameter serial_port is '', allowed: a port, as source"),
        ({'udp_senders': ()}, 'parameter udp_senders is empty, allowed: at least one address'),
        ({'udp_senders': ('hand',)}, "^parameters udp_senders, .*: 'hand' .* IPv4"),
        ({'udp_bind_address': '192.0.2.1'}, r'listened on at 192\.0\.2\.1 \(Cannot assign'),
    ],
)
def test_a_line_that_cannot_be_listened_on_is_an_error_that_says_why(parameters, message):
    with pytest.raises(ValueError, match=message):
        open_source(DriverConfig(**{'source': 'udp', **parameters})).start()
