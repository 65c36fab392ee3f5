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

"""Timers by name."""

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.clock import Clock, ClockType  # noqa: E402

from slip_detector.nodes.timers import Timers  # noqa: E402


def test_a_timer_is_started_again_and_the_others_keep_their_time(bench):
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    timers, calls = Timers(bench.node), []
    assert not timers
    timers.start('slow', 1e6, lambda: calls.append('slow'), clock)
    (slow,) = bench.node.timers
    timers.start('quick', 1e6, lambda: calls.append('never'), clock)
    timers.start('quick', 0.01, lambda: calls.append('quick'), clock)
    assert slow in bench.node.timers
    assert len(list(bench.node.timers)) == 2
    bench.wait_for(lambda: calls, 'a call')
    assert set(calls) == {'quick'}
    timers.stop('quick')
    timers.stop('never started')
    assert list(bench.node.timers) == [slow]
    assert timers
    timers.stop_all()
    assert not timers
    assert not list(bench.node.timers)
