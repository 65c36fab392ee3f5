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

"""Replayed time: a clock on /clock."""

import itertools

import numpy as np
from rosgraph_msgs.msg import Clock

from slip_detector.nodes.messages import time_message
from support.harness import PERIOD_NS, START_NS, Detected


class Replayed(Detected):
    """A detector that lives in the time of a recording."""

    def __init__(self, bench, **parameters):
        self._clock = bench.node.create_publisher(Clock, '/clock', 10)
        super().__init__(bench, parameters={'use_sim_time': 'true', **parameters})
        bench.wait_for(self._clock.get_subscription_count, 'the subscription to the clock')

    def send(self, volts, at_ns, names=()):
        self.tick(at_ns)
        super().send(volts, at_ns, names)

    def tick(self, at_ns):
        self._clock.publish(Clock(clock=time_message(at_ns)))

    def fall_silent(self, at_ns):
        """Let the clock run on from here without samples until slip_valid falls."""
        ticks = itertools.count(at_ns, 10_000_000)

        def fallen():
            self.tick(next(ticks))
            return not self.valid[-1].data

        self.bench.wait_for(fallen, 'slip_valid to fall')


def test_the_timeout_follows_the_clock(bench):
    rows = 4.0 + 0.1 * np.random.default_rng(0).standard_normal((100, 16))
    replayed = Replayed(bench)
    begin_ns = replayed.settle(rows[0], START_NS, PERIOD_NS)
    end_ns = replayed.send_all(rows, begin_ns, PERIOD_NS)
    bench.wait_for(lambda: replayed.valid[-1].data, 'slip_valid')
    # Time passes slowly: for ten beats of the heart nothing is lost.
    beats, ticks = len(replayed.valid), itertools.count(end_ns, 1000)

    def beaten():
        replayed.tick(next(ticks))
        return len(replayed.valid) > beats + 10

    bench.wait_for(beaten, 'ten beats')
    assert replayed.valid[-1].data
    replayed.fall_silent(end_ns)


def test_a_recording_that_starts_again_goes_on(bench):
    rows = 4.0 + 0.1 * np.random.default_rng(0).standard_normal((100, 16))
    replayed = Replayed(bench)
    begin_ns = replayed.settle(rows[0], START_NS, PERIOD_NS)
    replayed.send_all(rows, begin_ns, PERIOD_NS)
    # The clock leaps back; the first tenth of a second is taken for late samples.
    for k, row in enumerate(rows):
        replayed.send(row, begin_ns + k * PERIOD_NS)
    last_ns = begin_ns + 99 * PERIOD_NS
    bench.wait_for(lambda: replayed.answered(last_ns), 'the decision')
    bench.wait_for(lambda: replayed.valid[-1].data, 'slip_valid')
    replayed.fall_silent(last_ns + PERIOD_NS)
