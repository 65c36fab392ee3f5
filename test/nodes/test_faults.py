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

"""Each fault of docs/faults.md, caused for real, and what a user sees.

In none of them may ``slip_valid`` be true, with ``slip`` ON or OFF, for longer than
``input_timeout_s`` after the last sample that counted. Faults of a sensor are in
``test_driver_live.py``, of messages in ``test_detector_input.py``, of two senders in
``test_senders.py``, of the grasp controller in ``test_grasp_controller.py``, of parameters in
``test_detector_parameters.py``, of files in ``test/parameters`` and ``test/recordings``, of the
launch files in ``test/launch``, of the live page in ``test/view``.
"""

import math
import signal
import time

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from std_msgs.msg import Bool, Header

from slip_detector.chain.live_chain import GATHER_S
from slip_detector.nodes.messages import event_qos, state_qos
from slip_detector.parameters.detector import DetectorConfig
from support.harness import parameter_messages
from support.slipping_sensor import PERIOD_S, SLACK_S, TIMEOUT_S, Sensor

GROUPS = [f'groups.{name}' for name in DetectorConfig().groups]


@pytest.mark.parametrize('parameters', [{}, {'use_sim_time': 'true'}])
def test_sensor_silent(bench, parameters):
    """Also where nobody publishes the clock that is waited for."""
    sensor = Sensor(bench, **parameters)
    sensor.slips()
    sensor.fell_in_time()
    bench.wait_for(lambda: sensor.told('input', 'no samples for'), 'the diagnostics')
    sensor.goes_on()


def test_one_channel_dead(bench):
    sensor = Sensor(bench)

    def dead(k, row):
        row[13] = 4.0  # of group TP, where all must agree
        return row

    sensor.play(lambda: sensor.told('channels', 'flat: ch14'), 'the diagnostics', change=dead)
    # The other three of its group and the other groups go on.
    sensor.play(sensor.says_slip, 'slip', change=dead)


@pytest.mark.parametrize(
    ('row', 'part', 'words'),
    [
        ([5.0] * 16, 'channels', 'at the upper rail'),
        ([math.nan] * 16, 'channels', 'not a number'),
        ([4.0] * 15, 'input', 'samples dropped: not as many channels as configured'),
    ],
)
def test_rows_that_say_nothing(bench, row, part, words):
    sensor = Sensor(bench, valid_range_v=[0.0, 5.0], flat_after_s=0.2)
    sensor.slips()
    last_good_s = sensor.sent_s
    sensor.play(sensor.fell, 'slip_valid to fall', change=lambda k, good: row)
    assert time.monotonic() - last_good_s < TIMEOUT_S + SLACK_S
    sensor.play(lambda: sensor.told(part, words), 'why', change=lambda k, good: row)
    sensor.goes_on()


def test_a_burst_of_late_messages(bench):
    sensor = Sensor(bench)
    sensor.slips()
    sent = [sensor.row(slipping=False) for _ in range(50)]
    for row in sent:  # stamped a quarter of a second ago, all at once
        sensor.send(row, after_s=0.0, stamped_after_s=-0.25)
        sensor.clock_s += 0.25
    sensor.play(lambda: sensor.told('input', 'samples dropped: late'), 'the diagnostics')
    assert sensor.says_slip()  # the late ones of a finger at rest did not count
    sensor.goes_on()


def test_five_percent_lost_at_random(bench):
    sensor = Sensor(bench)
    sensor.slips()

    def lossy(k, row):
        if sensor.random.random() < 0.05:  # The one before this is lost.
            sensor.next_s += PERIOD_S
            sensor.clock_s += PERIOD_S
        return row

    sensor.play(lambda: sensor.told('input', 'lost and bridged'), 'the diagnostics', change=lossy)
    assert sensor.says_slip()


@pytest.mark.parametrize('leap_s', [-3600.0, 3600.0])
def test_the_clock_of_the_samples_is_set(bench, leap_s):
    sensor = Sensor(bench)
    sensor.slips()
    sensor.clock_s += leap_s
    known = len(sensor.slip)
    sensor.slips()
    sensor.play(lambda: sensor.told('input', 'restarted 1 times'), 'the diagnostics')
    sensor.goes_on()
    assert len(sensor.slip) > known


@pytest.mark.parametrize(('good', 'wrong'), [(29, 1), (1, 3)])
def test_stamps_that_are_wrong_now_and_then_or_mostly(bench, good, wrong):
    sensor = Sensor(bench)
    sensor.slips()
    known = len(sensor.slip), len(sensor.valid)

    def change(k, row):
        for _ in range(0 if k % good else wrong):
            off_s, clock_s = sensor.random.uniform(-1e7, 1e7), sensor.clock_s
            sensor.send(row, stamped_after_s=off_s)
            sensor.clock_s = clock_s + PERIOD_S
        return sensor.row()

    if wrong > good:
        sensor.play(sensor.fell, 'slip_valid to fall', change=change)
    else:
        end_s = time.monotonic() + 3.0
        sensor.play(lambda: time.monotonic() > end_s, 'three seconds', change=change)
        assert all(on for _, on in sensor.slip[known[0] :] + sensor.valid[known[1] :])
        assert sensor.told('input', 'samples dropped: late, or with a stamp that does not fit')
        assert not sensor.told('input', 'restarted')
    sensor.goes_on()


@pytest.mark.parametrize('off_s', [-10.0, 3600.0])
def test_stamps_too_far_from_the_clock(bench, off_s):
    sensor = Sensor(bench, max_age_s=2.0)
    sensor.slips()
    sensor.clock_s += off_s
    known = len(sensor.valid)
    sensor.play(lambda: sensor.told('input', 'of the clock' if off_s > 0 else 'behind the'), 'why')
    assert not sensor.valid[-1][1]
    assert len(sensor.valid) > known
    sensor.clock_s -= off_s
    sensor.goes_on()


def test_wrong_rate(bench):
    sensor = Sensor(bench)
    slow = 1.1 * PERIOD_S
    deadline_s = time.monotonic() + 30.0
    while not sensor.told('input', 'samples a second, 380 configured'):
        assert time.monotonic() < deadline_s, sensor.process.log()
        sensor.send(sensor.row(), after_s=slow, stamped_after_s=slow)
    assert not sensor.told('input', 'lost and bridged')
    sensor.fell_in_time()


def test_detector_killed_and_started_again(bench):
    sensor = Sensor(bench)
    sensor.slips()
    sensor.process.signal(signal.SIGKILL)
    sensor.process.wait()
    bench.wait_until_forgotten('slip_detector')
    # The state that was kept for late subscribers died with it (see also test_detector_health).
    late = []
    bench.node.create_subscription(Bool, 'slip', late.append, state_qos())
    sensor.start()
    bench.wait_for(sensor.fell, 'slip_valid and slip to be false')
    bench.wait_for(lambda: late, 'the state')
    assert not late[0].data
    sensor.goes_on()


def test_detector_stopped_and_continued(bench):
    # Where this test is held up for long, slip_valid would fall for want of samples.
    sensor = Sensor(bench, input_timeout_s=2.0)
    sensor.slips()
    sensor.process.signal(signal.SIGSTOP)
    until_s = time.monotonic() + 5.0
    sensor.play(lambda: time.monotonic() > until_s, 'the samples meanwhile')
    known = len(sensor.valid)
    sensor.process.signal(signal.SIGCONT)
    sensor.play(lambda: len(sensor.valid) > known + 10, 'the heart to beat again')
    # Nothing is said on what came meanwhile.
    states = [valid for _, valid in sensor.valid[known:]]
    assert states == sorted(states)
    assert (states[0], states[-1]) == (False, True)


@pytest.mark.parametrize('numbers', [[signal.SIGTERM], [signal.SIGINT, signal.SIGTERM]])
def test_detector_ended_and_started_again(bench, numbers):
    sensor = Sensor(bench)
    # With the default quality of service nobody is told that the detector has gone.
    heard = [bench.listen(Bool, topic, 10) for topic in ('slip', 'slip_valid')]
    sensor.play(lambda: all(states and states[-1].data for states in heard), 'slip')
    for number in numbers:
        sensor.process.signal(number)
    assert sensor.process.wait() == 0
    bench.wait_for(lambda: not any(states[-1].data for states in heard), 'both to be withdrawn')
    sensor.process = bench.start('slip_detector')
    sensor.play(lambda: all(states[-1].data for states in heard), 'slip')


def test_driver_killed_and_started_again(bench):
    slip, valid = (bench.listen(Bool, topic, state_qos()) for topic in ('slip', 'slip_valid'))
    given = {'source': 'scene', 'loop': 'true', 'wait_for_subscribers': 1}
    bench.start('slip_detector')
    driver = bench.start('slip_driver', parameters=given)
    bench.wait_for(lambda: slip and slip[-1].data and valid[-1].data, 'slip')
    driver.signal(signal.SIGKILL)
    bench.wait_for(lambda: not slip[-1].data and not valid[-1].data, 'both to fall')
    bench.wait_until_forgotten('slip_driver')
    bench.start('slip_driver', parameters=given)
    bench.wait_for(lambda: slip[-1].data and valid[-1].data, 'slip again')


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
    assert sensor.told('input', '380 configured') or sensor.told('input', 'restarted')
    sensor.clock_s = time.time() + 10.0
    sensor.goes_on()


def test_a_parameter_changed_in_the_middle_of_a_slip(bench):
    # Where this test is held up for long, slip would fall for want of samples.
    sensor = Sensor(bench, input_timeout_s=30.0)
    client = bench.client(SetParametersAtomically, 'slip_detector/set_parameters_atomically')
    sensor.slips()
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    bench.wait_for(lambda: bench.node.count_publishers('slip_onset'), 'the onsets')
    for values in (
        {'threshold': 0.4},
        {'passband_hz': [10.0, 60.0]},
        {'heartbeat_hz': 20.0},
        {'publish_channels': False},
        {'publish_groups': False, 'input_timeout_s': 29.0},
        {'publish_groups': True, 'publish_channels': True, 'heartbeat_hz': 10.0},
        {'groups.TP': None, 'groups.TD': None, 'groups.T': [14, 16, 11, 9, 1, 3, 8, 6]},
        {'disabled_channels': [14]},
    ):
        known = len(sensor.slip), len(sensor.valid)
        # One sample is as good as the next: no rise of its own comes at a change.
        sensor.slips()
        del onsets[:]
        change(sensor, client, values)
        end_s = time.monotonic() + 2 * GATHER_S
        sensor.play(lambda end_s=end_s: time.monotonic() > end_s, 'what is changed to be used')
        # Neither an OFF in between, nor a gap, nor another onset.
        for heard, before in zip((sensor.slip, sensor.valid), known, strict=True):
            assert all(on for _, on in heard[before:]), values
            assert len(heard) > before
        assert not onsets, values
    assert sensor.process.log().count('new filters have taken over') == 2
    # A chain that starts again is OFF at first; that it comes ON again is no onset.
    known = len(sensor.slip)
    change(sensor, client, {'sample_rate_hz': 381.0})
    sensor.play(lambda: not all(on for _, on in sensor.slip[known:]), 'slip to fall')
    sensor.slips()
    assert not onsets
    sensor.goes_on()


def change(sensor, client, values, slipping=True):
    """Change parameters of the detector while the sensor goes on."""
    request = SetParametersAtomically.Request(parameters=parameter_messages(values))
    future = client.call_async(request)
    sensor.play(future.done, 'the answer', slipping)
    assert future.result().result.successful, future.result().result.reason


@pytest.mark.parametrize(
    'values',
    [
        {'input_type': 'std_msgs/msg/Float32MultiArray', 'input_field': 'data'},
        {'input_field': 'velocity'},
        {'channels': 4, 'groups.all': [1, 2, 3, 4]} | dict.fromkeys(GROUPS),
    ],
)
@pytest.mark.parametrize('slipping', [True, False])
def test_an_input_changed_to_one_that_does_not_come(bench, values, slipping):
    sensor = Sensor(bench)
    client = bench.client(SetParametersAtomically, 'slip_detector/set_parameters_atomically')
    says = sensor.says_slip if slipping else sensor.says_valid
    sensor.play(says, 'decisions', slipping)
    change(sensor, client, values, slipping)
    # What was decided on the input before does not stand for ever.
    sensor.play(sensor.fell, 'slip_valid to fall')
    reports = len(sensor.reports) + 2
    sensor.play(lambda: len(sensor.reports) >= reports, 'the diagnostics')
    assert not sensor.process.ended()
    assert 'Traceback' not in sensor.process.log()


def test_disk_full_where_the_log_goes(bench):
    with open('/dev/full', 'w') as full:  # It takes nothing, as a full disk.
        sensor = Sensor(bench, output=full)
        # What it says on its log is lost; what it does is not.
        sensor.play(sensor.says_slip, 'slip')
        sensor.fell_in_time()
        sensor.play(sensor.says_slip, 'slip again')
