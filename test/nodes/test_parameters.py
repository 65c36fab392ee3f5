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

"""Configurations as parameters of a node, in this process and of each node with a file."""

import pytest
from rclpy.node import Node

from slip_detector.nodes.parameters import declare
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.grasp import GraspConfig

NODES = ('slip_driver', 'slip_detector', 'grasp_controller')


def test_what_was_given_is_declared_and_all_else_has_its_default(bench):
    words = ['--ros-args', '-p', 'grip_n:=3', '-p', 'limit_n:=12.5']
    node = Node('of_test', context=bench.context, cli_args=words)
    config = declare(node, GraspConfig)
    assert config == GraspConfig(grip_n=3.0, limit_n=12.5)
    for name, value in config.to_parameters().items():
        assert node.get_parameter(name).value == value
        assert node.describe_parameter(name).read_only
    node.destroy_node()


def test_numbers_have_their_range_in_the_description(bench):
    node = Node('of_test', context=bench.context)
    declare(node, DetectorConfig)
    for name in ('channels', 'gain', 'passband_hz', 'decision'):
        described, field = node.describe_parameter(name), DetectorConfig.__dataclass_fields__[name]
        ranges = [*described.floating_point_range, *described.integer_range]
        bounds = [(field.metadata['low'], field.metadata['high'])] * (name in ('channels', 'gain'))
        assert [(each.from_value, each.to_value) for each in ranges] == bounds
    node.destroy_node()


@pytest.mark.parametrize(
    ('section', 'words', 'name'),
    [
        ('/**/slip_detector', ['-r', '__ns:=/left/index'], '/left/index/slip_detector'),
        ('/*/slip_detector', ['-r', '__ns:=/index'], '/index/slip_detector'),
        ('/mine', ['-r', '__node:=mine'], '/mine'),
        ('/**/slip_detector', ['-r', '__node:=mine'], '/mine'),
        ('/index/**', ['-r', '__ns:=/index'], '/index/slip_detector'),
    ],
)
def test_a_section_is_taken_where_ros_takes_it_and_for_another_name(
    bench, tmp_path, section, words, name
):
    file = tmp_path / 'robot.yaml'
    text = f'{section}:\n  ros__parameters: {{threshold: 0.7}}\n'
    if '*' in section:  # else as ros2 param dump writes it
        text += '/**/slip_driver:\n  ros__parameters: {source: udp}\n'
    file.write_text(text)
    bench.start('slip_detector', '--params-file', file, *words)
    assert bench.values_of(name, 'threshold') == [0.7]


@pytest.mark.parametrize('node', NODES)
def test_a_wrong_parameter_keeps_the_node_it_is_given_to_from_starting(bench, tmp_path, node):
    file = tmp_path / 'typo.yaml'
    file.write_text(f'/**/{node}:\n  ros__parameters: {{missed_costs_ms: 1.0}}\n')
    line = bench.start(node, '--params-file', file).refusal()
    said = f'{file}: unknown parameter missed_costs_ms = 1.0; it is a parameter of'
    assert line.startswith(f'{node}: {said}')
    file.write_text(f'/**/{node}:\n  ros__parameters: {{use_sim_time: false}}\n')
    line = bench.start(node, '--params-file', file, '-p', f'{node}:robot_name:=a').refusal()
    assert line.startswith(f'{node}: unknown parameter robot_name = ')


def test_what_all_nodes_are_given_ends_none_and_what_may_be_meant_for_one_is_told(bench, tmp_path):
    file = tmp_path / 'robot.yaml'
    file.write_text(
        '/**:\n  ros__parameters: {robot_name: a, treshold: 0.7, arm: {rate: 9}}\n'
        '/**/slip_detector:\n  ros__parameters: {gain: 50.0}\n'
        '/ringg/slip_detector:\n  ros__parameters: {gain: 60.0}\n'
    )
    # As SetParameter of a launch file gives it.
    words = ['-p', 'robot_name:=a', '--params-file', file, '-r', '__ns:=/ring', '-p', 'gain:=70.0']
    process = bench.start('slip_detector', *words)
    # What comes after the file holds over it, though for all nodes as what came before.
    assert bench.values_of('/ring/slip_detector', 'gain', 'threshold') == [70.0, 0.5]
    warnings = [line.partition(']: ')[2] for line in process.lines() if '[WARN]' in line]
    assert warnings == [
        'left out: parameter treshold = 0.7, given to all nodes; did you mean threshold?',
        f'{file}: no node of this process has the name of /ringg/slip_detector',
    ]
    for node in ('slip_driver', 'grasp_controller'):
        given = {'source': 'scene'} if node == 'slip_driver' else {}
        process = bench.start(node, *words, parameters=given)
        assert bench.values_of(f'/ring/{node}', 'use_sim_time') == [False]
        # A busy machine may be late with the scene.
        warned = [line for line in process.lines() if '[WARN]' in line]
        assert [line for line in warned if ' late: ' not in line] == []
