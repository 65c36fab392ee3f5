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

"""Serialised JointState messages against rclpy, and what field paths select in messages."""

import array
import contextlib
import dataclasses
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.messages import (
    JOINT_FIELDS,
    FieldReader,
    JointStateReader,
    JointStateWriter,
    joint_state_layout,
)

texts = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
numbers = st.floats(width=64)


def joint_state(**fields):
    """Return a JointState of rclpy."""
    return pytest.importorskip('sensor_msgs.msg', reason='needs ROS').JointState(**fields)


@st.composite
def messages(draw):
    message = joint_state(
        name=draw(st.lists(texts, max_size=4)),
        position=draw(st.lists(numbers, max_size=5)),
        velocity=draw(st.lists(numbers, max_size=3)),
        effort=draw(st.lists(numbers, max_size=3)),
    )
    message.header.frame_id = draw(texts)
    message.header.stamp.sec = draw(st.integers(-(2**31), 2**31 - 1))
    message.header.stamp.nanosec = draw(st.integers(0, 10**9 - 1))
    return message


def serialized(message):
    return pytest.importorskip('rclpy.serialization').serialize_message(message)


def stamp_ns(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


@given(st.lists(messages(), min_size=1, max_size=6), st.lists(st.integers(0, 5), max_size=12))
def test_messages_one_by_one_and_at_once_are_read_as_rclpy_reads_them(sent, order):
    sent += [sent[i % len(sent)] for i in order]
    readers = {field: JointStateReader(field) for field in JOINT_FIELDS}
    for message in sent:
        for field, reader in readers.items():
            check_read(reader, field, [message])
    alike = [message for message in sent if fixed_parts(message) == fixed_parts(sent[0])]
    for message in alike:
        message.header.stamp.sec += message.header.stamp.sec < 2**31 - 1
    for field in JOINT_FIELDS:
        check_read(JointStateReader(field), field, alike)
    if len(alike) < len(sent):
        with pytest.raises(ValueError, match='differ in texts or lengths'):
            JointStateReader('effort').read(list(map(serialized, sent)))


def fixed_parts(message):
    lengths = [len(numbers) for numbers in (message.position, message.velocity, message.effort)]
    return message.header.frame_id, list(message.name), lengths


def check_read(reader, field, alike):
    """Check what a reader reads of messages that differ in stamp and numbers only."""
    samples = reader.read(list(map(serialized, alike)))
    np.testing.assert_array_equal(samples.volts, [getattr(message, field) for message in alike])
    assert samples.volts.flags.writeable
    assert samples.volts.flags.aligned
    assert (samples.names, samples.frame_id) == (tuple(alike[0].name), alike[0].header.frame_id)
    assert samples.stamps_ns.tolist() == list(map(stamp_ns, alike))


@given(texts, st.lists(texts, min_size=1, max_size=4), st.booleans(), st.data())
def test_messages_are_written_as_rclpy_serialises_them(frame_id, names, efforts, data):
    writer = JointStateWriter(frame_id, names, efforts=efforts)
    rows = st.lists(numbers, min_size=len(names), max_size=len(names)).map(np.array)
    at_ns, position = data.draw(st.integers(-(10**18), 10**18)), data.draw(rows)
    effort = data.draw(rows) if efforts else None
    message = joint_state(name=names, position=position, effort=[] if effort is None else effort)
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(at_ns, 1_000_000_000)
    raw = writer.serialize(at_ns, position, effort)
    deserialized = pytest.importorskip('rclpy.serialization').deserialize_message
    # Some numbers are NaN, which equals nothing; padding may have any value.
    assert repr(deserialized(raw, type(message))) == repr(message)


@pytest.mark.parametrize('position', [[1.0], [1.0, 2.0, 3.0], np.ones(2, np.float32)])
def test_numbers_that_do_not_fill_a_message_are_an_error(position):
    with pytest.raises(ValueError, match='bytes of positions, allowed: 16'):
        JointStateWriter('tip', ['a', 'b']).serialize(5, np.asarray(position))


def test_padding_may_have_any_value():
    raw = JointStateWriter('tip', ['a', 'bc']).serialize(5, np.array([1.0, 2.0]))
    padded = bytearray(raw)
    padded[padded.index(b'bc\0') + 3] ^= 0xFF
    reader = JointStateReader()
    for one in (raw, bytes(padded)):
        assert reader.read([one]).names == ('a', 'bc')


@pytest.mark.parametrize('zeros', [1, 2, 5, 9, 16])
def test_a_text_that_is_filled_up_with_zeros_does_not_move_the_numbers(zeros):
    # With positions of zero, any place among the zeros would look right.
    raw = JointStateWriter('x' * zeros, ['a']).serialize(7, np.array([0.0]))
    filled = raw.replace(b'x' * zeros, bytes(zeros))
    sample = JointStateReader().read([filled])
    assert (sample.frame_id, sample.names, sample.volts.tolist()) == ('', ('a',), [[0.0]])


@given(st.binary(max_size=200), st.integers(0, 60))
def test_bytes_that_are_no_message_are_an_error_and_never_read_beyond_their_end(noise, cut):
    raw = JointStateWriter('tip', ['a', 'b']).serialize(5, np.array([1.0, 2.0]))
    for broken in (raw[:cut], raw[:16] + noise, b'\0\1\0\0' + noise):
        with contextlib.suppress(ValueError):
            layout = joint_state_layout(broken)
            assert max(numbers.stop for numbers in layout.numbers.values()) <= len(broken)
    big_endian = b'\0\0\0\0' + struct.pack('>iI', 3, 4)
    with pytest.raises(ValueError, match='little-endian'):
        joint_state_layout(big_endian)


def of(**fields):
    """Return a message with fields."""
    return dataclasses.make_dataclass('Message', list(fields))(**fields)


def message():
    pillars = [
        of(fz=float(i), force=of(x=10.0 + i, y=20.0 + i), torques=[i, -i]) for i in range(3)
    ]
    texts = {'name': ['a', 'b'], 'frame_id': 'tip'}
    ragged, hollow = [of(fz=[1.0]), of(fz=[1.0, 2.0])], [of(pac=array.array('h'))] * 5
    lists = {'raw': array.array('f', [1.5, 2.5]), 'ragged': ragged, 'hollow': hollow, 'none': []}
    return of(pillars=pillars, gain=2.5, **texts, **lists)


def batch(data, begin=0, **sizes):
    dim = [of(label=label, size=size) for label, size in sizes.items()]
    return of(layout=of(dim=dim, data_offset=begin), data=data)


@pytest.mark.parametrize(
    ('path', 'wanted'),
    [
        ('gain', [2.5]),
        ('raw', [1.5, 2.5]),
        ('raw[1]', [2.5]),
        ('pillars[].fz', [0.0, 1.0, 2.0]),
        ('pillars[].force.y', [20.0, 21.0, 22.0]),
        ('pillars[].torques[0]', [0.0, 1.0, 2.0]),
        ('Pillars[1].FZ', [1.0]),
        ('gain,pillars[].fz, pillars[].force.x', [2.5, 0.0, 1.0, 2.0, 10.0, 11.0, 12.0]),
        ('raw[:]', [[1.5], [2.5]]),
        ('pillars[].torques[:]', [[0.0, 1.0, 2.0], [0.0, -1.0, -2.0]]),
        ('pillars[:].torques', [[0.0, 0.0], [1.0, -1.0], [2.0, -2.0]]),
        ('pillars[1].torques[:], raw[:]', [[1.0, 1.5], [-1.0, 2.5]]),
        ('hollow[].pac[:]', np.empty((0, 0))),
    ],
)
def test_a_path_selects_the_numbers_in_their_order(path, wanted):
    rows = FieldReader(path)(message())
    assert rows.dtype == np.float64
    np.testing.assert_array_equal(rows, np.atleast_2d(wanted))


@pytest.mark.parametrize(
    ('path', 'said'),
    [
        ('pressure', 'no numbers at pressure, there are: pillars, gain, name, frame_id, raw'),
        ('pillars[0].force.z', 'no numbers at z, there are: x, y'),
        ('pillars[3].fz', 'no numbers at pillars[3], there are: pillars, gain'),
        ('pillars', 'no numbers at pillars, there are: [].fz, [].force, [].torques'),
        ('pillars[].force', 'no numbers at pillars[].force, there are: x, y'),
        ('gain.x', 'no numbers at x, there are: none'),
        ('frame_id[0]', 'no numbers at frame_id[0], there are: none'),
        ('name', 'no numbers at name, there are: none'),
        ('none[].fz', 'no numbers at none'),
        ('raw[:], gain', 'has [2, 1] rows, allowed: as many of each'),
        ('ragged[].fz[:]', 'has [1, 2] rows, allowed: as many of each'),
    ],
)
def test_a_wrong_path_is_refused_with_what_there_is(path, said):
    with pytest.raises(ValueError, match='field ') as caught:
        FieldReader(path)(message())
    assert f'field {path}: {said}' in str(caught.value)


@pytest.mark.parametrize(
    'path', ['', '.', 'a.', 'a[', 'a[x]', 'a[-1]', 'a b', '1a', 'a[0][1]', 'a,', 'a[:].b[:]']
)
def test_a_text_that_is_no_path_is_refused(path):
    with pytest.raises(ValueError, match='allowed: names joined by dots'):
        FieldReader(path)


@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 3))
def test_a_layout_of_sample_and_channel_gives_a_row_each(samples, channels, begin):
    data = np.arange(begin + samples * channels, dtype=np.float32)
    rows = FieldReader('data')(batch(data, begin, sample=samples, channel=channels))
    np.testing.assert_array_equal(rows, data[begin:].reshape(samples, channels))


def test_any_other_layout_is_one_row_and_one_that_does_not_fit_is_refused():
    data = np.arange(6.0)
    for one in (batch(data), batch(data, row=2, column=3)):
        np.testing.assert_array_equal(FieldReader('data')(one), [data])
    with pytest.raises(ValueError, match='cannot reshape array of size 6'):
        FieldReader('data')(batch(data, sample=2, channel=4))
