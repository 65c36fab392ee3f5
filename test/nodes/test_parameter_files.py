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

"""A parameter file means for ROS what it means for the commands, or the commands refuse it."""

import contextlib

import rclpy
from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Node

from slip_detector.nodes.rclpy_internals import read_given_parameters
from slip_detector.parameters import DetectorConfig, DriverConfig
from slip_detector.parameters.sections import parameters_for
from slip_detector.parameters.yaml_files import write_yaml


def read_by_ros(path, name):
    """Return what a node gets from a file."""
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    node = Node(name, context=context, start_parameter_services=False, enable_rosout=False)
    values = {each.name: each.value for each in read_given_parameters(node)}
    rclpy.shutdown(context=context)
    return values


def without_type(values):
    """Return values as ROS has them: a list without items has no type, and no value."""
    return {name: None if value == [] else value for name, value in values.items()}


#: Values as people write them, and pieces of such.
WRITTEN = (
    *('[10, 100.0]', '[true, 1]', '[a, 1]', '[1, 2]', '[a, b]', '[x, y]', '[]', '[[1, 2]]', '{}'),
    *('1e3', '.5', '5.', '-.5', '+1', '08', '0x10', '1_000', '1:30', '.inf', '-.INF', 'nan', '0'),
    *('yes', 'No', 'tRue', 'y', 'null', '~', '', '"1"', "'y'", 'a b', '2026-11-28', '{a.b: 1}'),
    *('9223372036854775807', '9223372036854775808', '1e-30', '!!str 1', '!!float 1'),
    *('{<<: {a: 1}}', '{1: 2}', '{true: 2}', '{null: 1}', '{"": 1}', '[{a: 1}]', '[1, ]', '<<'),
)
PIECES = st.sampled_from(['0', '17', '.', 'e', '-', '+', '_', 'x', 'y', ', ', '[', ']', '~'])


@given(st.sampled_from(WRITTEN) | st.lists(PIECES, max_size=6).map(''.join))
def test_ros_reads_the_values_that_the_commands_read(tmp_path_factory, written):
    path = tmp_path_factory.getbasetemp() / 'written.yaml'
    path.write_text(f'slip_driver:\n  ros__parameters:\n    a: {written}\n')
    with contextlib.suppress(ValueError):  # What is refused need not be the same.
        taken = parameters_for(path, 'slip_driver').values
        assert repr(read_by_ros(path, 'slip_driver')) == repr(without_type(taken))


#: Words that YAML takes for something else.
WORDS = ('on', 'no', 'null', 'y', 'NaN', 'e1')


@given(
    text=st.text(st.characters(exclude_characters='\0'), min_size=1)
    | st.sampled_from([*WRITTEN[9:], *WORDS]),
    number=st.floats(1e-6, 1e6),
    names=st.permutations(WORDS),
    stopbands=st.lists(st.tuples(st.floats(0.1, 9.0), st.floats(9.5, 180.0)), max_size=3),
)
def test_ros_and_the_commands_read_the_values_that_are_written(
    tmp_path_factory, text, number, names, stopbands
):
    path = tmp_path_factory.getbasetemp() / 'whole.yaml'
    groups = {name: [k] for k, name in enumerate(names, 1)}
    detector = DetectorConfig(
        channels=6, groups=groups, gain=number, stopbands_hz=stopbands, channel_names=names,
        noise_floor=[number], taxel_positions_m=[number / 1e6] * 18, publish_groups=False,
    )  # fmt: skip
    for config in (detector, DriverConfig(frame_id=text, recording=text)):
        write_yaml(path, config.to_document())
        assert read_by_ros(path, config.NODE) == without_type(config.to_parameters())
        assert type(config).from_yaml(path) == config
    assert list(detector.from_parameters(detector.to_parameters()).groups) == names
