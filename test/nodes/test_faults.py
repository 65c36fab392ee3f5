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

"""Faults of docs/faults.md, caused for real, and what a user sees.

In none of them may ``slip_valid`` be true, with ``slip`` ON or OFF, for longer than
``input_timeout_s`` after the last sample that counted. Where it is lost in other ways, where its
clock is set, where parameters change and where the detector is held up:
``test_detector_silence.py``. Dead channels are in ``test_health.py``, faults of a
sensor in ``test_driver_live.py``, of messages in ``test_detector.py``, of two senders in
``test_inputs.py``, of the grasp controller in ``test_grasp_controller.py``, of parameters in
``test_detector_parameters.py``, of files in ``test/parameters`` and ``test/recordings``, of the
launch files in ``test/launch``, of the live page in ``test/view``.
"""

import signal
import time

import pytest
from nodes.slipping_sensor import PERIOD_S, Sensor
from rclpy.event_handler import SubscriptionEventCallbacks
from std_msgs.msg import Bool

from slip_detector.nodes.messages import heartbeat_qos, state_qos
from support.harness import Detected


def test_sensor_silent_where_nobody_publishes_the_clock(bench):
    sensor = Sensor(bench, use_sim_time='true')
    sensor.slips()
    sensor.fell_in_time()
    bench.wait_for(lambda: sensor.told('input', 'no samples for'), 'the diagnostics')
    sensor.goes_on()


@pytest.mark.parametrize(
    'numbers', [[signal.SIGKILL], [signal.SIGTERM], [signal.SIGINT, signal.SIGTERM]]
)
def test_detector_killed_or_ended_and_started_again(bench, numbers):
    sensor = Sensor(bench)
    # With the default quality of service nobody is told that the detector has gone.
    heard = [bench.listen(Bool, topic, 10) for topic in ('slip', 'slip_valid')]
    sensor.play(lambda: all(states and states[-1].data for states in heard), 'slip')
    if numbers == [signal.SIGKILL]:
        sensor.process.signal(signal.SIGKILL)
        sensor.process.wait()
        bench.wait_until_forgotten('slip_detector')
    else:
        sensor.process.end_quietly(*numbers)
        bench.wait_for(lambda: not any(states[-1].data for states in heard), 'the withdrawal')
    # The state that was kept for late subscribers died with it (see the last test).
    late = bench.listen(Bool, 'slip', state_qos())
    sensor.start()
    bench.wait_for(sensor.fell, 'slip_valid and slip to be false')
    bench.wait_for(lambda: late, 'the state')
    assert not late[0].data
    sensor.goes_on()


def test_a_flood_at_twenty_times_the_rate(bench):
    sensor = Sensor(bench)
    sensor.slips()
    flood_s = PERIOD_S / 20
    until_s = time.monotonic() + 3.0
    row = sensor.row(slipping=False)
    while time.monotonic() < until_s:
        sensor.next_s = time.monotonic()
        for _ in range(40):
            sensor.send(row, after_s=0.0, stamped_after_s=flood_s)
        sensor.bench.executor.spin_once(timeout_sec=40 * flood_s)
    # It still keeps its time: the heart beats, the timeout comes.
    sensor.fell_in_time()
    assert sensor.told('timing', '380 configured') or sensor.told('input', 'restarted')
    sensor.clock_s = time.time() + 10.0
    sensor.goes_on()


def test_disk_full_where_the_log_goes(bench):
    with open('/dev/full', 'w') as full:  # It takes nothing, as a full disk.
        sensor = Sensor(bench, output=full)
        # What it says on its log is lost; what it does is not.
        sensor.play(sensor.says_slip, 'slip')
        sensor.fell_in_time()
        sensor.play(sensor.says_slip, 'slip again')


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
