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

"""Rows, stamps and names out of messages of any type; one publisher of them or several."""

import itertools
import signal

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from nodes.slipping_sensor import Sensor
from rclpy.serialization import serialize_message

from slip_detector.nodes.inputs import Input, Senders, find_message_class
from slip_detector.nodes.messages import time_message
from slip_detector.parameters.detector import DetectorConfig
from support.harness import batch_of

PUBLISHED = {'source_timestamp': 5, 'publication_sequence_number': 8}


def read(message, **parameters):
    source = Input(DetectorConfig(**parameters))
    return source, source.read(serialize_message(message), PUBLISHED)


def test_a_field_in_the_depth_of_a_stamped_message_is_read():
    message = WrenchStamped()
    message.header.stamp, message.wrench.force.z = time_message(9), 4.5
    source, (samples, number) = read(
        message, input_type='geometry_msgs/msg/WrenchStamped', input_field='wrench.force.z'
    )
    assert not source.has_names
    assert (samples.volts.tolist(), samples.stamps_ns.tolist()) == ([[4.5]], [9])
    assert (samples.names, samples.frame_id, number) == ((), '', None)


def test_a_batch_without_a_header_has_a_row_for_each_sample_and_the_time_of_publication():
    rows = np.arange(6, dtype=np.float32).reshape(3, 2)
    kind = {'input_type': 'std_msgs/Float32MultiArray', 'input_field': 'data'}
    _, (samples, number) = read(batch_of(rows), sample_rate_hz=1e3, **kind)
    np.testing.assert_array_equal(samples.volts, rows)
    assert samples.stamps_ns.tolist() == [5 - 2_000_000, 5 - 1_000_000, 5]
    assert number == PUBLISHED['publication_sequence_number']
    assert len(read(batch_of(rows[:0]), **kind)[1][0].volts) == 0


@pytest.mark.parametrize(
    'name',
    [
        'JointState',
        'no_msgs/msg/JointState',
        'std_msgs/msg/__name__',
        'std_msgs/msg/_bool',
        'diagnostic_msgs/srv/SelfTest',
        '../std_msgs/msg/Bool',
    ],
)
def test_a_type_that_is_not_installed_is_refused(name):
    with pytest.raises(ValueError, match=r'input_type is .*allowed: the name of an installed'):
        find_message_class(name)


def test_a_module_that_is_no_message_package_is_not_imported(tmp_path, monkeypatch):
    package = tmp_path / 'some_package'
    package.mkdir()
    (package / '__init__.py').write_text('raise RuntimeError("imported")')
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match='input_type'):
        find_message_class('some_package/msg/JointState')


def test_a_field_that_the_type_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(ValueError, match=r"input_field is 'volts'.*header, name, position"):
        Input(DetectorConfig(input_field='volts'))


@given(
    st.integers(1, 10**6),
    st.integers(1, 10**6),
    st.lists(st.tuples(st.integers(1, 20), st.integers(1, 20)), min_size=2),
)
def test_of_two_that_send_nothing_of_the_second_is_taken_and_soon_nothing_at_all(a, b, turns):
    senders = Senders(lambda: 60.0)
    assert senders.accepts(a, publishers=1)
    # Numbers that are the same by chance cannot be told apart for a while.
    first, second = itertools.count(a + 1), itertools.count(a + 10**7 + b)
    for many_of_second, many_of_first in turns:
        assert not any(senders.accepts(next(second), publishers=2) for _ in range(many_of_second))
        assert not any(senders.accepts(next(first), publishers=2) for _ in range(many_of_first))
        assert senders.several


def test_a_publisher_that_was_killed_does_not_keep_the_next_one_out(monkeypatch):
    now_s = 100.0
    monkeypatch.setattr('time.monotonic', lambda: now_s)
    senders = Senders(lambda: 1.0)
    assert senders.accepts(900, publishers=1)
    # The dead one is known still, and may have been held up only.
    now_s += 0.9
    assert not any(senders.accepts(number, publishers=2) for number in range(1, 10))
    now_s += 0.1
    assert all(senders.accepts(number, publishers=2) for number in range(10, 2000))
    assert not senders.several


@pytest.mark.parametrize('ahead', [2, 50, -2, -50])
def test_of_two_that_were_started_together_one_message_is_mistaken_and_one_alone_is_taken(ahead):
    senders = Senders(lambda: 60.0)
    senders.accepts(500, publishers=1)
    taken = [
        senders.accepts(500 + k + of, publishers=2) for k in range(1, 20) for of in (ahead, 0)
    ]
    assert sum(taken) <= 1
    assert senders.several
    assert senders.accepts(600, publishers=1)
    assert not senders.several


def test_two_detectors_in_one_namespace(bench):
    sensor = Sensor(bench)
    sensor.slips()
    other = bench.start('slip_detector')
    sensor.play(sensor.fell, 'slip_valid to fall')
    words = 'slip is published by /slip_detector, /slip_detector'
    sensor.play(lambda: sensor.told('decisions', words), 'the diagnostics')
    # Both say so.
    words += ': only one of them may; slip_valid is false'
    for process in (sensor.process, other):
        sensor.play(lambda process=process, words=words: words in process.log(), 'the log')
    other.signal(signal.SIGINT)
    sensor.play(other.ended, 'the other one to end')
    sensor.goes_on()
