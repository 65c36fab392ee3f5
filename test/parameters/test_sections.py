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

"""Sections of ROS parameter files: which of them a node reads, and what is written to them."""

import pytest
import yaml

from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig, GraspConfig
from slip_detector.parameters.sections import parameter_file, parameters_for
from slip_detector.parameters.yaml_files import write_yaml
from support.config_cases import message_of


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / 'finger.yaml'
        path.write_text(text, encoding='utf-8')
        return path

    return to_file


def test_sections_for_all_nodes_count_and_those_of_other_nodes_do_not(write):
    path = write(
        """
        slip_driver: {ros__parameters: {seed: 3}}
        /**: {ros__parameters: {channels: 2, limit_n: 8.0, use_sim_time: true}}
        my_slip_detector: {ros__parameters: {threshold: nonsense}}
        finger: {slip_detector: {ros__parameters: {groups: {left: [1], right: [2]}}}}
        """
    )
    groups = {'left': (1,), 'right': (2,)}
    assert DetectorConfig.from_yaml(path) == DetectorConfig(channels=2, groups=groups)
    # The chain is read from the same section.
    assert ChainConfig.from_yaml(path) == ChainConfig(channels=2, groups=groups)
    assert DriverConfig.from_yaml(path) == DriverConfig(seed=3, channels=2)
    assert GraspConfig.from_yaml(path) == GraspConfig(limit_n=8.0)
    given = parameters_for(path, 'slip_detector', '/finger/slip_detector')
    assert given.own == {'groups.left': [1], 'groups.right': [2]}
    assert given.values == {'channels': 2, 'limit_n': 8.0, 'groups.left': [1], 'groups.right': [2]}


def test_of_the_robots_parameters_only_what_is_nearly_ours_is_told(write, caplog):
    path = write(
        """
        /**:
          ros__parameters:
            {robot_name: a, rate: {arm: 9}, sed: 1, lop: {arm: 1}, pakcet_scale: 1,
             qos_overrides: {/tf: 1}}
        slip_driver: {ros__parameters: {loop: true}}
        """
    )
    assert DriverConfig.from_yaml(path) == DriverConfig(loop=True)
    assert caplog.messages == [
        f'{path}: left out: parameter {label}, given to all nodes; {hint}'
        for label, hint in (
            ('sed = 1', 'did you mean seed?'),
            ('lop.arm = 1', 'did you mean loop?'),
            ('pakcet_scale = 1', 'did you mean packet_scale_v?'),
            ('qos_overrides./tf = 1', 'the quality of service of the topics cannot be changed'),
        )
    ]
    path = write(
        '/**: {ros__parameters: {robot_name: a}}\n'
        'slip_driver: {ros__parameters: {robot_name: b}}\n'
    )
    assert 'unknown parameter robot_name = ' in message_of(DriverConfig.from_yaml, path)


def test_a_running_node_has_what_ros_would_give_it(write):
    path = write(
        """
        /**/slip_detector: {ros__parameters: {threshold: 0.3, gain: 5.0}}
        /thumb/slip_detector: {ros__parameters: {threshold: 0.4}}
        /index/slip_detector: {ros__parameters: {threshold: 0.6}}
        /**: {ros__parameters: {seed: 3, heartbeat_hz: 20.0}}
        """
    )
    for finger, threshold in (('thumb', 0.4), ('index', 0.6), ('little', 0.3)):
        config = DetectorConfig.from_yaml(path, f'/{finger}/slip_detector')
        assert config == DetectorConfig(threshold=threshold, gain=5.0, heartbeat_hz=20.0)
    given = parameters_for(path, 'slip_detector', '/little/slip_detector')
    assert given.own == {'threshold': 0.3, 'gain': 5.0}
    assert given.unmatched == ['/thumb/slip_detector', '/index/slip_detector']
    said = 'has sections for /thumb/slip_detector, /index/slip_detector, allowed: one namespace'
    assert message_of(ChainConfig.from_yaml, path) == f'{path}: {said}'


def test_a_file_with_sections_for_other_names_of_the_node_is_refused(write):
    path = write('/thumb/slip_driver: {ros__parameters: {seed: 3}}\n')
    message = message_of(parameters_for, path, 'slip_driver', '/index/slip_driver')
    assert message == (
        f'{path}: has sections for /thumb/slip_driver, none for this node, /index/slip_driver, '
        'allowed: /index/slip_driver or /**/slip_driver'
    )
    path = write('/mine: {ros__parameters: {gain: 2, use_sim_time: true}}')
    assert parameters_for(path, 'slip_detector', '/mine') == ({'gain': 2}, {'gain': 2}, [])
    empty = write('/**/slip_driver: {ros__parameters: {}}\n')
    assert parameters_for(empty, 'slip_driver', '/index/slip_driver') == ({}, {}, [])


def test_a_node_of_another_name_takes_what_is_for_its_executable_without_a_section(write):
    text = '/hand/slip_detector: {ros__parameters: {gain: 2}}\n'
    path = write(text)
    assert parameters_for(path, 'slip_detector', '/hand/mine') == ({'gain': 2}, {'gain': 2}, [])
    assert DetectorConfig.from_yaml(path, '/hand/mine') == DetectorConfig(gain=2)
    write(f'{text}/hand/mine: {{ros__parameters: {{vote: 2}}}}')
    assert parameters_for(path, 'slip_detector', '/hand/mine').values == {'vote': 2}
    write(f'{text}/**: {{ros__parameters: {{gain: 3}}}}')  # ROS has given it this.
    said = 'has gain for slip_detector and for all nodes, allowed: a section for this node, '
    assert said in message_of(parameters_for, path, 'slip_detector', '/hand/mine')


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('slip_driver: {seed: 3}', 'section slip_driver/seed has no names under ros__parameters'),
        ('slip_driver:', 'section slip_driver has no names under ros__parameters'),
        ('slip_driver: {ros__parameters: [1]}', 'section slip_driver has no names under ros__'),
        ('/camera: {ros__parameters: {gain: 3.0}}', 'has no section of this package, allowed: '),
        ('slip_driver: {ros__parameters: {seed: -1}}', 'parameter seed is -1, allowed: 0 to'),
        ('slip_driver: {ros__parameters: {sed: 1}}', 'unknown parameter sed = 1; did you mean'),
        (
            'a-b: {ros__parameters: {seed: 1}}',
            "section 'a-b' is no name of a node, allowed: letters",
        ),
        ('nav: {ros__parameters: {a: [1, x]}}', "a is [1, 'x'], allowed: a number, a text, true"),
        ('nav: {ros__parameters: {a: }}', 'a is nothing, allowed: a number'),
        (
            'nav: {ros__parameters: {a: {b: [0.5, 10]}}}',
            'a.b is [0.5, 10], allowed: numbers of one kin',
        ),
        (
            'slip_driver: {ros__parameters: {qos_overrides: {/slip: {publisher: {depth: 1}}}}}',
            'unknown parameter qos_overrides./slip.publisher.depth = 1; the quality of service',
        ),
    ],
)
def test_a_bad_section_is_an_error_that_names_the_file(write, text, said):
    path = write(text)
    assert message_of(DriverConfig.from_yaml, path).startswith(f'{path}: {said}')


GIVEN = """
/**/slip_driver: {ros__parameters: {source: udp, channels: 2}}
/thumb/slip_detector: {ros__parameters: {use_sim_time: true, threshold: 0.7}}
detectors: {slip_tune: {ros__parameters: {trade: true}}}
/**: {ros__parameters: {channels: 2, threshold: 0.8, groups: {left: [1], right: [2]}}}
"""


def test_saving_keeps_the_sections_of_other_nodes_and_replaces_the_detectors(write, tmp_path):
    given_file = write(GIVEN)
    config = DetectorConfig(channels=2, threshold=0.5)
    path = tmp_path / 'saved.yaml'
    write_yaml(path, parameter_file({'/thumb/slip_detector': config}, given_file))
    assert DetectorConfig.from_yaml(path, '/thumb/slip_detector') == config
    assert DetectorConfig.from_yaml(path) == config
    assert DriverConfig.from_yaml(path) == DriverConfig(source='udp', channels=2)
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    assert document['/**/slip_detector']['ros__parameters']['use_sim_time'] is True
    assert document['detectors/slip_tune']['ros__parameters'] == {'trade': True}
    assert document['/**']['ros__parameters'] == {'channels': 2}
    # By a command, which knows no namespace.
    document = parameter_file({'/slip_detector': config}, given_file)
    assert document['/**/slip_detector']['ros__parameters']['use_sim_time'] is True
