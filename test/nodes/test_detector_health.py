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

"""What the detector says about itself, and who is told when it is gone."""

import math
import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from std_msgs.msg import Bool

from slip_detector.nodes.messages import heartbeat_qos
from support.harness import PERIOD_NS, START_NS, Detected


class Watched(Detected):
    """A detector whose diagnostics are read."""

    def __init__(self, bench, **parameters):
        self.reports = bench.listen(DiagnosticArray, '/diagnostics', 10)
        super().__init__(bench, parameters=parameters)

    def wait_for_report(self, part, words, level):
        """Wait until a part of the diagnostics says something at a level."""

        def said():
            return any(
                status.name == f'slip_detector: {part}'
                and words in status.message
                and status.level == bytes([level])
                for report in self.reports
                for status in report.status
            )

        self.bench.wait_for(said, f'{part}: {words}')
        self.reports.clear()


def noise(n):
    return 4.0 + 0.01 * np.random.default_rng(0).standard_normal((n, 16))


def test_the_diagnostics_follow_the_input(bench):
    watched = Watched(bench, input_timeout_s=3.0)
    watched.wait_for_report('input', 'no samples yet', 2)
    watched.wait_for_report('channels', 'nothing is known', 2)
    begin = watched.settle(noise(1)[0], START_NS, PERIOD_NS)
    begin = watched.send_all(noise(400), begin, PERIOD_NS)
    watched.wait_for_report('input', '380.0 samples a second', 0)
    rows = noise(100)
    rows[:, 3] = math.nan
    begin = watched.send_all(rows, begin, PERIOD_NS)
    watched.wait_for_report('channels', 'not a number: ch4', 1)
    begin = watched.send_all(noise(50), begin + 10 * PERIOD_NS, PERIOD_NS)
    watched.wait_for_report('input', '10 samples lost and bridged', 1)
    watched.wait_for_report('input', 'no samples for', 2)
    watched.wait_for_report('decisions', 'slip_valid is false', 2)


def test_the_diagnostics_carry_names_values_and_the_frame(bench):
    watched = Watched(bench)
    bench.wait_for(lambda: watched.reports, 'the diagnostics')
    (report,) = watched.reports[:1]
    assert [status.name for status in report.status] == [
        'slip_detector: input',
        'slip_detector: channels',
        'slip_detector: decisions',
    ]
    keys = {pair.key for status in report.status for pair in status.values}
    assert {'configured rate [Hz]', 'measured rate [Hz]', 'lost and bridged'} <= keys
    assert report.header.stamp.sec > 0


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_a_subscriber_is_told_within_the_deadline_when_the_detector_is_killed_or_hangs(
    bench, number
):
    told = {}

    def note(kind):
        def on_event(event):
            told.setdefault(kind, []).append((bench.node.get_clock().now(), event))

        return on_event

    qos = heartbeat_qos(0.2)
    slip = []
    bench.node.create_subscription(
        Bool,
        'slip',
        lambda message: slip.append((bench.node.get_clock().now(), message.data)),
        qos,
        event_callbacks=SubscriptionEventCallbacks(
            deadline=note('deadline'), liveliness=note('liveliness')
        ),
    )
    detected = Detected(bench)
    bench.wait_for(lambda: len(slip) > 5, 'the heartbeat')
    detected.process.signal(number)

    def told_since(kind):
        """Return whether it was told after the last message: a busy machine is late before."""
        return [event for at, event in told.get(kind, []) if at > slip[-1][0]]

    bench.wait_for(lambda: told_since('deadline'), 'the missed deadline')
    bench.wait_for(
        lambda: any(event.alive_count == 0 for event in told_since('liveliness')),
        'nobody to be alive',
    )
    last, _ = slip[-1]
    at = next(at for at, _ in told['deadline'] if at > last)
    lost = next(at for at, event in told['liveliness'] if event.alive_count == 0 and at > last)
    # A tenth of a second on top for a busy machine; the next beat would have come by then.
    assert Duration(seconds=0) < at - last < Duration(seconds=0.3)
    assert Duration(seconds=0) < lost - last < Duration(seconds=0.5)
    if number == signal.SIGSTOP:
        known = len(slip)
        detected.process.signal(signal.SIGCONT)
        bench.wait_for(lambda: len(slip) > known, 'the heartbeat')
        bench.wait_for(lambda: told['liveliness'][-1][1].alive_count == 1, 'a sign of life')
