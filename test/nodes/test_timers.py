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
