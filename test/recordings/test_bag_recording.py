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

"""Bags: rows, stamps and truth are found in topics of any type and any namespace."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import open_recording
from support import recorded
from support.bags import NAMES, PLUGINS, START_NS, Bag, check_same, gathered, rows, save, stamps


def complaint(path, **parameters):
    return recorded.complaint(path, RecordingConfig(**parameters))


@pytest.mark.parametrize('plugin', PLUGINS)
def test_any_message_type_is_read_by_topic_and_field(tmp_path, plugin):
    pillar, state = 'papillarray_msgs/msg/PillarState', 'papillarray_msgs/msg/SensorState'
    definitions = [
        (pillar, 'float32 dx\nfloat32 fz\nbool in_contact\n'),
        (state, f'std_msgs/Header header\nuint8 id\n{pillar}[] pillars\nfloat64 gfx\n'),
    ]
    volts = np.random.default_rng(1).normal(size=(300, 4)).astype(np.float32)
    with Bag(tmp_path / 'a', plugin, definitions) as bag:
        for stamp_ns, row in zip(stamps(300), volts, strict=True):
            pillars = [bag.make(pillar, dx=0.0, fz=fz, in_contact=True) for fz in row]
            message = bag.make(state, header=bag.header(stamp_ns), id=3, pillars=pillars, gfx=1.5)
            bag.write('/hub/sensor_0', message, stamp_ns + 12345)
    path = tmp_path / 'a'
    config = RecordingConfig(recording_topic='/hub/sensor_0', recording_field='pillars[].fz')
    recording = open_recording(path, config)
    check_same(gathered(recording), Samples(volts.astype(np.float64), stamps(300), None))
    assert recording.channel_names == ('ch1', 'ch2', 'ch3', 'ch4')
    one = RecordingConfig(recording_topic='sensor_0', recording_field='pillars[2].fz')
    np.testing.assert_array_equal(gathered(open_recording(path, one)).volts, volts[:, 2:3])
    assert f'has no topics voltages, there are: /hub/sensor_0 ({state})' in complaint(path)
    said = complaint(path, recording_topic='sensor_0')
    assert 'field data: no numbers at data, there are: header, id, pillars, gfx; --field' in said


def test_messages_with_other_channels_or_names_are_left_out_and_counted(tmp_path):
    written = rows(60)
    with Bag(tmp_path / 'a') as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
            other = [('left', 'right'), ('left', 'tip', 'right')][k % 2]
            joints = bag.joints(stamp_ns + 1, row[: len(other)], other)
            bag.write('/voltages', joints, stamp_ns + 1)
    recording = open_recording(tmp_path / 'a')
    check_same(gathered(recording), written._replace(truth=None))
    assert recording.counts.dropped == 60
    assert recording.channel_names == NAMES


@pytest.mark.parametrize('samples', [1, 4, 25])
def test_batches_are_spread_over_their_time(tmp_path, samples):
    n = 500
    volts = rows(n, channels=2).volts.astype(np.float32)
    with Bag(tmp_path / 'a') as bag:
        sizes = [
            bag.make('std_msgs/msg/MultiArrayDimension', label=label, size=size, stride=0)
            for label, size in (('sample', samples), ('channel', 2))
        ]
        layout = bag.make('std_msgs/msg/MultiArrayLayout', dim=sizes, data_offset=0)
        for first in range(0, n, samples):
            data = volts[first : first + samples].reshape(-1)
            message = bag.make('std_msgs/msg/Float32MultiArray', layout=layout, data=data)
            bag.write('/voltages', message, stamps(n)[first + samples - 1])
    recording = open_recording(tmp_path / 'a')
    read = gathered(recording)
    np.testing.assert_array_equal(read.volts, volts)
    assert np.abs(read.stamps_ns - stamps(n)).max() < 10
    assert recording.sample_rate_hz == pytest.approx(380.0)
    assert recording.counts.gaps == recording.counts.dropped == 0


def test_the_truth_is_taken_from_the_namespace_of_the_rows(tmp_path):
    left = rows(300)
    fingers = {'': rows(300, seed=1), '/left': left, '/right': left._replace(truth=~left.truth)}
    with Bag(tmp_path / 'a') as bag:
        for finger, written in fingers.items():
            bag.write_rows(written, finger)
    for finger, written in fingers.items():
        config = RecordingConfig(recording_topic=f'{finger}/voltages')
        recording = open_recording(tmp_path / 'a', config)
        check_same(gathered(recording), written)
    said = 'has 3 topics voltages, there are: /left/voltages (sensor_msgs/msg/JointState), /r'
    assert said in complaint(tmp_path / 'a')


def test_a_truth_that_was_received_late_holds_from_its_receipt_on(tmp_path):
    n = 50
    with Bag(tmp_path / 'a') as bag:
        for k, stamp_ns in enumerate(stamps(n)):
            # All arrives 3 ms after its stamp; slip begins with row 20, before it was any.
            if k in (20, 30):
                slip = bag.make('std_msgs/msg/Bool', data=k == 20)
                bag.write('/slip_truth', slip, stamp_ns + 2_999_000)
            bag.write('/voltages', bag.joints(stamp_ns, [0.0] * 3), stamp_ns + 3_000_000)
    truth = gathered(open_recording(tmp_path / 'a')).truth
    np.testing.assert_array_equal(truth, (np.arange(n) >= 20) & (np.arange(n) < 30))


def test_times_of_receipt_that_fall_move_no_row_and_are_refused_for_a_label(tmp_path):
    written = rows(400, truth=False)
    with Bag(tmp_path / 'a') as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            bag.write('/voltages', bag.joints(stamp_ns, row), 2**62 if k == 7 else 0)
            if k in (100, 200):
                slip = bag.make('std_msgs/msg/Bool', data=k == 100)
                bag.write('/left/slip_truth', slip, stamp_ns if k == 100 else 0)
    said = ': the times on /left/slip_truth fall, allowed: rising, or --labels (recording_labels)'
    assert complaint(tmp_path / 'a') == said
    (tmp_path / 'a.labels.yaml').write_text('slip_s: [[0.1, 0.2]]')
    read = gathered(open_recording(tmp_path / 'a'))
    np.testing.assert_array_equal(read.volts, written.volts)
    np.testing.assert_array_equal(read.stamps_ns, written.stamps_ns)


@given(st.lists(st.sampled_from([0.0, 1.0, 2.0]), min_size=3, max_size=25))
def test_without_a_truth_a_position_that_changes_is_slip(tmp_path_factory, positions):
    n = len(positions)
    slip = np.zeros(n, bool)
    for k in range(n - 1):  # from the last row at which it stood to the first at which it stands
        slip[k : k + 2] |= positions[k] != positions[k + 1]
    # It flickers by less than what counts.
    written = rows(n)._replace(position_m=np.array(positions) + 1e-6 * (np.arange(n) % 2))
    for truth, wanted in ((None, slip), (written.truth, written.truth)):
        path = save(tmp_path_factory.mktemp('moved') / 'a.mcap', written._replace(truth=truth))
        recording = open_recording(path, RecordingConfig(recording_still_m=5e-6))
        np.testing.assert_array_equal(gathered(recording).truth, wanted)


def test_a_topic_of_labels_that_is_not_there_is_refused_if_it_was_named(tmp_path):
    path = save(tmp_path / 'a.mcap', rows(50, truth=False))
    said = 'has no topic sliding (Bool) or platform_position (JointState), there are: none'
    assert said in complaint(path, recording_truth_topic='sliding')


def test_a_bag_without_samples_or_with_a_stopped_clock_says_so(tmp_path):
    with Bag(tmp_path / 'empty') as bag:
        bag.write('/chatter', bag.make('std_msgs/msg/String', data='hello'), START_NS)
    said = complaint(tmp_path / 'empty')
    assert 'has no topics voltages, there are: /chatter (std_msgs/msg/String)' in said
    with Bag(tmp_path / 'stopped') as bag:
        for _ in range(10):
            bag.write('/voltages', bag.joints(0, [1.0, 2.0, 3.0]), START_NS)
    assert 'the stamps on /voltages do not rise' in complaint(tmp_path / 'stopped')
    with Bag(tmp_path / 'hollow') as bag:
        for stamp_ns in stamps(10):
            bag.write('/voltages', bag.joints(stamp_ns, [], ()), stamp_ns)
    assert 'the field position is empty in every message' in complaint(tmp_path / 'hollow')
    (tmp_path / 'nothing').mkdir()
    assert 'has no files of a bag, allowed: .mcap or .db3' in complaint(tmp_path / 'nothing')


@pytest.mark.parametrize('plugin', PLUGINS)
@pytest.mark.parametrize('empty', ['all', 'some'])
def test_empty_stamps_are_read_as_live_by_time_of_receipt(tmp_path, plugin, empty):
    written = rows(400, truth=False)
    with Bag(tmp_path / 'a', plugin) as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            own_ns = 0 if empty == 'all' or k % 3 == 1 else stamp_ns
            bag.write('/voltages', bag.joints(own_ns, row), stamp_ns)
    recording = open_recording(tmp_path / 'a')
    assert recording.sample_rate_hz == pytest.approx(380.0)
    check_same(gathered(recording), written)
