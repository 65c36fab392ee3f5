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

"""The serial source at a real pseudo terminal."""

import errno
import itertools
import time

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from slip_detector.sources import serial_port as serial_source
from slip_detector.sources.serial_port import RETRY_LAST_S, SerialSource
from support.sensors import SCALE_V, Port, make_packets, on_the_line

DEADLINE_S = 60.0

INTEGERS = np.random.default_rng(4).integers(-30000, 30000, (60, 4))


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


@pytest.mark.parametrize('samples', [1, 7])
def test_packets_arrive_complete_and_in_order(port, samples):
    source = source_at(port.path)
    assert source.connected
    assert source.state == f'listening to {port.path} at 115200 baud'
    for packet in make_packets(INTEGERS, 1000.0, samples):
        port.send(on_the_line(packet))
    np.testing.assert_array_equal(read_rows(source, 60), SCALE_V * INTEGERS)
    source.close()


def test_scale_and_offset_make_volts(port):
    source = source_at(port.path, packet_scale_v=-0.5, packet_offset_v=2.25)
    port.send(on_the_line(make_packets(INTEGERS[:1], 1000.0)[0]))
    np.testing.assert_array_equal(read_rows(source, 1), 2.25 - 0.5 * INTEGERS[:1])
    source.close()


def test_lines_of_text_arrive_after_the_first(port):
    source = source_at(port.path, serial_format='text', text_rate_hz=500.0)
    port.send(b'3,4\n')
    for row in INTEGERS[:5]:
        port.send((','.join(map(str, row)) + '\r\n').encode())
    samples = read_until(source, lambda some: len(some.volts) >= 5, 'five lines')
    np.testing.assert_array_equal(samples.volts, INTEGERS[:5])
    # All at once here; the sensor took them one each period.
    steps = np.diff(samples.stamps_ns)
    assert np.all(np.abs(steps - 2_000_000) <= 200_002)
    source.close()


def test_without_a_rate_lines_are_stamped_when_they_arrive(port):
    source = source_at(port.path, serial_format='text')
    before_ns = time.time_ns()
    port.send(b'\n1,2,3,4\n')
    samples = read_until(source, lambda some: len(some.volts), 'a line')
    assert before_ns <= samples.stamps_ns[0] <= time.time_ns()
    source.close()


def test_a_port_that_is_pulled_out_is_found_again(port):
    source = source_at(port.path)
    packets = [on_the_line(packet) for packet in make_packets(INTEGERS, 1000.0)]
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


def test_a_port_that_is_not_there_yet_is_waited_for(tmp_path):
    path = tmp_path / 'later'
    source = source_at(path)
    assert not source.connected
    assert 'No such file or directory' in source.state
    assert not len(source.read(1).volts)
    port = Port(path)
    read_until(source, lambda _: source.connected, 'the port')
    source.close()
    port.unplug()


def test_a_port_that_stays_away_is_looked_for_ever_more_rarely(tmp_path, monkeypatch):
    now_s, tried_s = [0.0], []

    class Clock:
        @staticmethod
        def monotonic():
            return now_s[0]

        @staticmethod
        def sleep(seconds):
            assert 0.0 < seconds <= 0.1
            now_s[0] += seconds

    class LooseContact:
        in_waiting = 1

        def __init__(self):
            self._left = [b'one byte']

        def read(self, _):
            if not self._left:
                raise OSError(errno.EIO, 'gone again')
            return self._left.pop()

        def close(self):
            pass

    def there_once(*_, **__):
        tried_s.append(now_s[0])
        if len(tried_s) == 9:
            return LooseContact()
        raise OSError(errno.ENOENT, 'no such port')

    monkeypatch.setattr(serial_source, 'time', Clock)
    monkeypatch.setattr(serial_source.serial, 'Serial', there_once)
    source = source_at(tmp_path / 'nothing')
    while len(tried_s) < 12:
        source.read(1)
    steps_s = [later - earlier for earlier, later in itertools.pairwise(tried_s)]
    assert steps_s[:5] == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.6])
    assert steps_s[5:8] == pytest.approx([RETRY_LAST_S] * 3)
    # Once it gave something it is soon looked for again.
    assert steps_s[8:] == pytest.approx([0.1, 0.2, 0.4])


def test_a_port_that_another_driver_reads_is_left_to_it(port):
    one, other = source_at(port.path), source_at(port.path)
    assert one.connected
    assert not other.connected
    assert 'cannot be read' in other.state
    one.close()
    read_until(other, lambda _: other.connected, 'the port')
    other.close()


def test_an_idle_port_gives_nothing_and_stays(port):
    source = source_at(port.path)
    assert not len(source.read(1).volts)
    assert source.connected
    source.close()


def test_what_was_sent_before_the_opening_is_old(port):
    port.send(b'\0' + on_the_line(make_packets(INTEGERS[:1], 1000.0)[0]))
    source = source_at(port.path)
    port.send(on_the_line(make_packets(INTEGERS[1:2], 1000.0)[0]))
    np.testing.assert_array_equal(read_rows(source, 1), SCALE_V * INTEGERS[1:2])
    source.close()


def test_a_source_without_a_port_is_an_error_that_says_why():
    with pytest.raises(
        ValueError, match="parameter serial_port is '', allowed: a port, as source"
    ):
        SerialSource(DriverConfig(source='serial'), time.time_ns)


def test_a_rate_that_the_port_does_not_have_is_named(port, monkeypatch):
    def refuses(*_, **__):
        raise ValueError('Failed to set custom baud rate')

    monkeypatch.setattr(serial_source.serial, 'Serial', refuses)
    source = source_at(port.path, serial_baud=9601)
    assert not source.connected
    assert source.state == (
        f'{port.path}: cannot be read (Failed to set custom baud rate), trying again'
    )
