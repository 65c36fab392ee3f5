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

"""The driver node as a process of its own, and its grip on an object."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.nodes.driver import ALIGNED_S, align
from slip_detector.nodes.messages import stamp_ns, state_qos
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import write_recording
from slip_detector.sources import open_source
from support.harness import patient_qos, patient_state_qos, reliable_qos


class Played:
    """A driver process that waits for the test, and all that it publishes."""

    def __init__(self, bench, parameters, samples):
        self.voltages = bench.listen(JointState, 'voltages', reliable_qos())
        self.truth = bench.listen(Bool, 'slip_truth', patient_state_qos())
        self.position = bench.listen(JointState, 'platform_position', reliable_qos())
        self.process = bench.start_driver(parameters=parameters)
        bench.wait_for(lambda: len(self.voltages) >= samples, f'{samples} samples')

    def rows(self):
        return np.array([message.position for message in self.voltages])

    def stamps_ns(self):
        return np.array([stamp_ns(message.header.stamp) for message in self.voltages])


def test_a_scene_is_played_whole_with_truth_and_position_stamped_when_it_was_sampled(bench):
    wanted = open_source(DriverConfig(source='scene', seed=7)).read(10_000)
    count, truth = len(wanted.volts), [on for on, _ in itertools.groupby(wanted.truth)]
    played = Played(bench, {'seed': 7, 'frame_id': 'index_tip', 'rate': 4.0}, count)
    assert played.process.wait() == 0
    np.testing.assert_array_equal(played.rows(), wanted.volts)
    stamps = played.stamps_ns()
    np.testing.assert_array_equal(stamps - stamps[0], wanted.stamps_ns - wanted.stamps_ns[0])
    assert f'played all {count} samples' in played.process.log()
    assert played.voltages[0].header.frame_id == 'index_tip'
    assert list(played.voltages[0].name) == [f'ch{i + 1}' for i in range(16)]
    bench.wait_for(lambda: len(played.truth) == len(truth), 'truth to rise and fall')
    assert [message.data for message in played.truth] == truth
    wanted_m = dict(zip(stamps.tolist(), wanted.position_m.tolist(), strict=True))
    heard_m = {stamp_ns(each.header.stamp): each.position[0] for each in played.position}
    assert heard_m
    assert heard_m.items() <= wanted_m.items()
    assert 'joint_states' not in str(bench.node.get_topic_names_and_types())


def test_a_recording_that_is_cut_off_is_played_as_far_as_it_goes_and_said_to_be(bench, tmp_path):
    pytest.importorskip('rosbags', reason='needs rosbags')
    whole, cut = tmp_path / 'whole.mcap', tmp_path / 'cut.mcap'
    samples = Samples(np.full((20_000, 2), 4.0), 100_000 * np.arange(1, 20_001))
    write_recording(whole, [samples], 10_000.0, ['a', 'b'])
    cut.write_bytes(whole.read_bytes()[:-400_000])
    process = bench.start('slip_driver', parameters={'source': 'recording', 'recording': cut})
    assert process.wait() == 0
    assert 'cut.mcap is cut off at byte ' in process.log()


def test_a_recording_is_looped_with_its_labels_and_gaps_and_its_stamps_go_on(bench, tmp_path):
    k = np.arange(120)
    k = k[(k < 40) | (k > 47)]  # a gap that the detector is to see
    stamps_ns = 1_700_000_000_000_000_000 + k * 2_000_000
    wanted = Samples(4.3 + 1e-3 * np.sin(k[:, np.newaxis] * [1, 2, 3]), stamps_ns, k >= 80)
    recording = tmp_path / 'mine.csv'
    write_recording(recording, [wanted], 500.0, ['left', 'right', 'tip'])
    parameters = {'source': 'recording', 'recording': recording, 'loop': 'true', 'rate': 2.0}
    played = Played(bench, parameters, 3 * len(k))
    rows, heard_ns = played.rows()[: 3 * len(k)], played.stamps_ns()[: 3 * len(k)]
    np.testing.assert_array_equal(rows, np.tile(wanted.volts, (3, 1)))
    wanted_ns = np.concatenate([(k + 120 * lap) * 2_000_000 for lap in range(3)])
    np.testing.assert_array_equal(heard_ns - heard_ns[0], wanted_ns)
    assert list(played.voltages[0].name) == ['left', 'right', 'tip']
    bench.wait_for(lambda: len(played.truth) >= 4, 'truth to rise twice')
    assert [message.data for message in played.truth[:4]] == [False, True] * 2
    assert not played.process.ended()


def test_a_driver_that_cannot_keep_its_pace_says_how_late_it_is(bench):
    parameters = {'source': 'scene', 'loop': 'true', 'rate': 1000.0}
    process = bench.start('slip_driver', parameters=parameters)
    bench.wait_for(lambda: 'ms late: the pace cannot be kept' in process.log(), 'the log')


@given(st.floats(0.0, 1e6), st.floats(1e-4, 1e4))
def test_drivers_begin_together_and_none_idles_until_a_rare_message_is_due(now_s, period_s):
    begins_s = align(now_s, period_s)
    assert -1e-6 <= begins_s - now_s <= min(period_s, ALIGNED_S) + 1e-6
    # Another that starts a little before begins at the same moment, or just as much before.
    periods = (begins_s - align(now_s - 0.03, period_s)) / min(period_s, ALIGNED_S)
    assert periods == pytest.approx(round(periods), abs=1e-3)


#: Slow samples: that of one block are a good part of a second.
GRIP_RATE_HZ = 50.0

#: A gripper that follows at once, and an object that falls out of a weak grip.
GRIP_SCENE = f"""
sample_rate_hz: {GRIP_RATE_HZ}
steps:
  - {{duration_s: 0.2, force_n: 3.0}}
  - {{duration_s: 0.4, carried: 1.0}}
  - {{duration_s: 60.0}}
motion: {{ringing_hz: 500.0, ringing_damping: 1.0}}
friction: {{stribeck_velocity_m_s: 0.1}}
object: {{mass_kg: 0.2, length_m: 0.05, rest_patches: 200}}
"""


def test_a_driver_waits_for_the_first_command_and_the_next_is_felt_in_the_next_samples(
    bench, tmp_path
):
    voltages = bench.listen(JointState, 'voltages', patient_qos())
    position = bench.listen(JointState, 'platform_position', patient_qos())
    command = bench.node.create_publisher(JointState, 'grip_force', state_qos())
    path, clock = tmp_path / 'scene.yaml', bench.node.get_clock()
    path.write_text(GRIP_SCENE)
    parameters = {'source': 'scene', 'scene': path, 'wait_for_grip': 'true'}
    process = bench.start('slip_driver', parameters={**parameters, 'wait_for_subscribers': 1})

    def said(words):
        bench.wait_for(lambda: words in process.log(), f'the log to say {words}')

    def hold(*efforts):
        at_ns = clock.now().nanoseconds
        command.publish(JointState(name=['grip'], effort=efforts))
        return at_ns

    def play(seconds):
        """Wait until so much more of the scene was heard, from now on: samples may come late."""
        end_ns = clock.now().nanoseconds + round(seconds * 1e9)
        bench.wait_for(
            lambda: voltages and stamp_ns(voltages[-1].header.stamp) >= end_ns,
            f'{seconds} s of samples',
        )

    # Until the first command comes, the scene itself would grip with 3 N.
    said('waiting for a grip force')
    bench.wait_for(command.get_subscription_count, 'the driver to listen')
    hold(float('nan'))
    said('force_n is nan N, allowed: 0 to 1000 N; ignored')
    for _ in range(20):
        bench.executor.spin_once(timeout_sec=0.02)
    assert not voltages
    hold(2.0)
    play(1.0)
    # A command that makes no sense does not let the object fall.
    hold(1.0, 2.0)
    said('grip_force has 2 efforts, allowed: 1; ignored')
    play(0.5)
    assert position[-1].position[0] < 1e-4
    at_ns = hold(6.0)
    play(2.0)
    # Volts sink as the load grows: a step of newtons stands out from the noise by far.
    rows = [(stamp_ns(each.header.stamp), each.position[0]) for each in voltages]
    *_, firm_v = (volts for stamp, volts in rows if stamp <= at_ns)
    felt_ns = min(stamp for stamp, volts in rows if volts < firm_v - 0.05)
    # A block of samples read ahead would be later than this.
    assert 0 < felt_ns - at_ns < 0.5 * 32 / GRIP_RATE_HZ * 1e9
