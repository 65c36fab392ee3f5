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

"""One publisher or several, told by the numbers of their messages."""

import itertools
import signal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nodes.slipping_sensor import Sensor

from slip_detector.nodes.inputs import Senders


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


def test_without_numbers_each_publisher_is_taken_to_send():
    senders = Senders(lambda: 60.0)
    assert senders.accepts(None, publishers=1)
    assert not senders.accepts(None, publishers=2)
    assert senders.several


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
