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

"""The driver node as a process of its own, and both nodes together."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.nodes.driver import ALIGNED_S, align
from slip_detector.nodes.messages import stamp_ns
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import write_recording
from slip_detector.sources import open_source
from support.harness import patient_state_qos, reliable_qos


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
