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

"""Layouts: messages that are alike have their numbers at the same places."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.field_paths import FieldReader
from slip_detector.recordings.message_layout import begin_of, read_layout
from slip_detector.recordings.topics import JOINT_STATE

typesys = pytest.importorskip('rosbags.typesys', reason='needs rosbags')

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)


def joint_state(row, stamp_ns=0, names=('a', 'b', 'c'), frame_id='tip', little=True):
    types = STORE.types
    stamp = types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 1_000_000_000))
    header = types['std_msgs/msg/Header'](stamp, frame_id)
    position, nothing = np.array(row, dtype=np.float64), np.empty(0)
    message = types[JOINT_STATE](header, list(names), position, nothing, nothing)
    return bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little))


def batch(rows):
    types = STORE.types
    samples, channels = rows.shape
    dimension = types['std_msgs/msg/MultiArrayDimension']
    layout = types['std_msgs/msg/MultiArrayLayout'](
        [dimension('sample', samples, rows.size), dimension('channel', channels, channels)], 0
    )
    msgtype = 'std_msgs/msg/Float32MultiArray'
    data = rows.astype(np.float32).reshape(-1)
    return bytes(STORE.serialize_cdr(types[msgtype](layout, data), msgtype))


def layout_of(raw, field='position', msgtype=JOINT_STATE):
    return read_layout(raw, STORE, msgtype, FieldReader(field))


def block(*raws):
    return np.frombuffer(b''.join(raws), np.uint8).reshape(len(raws), -1)


@given(
    rows=st.lists(st.tuples(*[st.floats(allow_nan=False)] * 3), min_size=1, max_size=5),
    start_ns=st.integers(0, 2**60),
    little=st.booleans(),
)
def test_rows_and_stamps_of_messages_alike_are_cut_out(rows, start_ns, little):
    raws = [joint_state(row, start_ns + k, little=little) for k, row in enumerate(rows)]
    layout, messages = layout_of(raws[0]), block(*raws)
    assert layout.fits(messages).all()
    np.testing.assert_array_equal(layout.rows(messages)[:, 0], rows)
    assert layout.stamps_ns(messages).tolist() == [start_ns + k for k in range(len(rows))]
    assert layout.names == ('a', 'b', 'c')


def test_messages_with_other_texts_or_lengths_do_not_fit():
    layout = layout_of(joint_state([1, 2, 3]))
    others = [
        joint_state([4, 5, 6]),
        joint_state([4, 5, 6], frame_id='tap'),
        joint_state([4, 5, 6], names=('a', 'b', 'd')),
        joint_state([4, 5, 6], little=False),
    ]
    assert layout.fits(block(*others)).tolist() == [True, False, False, False]


@given(st.integers(1, 4), st.integers(1, 5))
def test_a_batch_has_a_row_for_each_sample_and_no_stamp(samples, channels):
    rows = np.random.default_rng(0).normal(size=(samples, channels)).astype(np.float32)
    layout = layout_of(batch(rows), 'data', 'std_msgs/msg/Float32MultiArray')
    np.testing.assert_array_equal(layout.rows(block(batch(rows), batch(2 * rows)))[1], 2 * rows)
    assert layout.stamps_ns(block(batch(rows))) is None
    # The layout that a MultiArray says it has is part of what has to agree.
    if samples != channels:
        turned = block(batch(rows.reshape(channels, samples)))
        assert not layout.fits(turned).any()


def test_numbers_of_different_types_are_found_each_at_its_place():
    layout = layout_of(joint_state([1.5, 2.5, 3.5]), 'header.stamp.nanosec')
    messages = block(joint_state([0, 0, 0], 7), joint_state([0, 0, 0], 1_000_000_009))
    assert layout.rows(messages).tolist() == [[[7.0]], [[9.0]]]
    assert begin_of(layout.places[0, 0]) == layout.stamp_bytes[1]


@given(st.integers(0, 300))
def test_a_message_that_is_cut_has_no_layout(size):
    raw = joint_state([1, 2, 3])
    if size < len(raw) - 8:  # The last list, which is empty, has nothing but its length.
        with pytest.raises((ValueError, LookupError)):
            layout_of(raw[:size])


def test_an_empty_field_has_no_layout():
    with pytest.raises(ValueError, match='the message is empty or longer than its fields'):
        layout_of(joint_state([], names=()))
