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
import time

import pytest
from rclpy.event_handler import SubscriptionEventCallbacks
from std_msgs.msg import Bool

from slip_detector.nodes.messages import heartbeat_qos
from support.harness import Detected


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_a_subscriber_is_told_within_the_deadline_when_the_detector_is_killed_or_hangs(
    bench, number
):
    told, slip = {'deadline': [], 'liveliness': []}, []

    def note(kind):
        return lambda event: told[kind].append((time.monotonic(), event))

    bench.node.create_subscription(
        Bool,
        'slip',
        lambda message: slip.append(time.monotonic()),
        heartbeat_qos(0.2),
        event_callbacks=SubscriptionEventCallbacks(
            deadline=note('deadline'), liveliness=note('liveliness')
        ),
    )
    detected = Detected(bench)
    bench.wait_for(lambda: len(slip) > 5, 'the heartbeat')
    detected.process.signal(number)
    # After the last message: a busy machine is late before.
    bench.wait_for(lambda: any(s > slip[-1] for s, _ in told['deadline']), 'the missed deadline')
    bench.wait_for(
        lambda: any(s > slip[-1] and event.alive_count == 0 for s, event in told['liveliness']),
        'nobody to be alive',
    )
    # Some tenths of a second for a busy machine; one that was forgotten takes some ten seconds.
    assert told['liveliness'][-1][0] - slip[-1] < 0.5
    if number == signal.SIGSTOP:
        known = len(slip)
        detected.process.signal(signal.SIGCONT)
        bench.wait_for(lambda: len(slip) > known, 'the heartbeat')
        bench.wait_for(lambda: told['liveliness'][-1][1].alive_count == 1, 'a sign of life')
