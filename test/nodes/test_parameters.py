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

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from rcl_interfaces.srv import GetParameters  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter, parameter_value_to_python  # noqa: E402

from slip_detector.nodes.parameters import changed, declare, follow_changes  # noqa: E402
from slip_detector.parameters.detector import DetectorConfig  # noqa: E402
from slip_detector.parameters.grasp import GraspConfig  # noqa: E402

NODES = ('slip_driver', 'slip_detector', 'grasp_controller')


@pytest.fixture
def make():
    """Return what makes nodes that were given parameters on the command line."""
    context = rclpy.Context()
    rclpy.init(context=context)
    nodes = []

    def make(**given):
        words = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
        node = Node(
            'of_test',
            context=context,
            cli_args=['--ros-args', *words] if words else None,
            allow_undeclared_parameters=True,
        )
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_what_was_given_is_declared_and_all_else_has_its_default(make):
    node = make(grip_n=3, limit_n=12.5)
    config = declare(node, GraspConfig)
    assert config == GraspConfig(grip_n=3.0, limit_n=12.5)
    for name, value in config.to_parameters().items():
        assert node.get_parameter(name).value == value
        assert node.describe_parameter(name).read_only


def test_a_change_is_taken_as_a_whole_with_numbers_as_their_fields_have_them(make):
    node = make()
    taken = [declare(node, DetectorConfig, fixed=('autostart',))]
    follow_changes(node, lambda: taken[-1], lambda config: None, taken.append)
    given = [Parameter('threshold', value=2), Parameter('vote', value='mean')]
    assert node.set_parameters_atomically(given).successful
    assert len(taken) == 2
    assert (taken[-1].threshold, taken[-1].vote) == (2.0, 'mean')
    assert node.get_parameter('threshold').type_ == Parameter.Type.DOUBLE


def test_groups_can_be_added_and_deleted_and_nothing_else_can(make):
    config = DetectorConfig()
    none = Parameter.Type.NOT_SET
    with_front = changed(config, [Parameter('groups.front', value=list(range(1, 17)))] + [
        Parameter(f'groups.{name}', none) for name in config.groups
    ])  # fmt: skip
    assert dict(with_front.groups) == {'front': tuple(range(1, 17))}
    with pytest.raises(ValueError, match=r'threshold cannot be deleted, allowed: groups.<name>'):
        changed(config, [Parameter('threshold', none)])


def test_parameters_of_rclpy_are_none_of_the_configuration(make):
    assert changed(DetectorConfig(), [Parameter('use_sim_time', value=True)]) == DetectorConfig()


def values_of(bench, node, *names):
    request = GetParameters.Request(names=names)
    values = bench.ask(GetParameters, f'{node}/get_parameters', request).values
    return [parameter_value_to_python(value) for value in values]


@pytest.mark.parametrize(
    ('node', 'section', 'words', 'name'),
    [
        ('slip_driver', '{node}', ['-r', '__ns:=/index'], '/index/{node}'),
        ('slip_detector', '/*/{node}', ['-r', '__ns:=/left/index'], '/left/index/{node}'),
        ('grasp_controller', '{node}', ['-r', '__node:=mine'], '/mine'),
    ],
)
def test_a_file_whose_sections_are_for_nodes_of_other_names_stops_the_start(
    bench, tmp_path, node, section, words, name
):
    file = tmp_path / 'robot.yaml'
    parameters = {'slip_driver': 'source: udp', 'slip_detector': 'threshold: 0.7'}
    section, name = section.format(node=node), name.format(node=node)
    file.write_text(
        f'{section}:\n  ros__parameters: {{{parameters.get(node, "limit_n: 8.0")}}}\n'
        # Neither of these is for it: one is for all nodes, and one for another.
        '/**:\n  ros__parameters: {use_sim_time: false}\n'
        '/**/other_node:\n  ros__parameters: {a: 1}\n'
    )
    line = bench.start(node, '--params-file', file, *words).refusal()
    assert line == (
        f'{node}: {file}: has sections for {section}, none for this node, {name}, allowed: '
        f'{name} or /**/{name.rpartition("/")[2]}'
    )


@pytest.mark.parametrize(
    ('section', 'words', 'name'),
    [
        ('/**/slip_detector', ['-r', '__ns:=/left/index'], '/left/index/slip_detector'),
        ('/*/slip_detector', ['-r', '__ns:=/index'], '/index/slip_detector'),
        ('/mine', ['-r', '__node:=mine'], '/mine'),
        ('/index/**', ['-r', '__ns:=/index'], '/index/slip_detector'),
    ],
)
def test_a_section_is_taken_where_ros_takes_it(bench, tmp_path, section, words, name):
    file = tmp_path / 'robot.yaml'
    text = f'{section}:\n  ros__parameters: {{threshold: 0.7}}\n'
    if '*' in section:  # else as ros2 param dump writes it
        text += '/**/slip_driver:\n  ros__parameters: {source: udp}\n'
    file.write_text(text)
    bench.start('slip_detector', '--params-file', file, *words)
    assert values_of(bench, name, 'threshold') == [0.7]


@pytest.mark.parametrize(
    ('node', 'section', 'parameter'),
    [
        ('slip_driver', '/**', 'sample_rate_h: 400.0'),
        ('slip_detector', '/**/{node}', 'missed_costs_ms: 1.0'),
        ('grasp_controller', '/**/{node}', 'sample_rate_h: 400.0'),
    ],
)
def test_an_unknown_name_keeps_each_node_from_starting(bench, tmp_path, node, section, parameter):
    file = tmp_path / 'typo.yaml'
    file.write_text(f'{section.format(node=node)}:\n  ros__parameters: {{{parameter}}}\n')
    process = bench.start(node, '--params-file', file)
    line = process.refusal()
    name, _, value = parameter.partition(': ')
    assert line.startswith(f'{node}: unknown parameter {name} = {value}; ')
