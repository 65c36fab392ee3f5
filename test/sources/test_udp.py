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

"""The UDP source at a real socket."""

import socket

import numpy as np
import pytest

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from slip_detector.sources import udp as udp_source
from slip_detector.sources.packets import LONGEST_BYTES
from slip_detector.sources.udp import SENDER_SILENT_S
from support.sensors import SCALE_V, Sender, free_udp_port, make_packets

INTEGERS = np.random.default_rng(4).integers(-30000, 30000, (60, 4))
PACKETS = make_packets(INTEGERS, 1000.0)


class Heard:
    """A source, and senders that it hears from; a datagram is read when it is sent."""

    def __init__(self, **parameters):
        port = free_udp_port()
        config = DriverConfig(source='udp', udp_port=port, channels=4, **parameters)
        self.source = open_source(config)
        self.source.start()
        self.port = port
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


@pytest.mark.parametrize('samples', [1, 7])
def test_datagrams_arrive_complete_and_in_order(heard, samples):
    assert heard.source.state == f'listening on 127.0.0.1 port {heard.port}'
    rows = heard.rows(heard.sender(), *make_packets(INTEGERS, 1000.0, samples))
    np.testing.assert_array_equal(rows, SCALE_V * INTEGERS)


def test_without_datagrams_there_is_nothing(heard):
    assert not len(heard.source.read(1).volts)


def test_gaps_duplicates_and_reordering_are_noticed(heard):
    order = [0, 1, 3, 2, 3, 4, 8, 9]
    rows = heard.rows(heard.sender(), *(PACKETS[k] for k in order))
    np.testing.assert_array_equal(rows, SCALE_V * INTEGERS[[0, 1, 3, 4, 8, 9]])
    counts = heard.source.counts
    assert (counts['late'], counts['duplicate'], counts['lost']) == (1, 1, 4)


def test_datagrams_that_are_no_packets_are_counted(heard):
    sender = heard.sender()
    heard.rows(sender, PACKETS[0])
    broken = PACKETS[1][:-1] + bytes([PACKETS[1][-1] ^ 1])
    empty, long = b'', bytes(LONGEST_BYTES + 500)
    assert not heard.rows(sender, empty, broken, PACKETS[1][:20], PACKETS[1] + b'\0', long).size
    counts = heard.source.counts
    assert (counts['broken'], counts['checksum'], counts['overlong']) == (1, 3, 1)
    np.testing.assert_array_equal(heard.rows(sender, PACKETS[1]), SCALE_V * INTEGERS[1:2])


def test_only_senders_that_are_listed_are_heard():
    heard = Heard(udp_senders=('127.0.0.3', '127.0.0.1'))
    assert not heard.rows(heard.sender('127.0.0.2'), *PACKETS[:3]).size
    assert heard.source.counts['unlisted_sender'] == 3
    assert len(heard.rows(heard.sender('127.0.0.3'), *PACKETS[:3])) == 3
    heard.close()


def test_two_sensors_are_not_taken_for_one(heard, monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr(udp_source.time, 'monotonic', lambda: now_s[0])
    one, other = heard.sender(), heard.sender()
    assert len(heard.rows(one, *PACKETS[:3])) == 3
    assert len(heard.rows(other, *PACKETS[10:13])) == 0
    assert heard.source.counts['other_sender'] == 3
    now_s[0] += SENDER_SILENT_S
    # What is no packet takes nobody's place, and does not make a duplicate fresh.
    assert len(heard.rows(other, b'noise')) == 0
    assert len(heard.rows(one, PACKETS[2])) == 0
    assert heard.source.counts['duplicate'] == 1
    # The other one may begin where it likes, once the first is silent.
    np.testing.assert_array_equal(heard.rows(other, PACKETS[0]), SCALE_V * INTEGERS[:1])
    assert len(heard.rows(one, PACKETS[3])) == 0


def test_it_listens_to_this_machine_alone_unless_told_otherwise():
    assert DriverConfig().udp_bind_address == '127.0.0.1'
    assert DriverConfig().udp_senders == ('127.0.0.1',)


def test_addresses_of_version_6_serve_as_well():
    if not socket.has_ipv6:
        pytest.skip('no IPv6')
    port = free_udp_port()
    config = DriverConfig(
        source='udp', udp_port=port, channels=4, udp_bind_address='::1', udp_senders=('0:0::1',)
    )
    try:
        source = open_source(config)
        source.start()
    except ValueError as error:
        pytest.skip(f'no IPv6: {error}')
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as sender:
        sender.sendto(PACKETS[0], ('::1', port))
        samples = source.read(1)
    np.testing.assert_array_equal(samples.volts, SCALE_V * INTEGERS[:1])
    source.close()


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'udp_senders': ()}, 'parameter udp_senders is empty, allowed: at least one address'),
        ({'udp_senders': ('hand',)}, "parameter udp_senders has 'hand', allowed: addresses as"),
        ({'udp_bind_address': ''}, "parameter udp_bind_address has '', allowed: addresses as"),
        (
            {'udp_bind_address': '192.0.2.1'},
            r'parameter udp_port is 47380: cannot be listened on at 192\.0\.2\.1 \(Cannot assign',
        ),
    ],
)
def test_wrong_addresses_are_named(parameters, message):
    with pytest.raises(ValueError, match=message):
        open_source(DriverConfig(source='udp', **parameters)).start()


def test_a_port_in_use_is_named(heard):
    with pytest.raises(ValueError, match=r'udp_port is .*Address already in use.*a free port'):
        open_source(DriverConfig(source='udp', udp_port=heard.port)).start()
