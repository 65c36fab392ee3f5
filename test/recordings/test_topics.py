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

"""Types of topics: as the bag defines them, or those of ROS itself."""

import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from slip_detector.recordings.topics import JOINT_STATE, Topic, standard_typestore, typestore_of

PILLAR = 'tactile_msgs/msg/Pillar'


def fields(store, msgtype):
    return [name for name, _ in store.fielddefs[msgtype][1]]


def test_a_type_is_read_from_its_definition():
    rule = '=' * 80
    text = f'Pillar[] pillars\n{rule}\nMSG: {PILLAR}\nfloat32 fz\n'
    array = 'tactile_msgs/msg/Array'
    store = typestore_of(Topic('/a', array, 'ros2msg', text))
    assert fields(store, array) == ['pillars']
    assert fields(store, PILLAR) == ['fz']


@pytest.mark.parametrize('parts', [1, 2])
def test_a_type_is_read_from_idl_in_one_part_or_several(parts):
    inner = 'module tactile_msgs { module msg { struct Pillar { float fz; }; }; };'
    outer = (
        'module tactile_msgs { module msg { struct Pair { tactile_msgs::msg::Pillar a; }; }; };'
    )
    if parts == 1:
        store = typestore_of(Topic('/a', PILLAR, 'ros2idl', inner))
        assert fields(store, PILLAR) == ['fz']
        return
    rule = '=' * 80
    text = f'{rule}\nIDL: tactile_msgs/msg/Pair\n{outer}\n{rule}\nIDL: {PILLAR}\n{inner}\n'
    store = typestore_of(Topic('/a', 'tactile_msgs/msg/Pair', 'ros2idl', text))
    assert fields(store, 'tactile_msgs/msg/Pair') == ['a']
    assert fields(store, PILLAR) == ['fz']


def test_without_a_definition_a_type_of_ros_is_known_and_another_is_named():
    assert 'position' in fields(typestore_of(Topic('/a', JOINT_STATE, '', '')), JOINT_STATE)
    with pytest.raises(ValueError, match=f'does not define the type {PILLAR} of /a'):
        typestore_of(Topic('/a', PILLAR, '', ''))


@pytest.mark.parametrize('encoding', ['ros2msg', 'ros2idl'])
def test_a_broken_definition_is_said_in_one_line(encoding):
    with pytest.raises(ValueError, match=f'the definition of {PILLAR} cannot be read') as caught:
        typestore_of(Topic('/a', PILLAR, encoding, 'float32 [[ fz\n}'))
    assert '\n' not in str(caught.value)


def test_the_code_of_a_type_is_compiled_once_for_all_recordings():
    text = 'float32 fz\n'
    store = typestore_of(Topic('/a', PILLAR, 'ros2msg', text))
    assert typestore_of(Topic('/a', PILLAR, 'ros2msg', text)) is store
    other = typestore_of(Topic('/a', PILLAR, 'ros2msg', 'float32 fx\n'))
    assert fields(other, PILLAR) == ['fx']
    assert fields(store, PILLAR) == ['fz']
    assert standard_typestore() is standard_typestore()
    assert 'position' in fields(standard_typestore(), JOINT_STATE)


@pytest.mark.parametrize(
    ('encoding', 'text'),
    [
        ('ros2msg', 'uint8 level = \n}'),
        ('ros2msg', 'missing_msgs/Other level\n'),
        ('ros2idl', 'module sensor_msgs { uint8 level'),
        ('ros2msg', 'x' * 300_000),
        ('unknown', 'float64 a'),
    ],
)
def test_where_the_definition_is_broken_a_type_of_ros_is_known(encoding, text):
    store = typestore_of(Topic('/a', JOINT_STATE, encoding, text))
    assert 'position' in fields(store, JOINT_STATE)
