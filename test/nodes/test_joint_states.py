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

"""Serialised messages read without rclpy's conversion, against what rclpy makes of them."""

import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from slip_detector.nodes import joint_states
from slip_detector.nodes.inputs import Input
from slip_detector.nodes.joint_states import (
    JointStateReader,
    JointStateWriter,
    places_in,
    read_joint_states,
)
from slip_detector.nodes.messages import stamp_ns, time_message
from slip_detector.parameters.detector import DetectorConfig

PUBLISHED_NS = 7
PUBLISHED = {'source_timestamp': PUBLISHED_NS, 'publication_sequence_number': 3}

texts = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
numbers = st.floats(width=64)
stamps = st.integers(-(2**31), 2**31 - 1)
nanoseconds = st.integers(0, 10**9 - 1)


@st.composite
def messages(draw):
    message = JointState(
        name=draw(st.lists(texts, max_size=4)),
        position=draw(st.lists(numbers, min_size=1, max_size=5)),
        velocity=draw(st.lists(numbers, max_size=3)),
        effort=draw(st.lists(numbers, max_size=3)),
    )
    message.header.frame_id = draw(texts)
    message.header.stamp.sec, message.header.stamp.nanosec = draw(stamps), draw(nanoseconds)
    return message


def assert_same(sample, message):
    np.testing.assert_array_equal(sample.rows, [message.position])
    assert sample.rows.flags.writeable
    assert sample.rows.flags.aligned
    assert sample.names == list(message.name)
    assert sample.frame_id == message.header.frame_id
    assert sample.stamp_ns == (stamp_ns(message.header.stamp) or PUBLISHED_NS)


def a_message(position=(1.0, 2.0), name=('a', 'bc'), frame_id='tip', at_ns=5):
    message = JointState(position=position, name=list(name))
    message.header.frame_id = frame_id
    message.header.stamp = time_message(at_ns)
    return message


@given(st.lists(messages(), min_size=1, max_size=6))
def test_any_messages_in_any_order_are_read_as_rclpy_reads_them(sent):
    source = Input(DetectorConfig())
    for message in sent:
        raw = serialize_message(message)
        assert_same(source.read(raw, PUBLISHED), message)


@given(messages(), st.data())
def test_a_message_that_differs_in_stamp_and_numbers_is_alike(first, data):
    second = deserialize_message(serialize_message(first), JointState)
    n = len(first.position)
    second.position = data.draw(st.lists(numbers, min_size=n, max_size=n))
    second.header.stamp = time_message(data.draw(st.integers(1, 10**18)))
    reader = JointStateReader(serialize_message(first), first)
    sample = reader.read(serialize_message(second))
    assert sample is not None
    assert_same(sample, second)


@given(texts, st.lists(texts, min_size=1, max_size=4), st.booleans(), st.data())
def test_what_is_written_is_what_rclpy_serialises(frame_id, names, efforts, data):
    writer = JointStateWriter(frame_id, names, efforts=efforts)
    rows = st.lists(numbers, min_size=len(names), max_size=len(names)).map(np.array)
    for _ in range(2):
        at_ns, position = data.draw(st.integers(0, 10**18)), data.draw(rows)
        effort = data.draw(rows) if efforts else None
        raw = writer.written(at_ns, position, effort)
        assert isinstance(raw, bytes)
        read = deserialize_message(raw, JointState)
        assert (list(read.name), read.header.frame_id) == (names, frame_id)
        assert stamp_ns(read.header.stamp) == at_ns
        np.testing.assert_array_equal(read.position, position)
        np.testing.assert_array_equal(read.effort, effort if efforts else [])
        assert not read.velocity


@pytest.mark.parametrize('position', [[1.0], [1.0, 2.0, 3.0], np.ones(2, np.float32)])
def test_numbers_that_do_not_fill_a_message_are_an_error(position):
    writer = JointStateWriter('tip', ['a', 'b'])
    with pytest.raises(ValueError, match='assignment'):
        writer.written(5, np.asarray(position))


def test_where_a_middleware_serialises_in_another_way_messages_are_made(monkeypatch):
    monkeypatch.setattr(
        joint_states, 'serialize_message', lambda message: b'\1' + serialize_message(message)
    )
    writer = JointStateWriter('tip', ['a', 'b'], efforts=True)
    message = writer.written(5, np.array([1.0, 2.0]), np.array([0.0, 1.0]))
    assert message == JointState(
        header=a_message(at_ns=5).header, name=['a', 'b'], position=[1.0, 2.0], effort=[0.0, 1.0]
    )


def test_what_pads_a_message_may_be_anything():
    message = a_message()
    raw = bytearray(serialize_message(message))
    place = raw.index(b'bc\0') + 3  # of one byte that brings the next length to a multiple of 4
    reader = JointStateReader(bytes(raw), message)
    raw[place] ^= 0xFF
    assert deserialize_message(bytes(raw), JointState).name == message.name
    sample = reader.read(bytes(raw))
    assert sample is not None
    assert_same(sample, message)


@pytest.mark.parametrize(
    'other',
    [
        {'name': ('a', 'bd')},
        {'name': ('ab', 'c')},
        {'name': ()},
        {'frame_id': 'top'},
        {'position': (1.0, 2.0, 3.0)},
        {'position': (1.0,)},
    ],
)
def test_a_message_with_other_texts_or_lengths_is_not_alike(other):
    first = a_message()
    reader = JointStateReader(serialize_message(first), first)
    assert reader.read(serialize_message(a_message(**other))) is None


def test_a_message_that_was_cut_off_or_is_something_else_is_refused_in_one_line():
    source = Input(DetectorConfig())
    message = a_message()
    raw = serialize_message(message)
    assert_same(source.read(raw, PUBLISHED), message)
    for broken in (raw[:50], raw[:20], raw[:4], b'', raw[:4] + b'\xff' * 60):
        with pytest.raises(ValueError, match=r'^a message is no sensor_msgs/msg/JointState$'):
            source.read(broken, PUBLISHED)
    assert_same(source.read(raw, PUBLISHED), message)


def test_a_message_of_a_machine_with_the_other_byte_order_is_read():
    # Header without a frame, no names, one position, nothing else.
    raw = b'\0\0\0\0' + struct.pack('>iI', 3, 4) + struct.pack('>I', 1) + b'\0' * 4
    raw += struct.pack('>I', 0) + struct.pack('>I', 1) + struct.pack('>d', 2.5)
    raw += struct.pack('>II', 0, 0)
    sample = Input(DetectorConfig()).read(raw, PUBLISHED)
    np.testing.assert_array_equal(sample.rows, [[2.5]])
    assert sample.stamp_ns == 3_000_000_004


@pytest.mark.parametrize(('replayed', 'wanted'), [(False, PUBLISHED_NS), (True, None)])
def test_an_empty_stamp_is_that_of_publication_unless_time_is_replayed(replayed, wanted):
    source = Input(DetectorConfig())
    source.replayed = replayed
    raw = serialize_message(a_message(at_ns=0))
    for _ in range(2):
        assert source.read(raw, PUBLISHED).stamp_ns == wanted


def padded(message, zeros):
    """Serialise a message as writers do that fill texts up with zeros."""
    raw = serialize_message(message)
    text = message.header.frame_id.encode() + b'\0'
    wanted = message.header.frame_id.encode() + bytes(zeros)
    rest = JointState(name=message.name, position=message.position)
    rest.header.frame_id = 'x' * (len(wanted) - 1)
    whole = bytearray(serialize_message(rest))
    whole[4:12] = raw[4:12]
    whole[16 : 16 + len(wanted)] = wanted
    assert raw[16 : 16 + len(text)] == text
    return bytes(whole)


@pytest.mark.parametrize('zeros', [1, 2, 5, 9, 16])
def test_a_text_that_is_padded_with_zeros_does_not_move_the_positions(zeros):
    # With positions of zero, any place among the zeros would look right.
    source = Input(DetectorConfig())
    for position in ((0.0, 0.0), (1.5, -2.5), (0.0, 3.5)):
        message = a_message(position)
        sample = source.read(padded(message, zeros), PUBLISHED)
        assert sample.rows.tolist() == [list(position)]
        assert sample.frame_id.rstrip('\0') == 'tip'


@given(st.binary(max_size=200), messages())
def test_no_bytes_are_read_beyond_the_message(noise, message):
    raw = serialize_message(message)
    for cut in (raw[: len(raw) // 2], raw[:16] + noise, b'\x00\x01\x00\x00' + noise):
        with contextlib.suppress(ValueError):
            fixed, begin, n = places_in(cut)
            assert max(fixed) < len(cut)
            assert begin > max(fixed)
            assert n >= 0


@given(st.lists(messages(), max_size=6), st.integers(1, 5), st.booleans(), st.data())
def test_many_at_once_are_read_as_one_by_one(sent, joints, alike, data):
    if alike and sent:
        # As the detector sends them: only stamp and numbers differ.
        rows = st.lists(numbers, min_size=joints, max_size=joints)
        first, n = sent[0], data.draw(st.integers(1, 5))
        sent = []
        for _ in range(n):
            message = JointState(name=first.name, position=data.draw(rows), effort=data.draw(rows))
            message.header.frame_id = first.header.frame_id
            message.header.stamp = time_message(data.draw(st.integers(0, 10**18)))
            sent.append(message)
    raws = [serialize_message(message) for message in sent]
    fit = [m for m in sent if len(m.position) == len(m.effort) == joints]
    read = read_joint_states(raws, joints)
    assert read.stamps_ns.tolist() == [stamp_ns(message.header.stamp) for message in fit]
    for name in ('position', 'effort'):
        wanted = np.reshape([getattr(message, name) for message in fit], (-1, joints))
        np.testing.assert_array_equal(getattr(read, name), wanted)


def test_what_is_no_message_is_left_out():
    writer = JointStateWriter('tip', ['a'], efforts=True)
    good = bytes(writer.written(5, np.array([1.0]), np.array([0.0])))
    for bad in (b'', b'\0\1', good[:20]):
        read = read_joint_states([bad, good], 1)
        assert read.stamps_ns.tolist() == [5]
        assert read_joint_states([bad], 1).position.shape == (0, 1)
