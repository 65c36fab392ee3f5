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

import signal

import pytest
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from std_msgs.msg import Bool

from slip_detector.nodes.messages import heartbeat_qos
from support.harness import Detected


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
