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

"""What is published of a live source, and what is said of it."""

import threading
from collections import Counter

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from diagnostic_msgs.msg import DiagnosticArray

from slip_detector.chain.samples import Samples
from slip_detector.nodes.health import Level
from slip_detector.nodes.sensor_relay import SensorRelay, sensor_status
from slip_detector.sources import Source

DEADLINE_S = 60.0


class Scripted(Source):
    """A live source that gives what a test has written down, then waits to be stopped."""

    is_live = True

    def __init__(self, pieces, stop):
        super().__init__('scripted', ('left', 'right'), 0.0)
        self._pieces, self._stop = iter(pieces), stop
        self.is_open = False

    def start(self):
        self.is_open = True

    def read(self, n):
        change, stamps_ns = next(self._pieces, (None, []))
        if change is None:
            self._stop.set()
        else:
            self.connected, self.state = change
        self.counts['samples'] += len(stamps_ns)
        return Samples(np.outer(stamps_ns, [1.0, -1.0]), np.array(stamps_ns, np.int64))

    def close(self):
        self.is_open = False


def test_samples_go_on_in_their_order_and_what_waits_is_sent_when_the_sensor_goes(bench):
    stop = threading.Event()
    done = []
    listening, gone = (True, 'listening'), (False, 'cannot be read')
    source = Scripted([(listening, [1, 2]), (listening, [3]), (gone, []), (listening, [9])], stop)
    relay = SensorRelay(
        bench.node,
        source,
        'tip',
        lambda stamp_ns, names, volts: done.append((stamp_ns, names, volts.tolist())),
        lambda: done.append('flushed'),
    )
    relay.run(stop)
    names = ['left', 'right']
    samples = [(k, names, [k, -k]) for k in (1, 2, 3, 9)]
    assert done == [*samples[:3], 'flushed', samples[3]]
    assert not source.is_open


def test_the_diagnostics_have_the_state_the_counts_and_the_frame(bench):
    heard = bench.listen(DiagnosticArray, '/diagnostics', 10)
    stop = threading.Event()

    def pieces():
        while not heard:
            yield (True, 'listening'), [1]
            stop.wait(0.01)

    source = Scripted(pieces(), stop)
    relay = SensorRelay(bench.node, source, 'tip', lambda *_: None, lambda: None)
    thread = threading.Thread(target=relay.run, args=(stop,))
    thread.start()
    bench.wait_for(lambda: heard, 'the diagnostics')
    thread.join(DEADLINE_S)
    (status,) = heard[0].status
    assert (status.name, status.message, status.hardware_id) == (
        'bench: sensor',
        'listening',
        'tip',
    )
    (samples,) = (int(pair.value) for pair in status.values)
    assert samples > 0


@pytest.mark.parametrize(
    ('connected', 'since', 'level', 'message'),
    [
        (True, {'samples': 380, 'packets': 380}, Level.OK, 'listening'),
        (False, {}, Level.ERROR, 'listening'),
        (True, {}, Level.ERROR, 'no samples come; listening'),
        (
            True,
            {'samples': 380, 'lost': 2, 'checksum': 1},
            Level.WARN,
            'dropped or lost in the last second: checksum 1, lost 2',
        ),
        (
            True,
            {'unlisted_sender': 9},
            Level.ERROR,
            'no samples come; listening; dropped or lost in the last second: unlisted_sender 9',
        ),
    ],
)
def test_the_worst_comes_first_in_what_is_said_of_a_sensor(connected, since, level, message):
    status = sensor_status('listening', connected, Counter(since))
    assert (status.level, status.message) == (level, message)
