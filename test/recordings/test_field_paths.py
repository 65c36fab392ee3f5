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

"""Field paths: what they select, on messages of any origin, and what is said where they do not."""

import array
import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.field_paths import FieldReader, field_names


@dataclasses.dataclass
class Vector:
    x: float
    y: float


@dataclasses.dataclass
class Pillar:
    fz: float
    force: Vector
    torques: Any


@dataclasses.dataclass
class Array:
    pillars: list
    gain: float
    raw: Any
    name: list
    frame_id: str


@dataclasses.dataclass
class Dimension:
    label: str
    size: int
    stride: int = 0


@dataclasses.dataclass
class Layout:
    dim: list
    data_offset: int = 0


@dataclasses.dataclass
class MultiArray:
    layout: Layout
    data: Any


def message(n=3):
    pillars = [Pillar(float(i), Vector(10.0 + i, 20.0 + i), [i, -i]) for i in range(n)]
    return Array(pillars, 2.5, array.array('f', [1.5, 2.5]), ['a', 'b'], 'tip')


@pytest.mark.parametrize(
    ('path', 'wanted'),
    [
        ('gain', [2.5]),
        ('raw', [1.5, 2.5]),
        ('raw[]', [1.5, 2.5]),
        ('raw[1]', [2.5]),
        ('pillars[].fz', [0.0, 1.0, 2.0]),
        ('pillars[2].fz', [2.0]),
        ('pillars[].force.y', [20.0, 21.0, 22.0]),
        ('pillars[].torques', [0.0, 0.0, 1.0, -1.0, 2.0, -2.0]),
        ('pillars[].torques[0]', [0.0, 1.0, 2.0]),
        ('pillars[1].torques[]', [1.0, -1.0]),
    ],
)
def test_a_path_selects_the_numbers_in_their_order(path, wanted):
    row = FieldReader(path)(message())
    assert row.dtype == np.float64
    np.testing.assert_array_equal(row, [wanted])


@pytest.mark.parametrize(
    ('path', 'said'),
    [
        ('pressure', 'Array has no pressure, there are: pillars, gain, raw, name, frame_id'),
        ('pillars[].fx', 'pillars[0] has no fx, there are: fz, force, torques'),
        ('pillars[0].force.z', 'pillars[0].force has no z, there are: x, y'),
        ('pillars[3].fz', 'pillars has 3 elements, allowed: below that'),
        ('pillars', 'pillars is no list of numbers, allowed: numbers, such as pillars[].fz'),
        ('pillars.fz', 'pillars is no message, allowed: pillars[] or pillars[0]'),
        ('pillars[].force', 'pillars[0].force is a message, allowed: one of its fields: pillars'),
        ('gain[]', 'gain is no list, allowed: gain without []'),
        ('gain.x', 'gain is no message, allowed: the path to end here'),
        ('frame_id', 'frame_id is text, allowed: numbers'),
        ('frame_id[0]', 'frame_id is no list'),
        ('name', 'name is no list of numbers, allowed: numbers'),
        ('name[0]', 'name[0] is text, allowed: numbers'),
    ],
)
def test_what_is_not_there_is_named_with_what_is(path, said):
    with pytest.raises(ValueError, match='field ') as caught:
        FieldReader(path)(message())
    assert f'field {path}: {said}' in str(caught.value)


def test_an_empty_list_of_messages_is_said_to_be_empty():
    with pytest.raises(ValueError, match=r'field pillars\[\]\.fz: pillars is empty'):
        FieldReader('pillars[].fz')(message(0))


@pytest.mark.parametrize('path', ['', '.', 'a.', 'a[', 'a[x]', 'a[-1]', 'a b', '1a', 'a[0][1]'])
def test_a_path_that_is_none_is_refused_with_what_is_one(path):
    with pytest.raises(ValueError, match='allowed: names joined by dots'):
        FieldReader(path)


@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 3))
def test_a_layout_of_sample_and_channel_gives_a_row_each(samples, channels, begin):
    data = np.arange(begin + samples * channels, dtype=np.float32)
    layout = Layout([Dimension('sample', samples), Dimension('channel', channels)], begin)
    rows = FieldReader('data')(MultiArray(layout, data))
    np.testing.assert_array_equal(rows, data[begin:].reshape(samples, channels))


def test_any_other_layout_is_one_row():
    data = np.arange(6.0)
    for layout in (Layout([]), Layout([Dimension('row', 2), Dimension('column', 3)])):
        np.testing.assert_array_equal(FieldReader('data')(MultiArray(layout, data)), [data])


def test_a_layout_that_does_not_fit_its_numbers_is_refused():
    layout = Layout([Dimension('sample', 2), Dimension('channel', 4)])
    with pytest.raises(ValueError, match='field data: has 6 numbers, allowed: 2 x 4'):
        FieldReader('data')(MultiArray(layout, np.arange(6.0)))


def test_messages_of_rclpy_and_of_bags_are_read_alike():
    ros = pytest.importorskip('sensor_msgs.msg', reason='needs ROS messages')
    std = pytest.importorskip('std_msgs.msg')
    typesys = pytest.importorskip('rosbags.typesys')
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY).types
    channels = [ros.ChannelFloat32(name='a', values=[1.0, 2.0]), ros.ChannelFloat32(values=[3.0])]
    cloud = ros.PointCloud(channels=channels)
    theirs = [
        types['sensor_msgs/msg/ChannelFloat32'](one.name, np.array(one.values)) for one in channels
    ]
    other = types['sensor_msgs/msg/PointCloud'](header=None, points=[], channels=theirs)
    for message in (cloud, other):
        np.testing.assert_array_equal(FieldReader('channels[].values')(message), [[1, 2, 3]])
        with pytest.raises(ValueError, match='PointCloud has no intensity, there are: header, '):
            FieldReader('intensity')(message)
    joints = ros.JointState(position=[0.5, 0.25])
    np.testing.assert_array_equal(FieldReader('position')(joints), [[0.5, 0.25]])
    dimensions = [
        std.MultiArrayDimension(label='sample', size=2),
        std.MultiArrayDimension(label='channel', size=1),
    ]
    batch = std.Float32MultiArray(data=[1.0, 2.0])
    batch.layout.dim = dimensions
    np.testing.assert_array_equal(FieldReader('data')(batch), [[1.0], [2.0]])


def test_what_is_no_message_has_no_fields():
    assert field_names(np.ones(3)) == field_names('text') == field_names(3.0) == []


@pytest.mark.parametrize('kind', [np.ndarray, array.array])
def test_a_nan_of_the_signalling_kind_is_a_nan_without_a_warning(kind):
    signalling = np.array([0x7F810000, 0x3F800000], np.uint32).view(np.float32)
    data = signalling if kind is np.ndarray else array.array('f', signalling.tobytes())
    message = dataclasses.make_dataclass('Message', ['data'])(data)
    rows = FieldReader('data')(message)
    np.testing.assert_array_equal(rows, [[np.nan, 1.0]])
