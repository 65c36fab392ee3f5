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

"""ROS parameter files: which sections a node reads, and what is refused."""

import pytest

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.parameters.reading import names_for_others, read_parameter_file
from support.config_cases import SETS, message_of


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / 'finger.yaml'
        path.write_text(text, encoding='utf-8')
        return path

    return to_file


@pytest.mark.parametrize(
    'section',
    ['slip_detector', '/slip_detector', '/left/slip_detector', '/**/slip_detector', '/**'],
)
def test_the_nodes_section_is_read_in_any_namespace(write, section):
    path = write(f'{section}:\n  ros__parameters:\n    threshold: 0.7\n')
    assert ChainConfig.from_yaml(path) == ChainConfig(threshold=0.7)
    assert DetectorConfig.from_yaml(str(path)) == DetectorConfig(threshold=0.7)


def test_sections_of_other_nodes_are_ignored_and_common_ones_count(write):
    path = write(
        """
        slip_driver:
          ros__parameters: {seed: 3, loop: true}
        /**:
          ros__parameters: {channels: 2}
        my_slip_detector:
          ros__parameters: {threshold: nonsense}
        /finger/slip_detector:
          ros__parameters:
            threshold: 0.9
            groups: {left: [1], right: [2]}
        """
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(
        channels=2, threshold=0.9, groups={'left': [1], 'right': [2]}
    )
    assert read_parameter_file(path, 'slip_detector') == {
        'channels': 2,
        'threshold': 0.9,
        'groups.left': [1],
        'groups.right': [2],
    }
    assert read_parameter_file(path, 'slip_driver') == {'channels': 2, 'seed': 3, 'loop': True}
    assert read_parameter_file(path, 'grasp_controller') == {}


def test_what_a_file_has_for_a_node_that_runs_is_what_ros_would_give_it(write):
    path = write(
        """
        /**/slip_detector:
          ros__parameters: {threshold: 0.3, gain: 5.0}
        /thumb/slip_detector:
          ros__parameters: {threshold: 0.4}
        /index/slip_detector:
          ros__parameters: {threshold: 0.6}
        /**:
          ros__parameters: {seed: 3, heartbeat_hz: 20.0}
        """
    )
    read = [
        read_parameter_file(path, 'slip_detector', running=f'/{finger}/slip_detector')
        for finger in ('thumb', 'index', 'little')
    ]
    assert [values['threshold'] for values in read] == [0.4, 0.6, 0.3]
    assert all(values['gain'] == 5.0 and values['heartbeat_hz'] == 20.0 for values in read)
    assert not any('seed' in values for values in read)


def test_a_file_without_a_section_for_the_node_gives_the_defaults(write):
    path = write('slip_driver:\n  ros__parameters:\n    seed: 3\n')
    assert ChainConfig.from_yaml(path) == ChainConfig()
    assert DriverConfig.from_yaml(path) == DriverConfig(seed=3)


def test_numbers_that_yaml_reads_as_text_are_taken(write):
    path = write(
        'slip_detector:\n  ros__parameters:\n'
        '    valid_range_v: [-1e9, 1e9]\n    threshold: 1e3\n    sample_rate_hz: 400\n'
    )
    config = ChainConfig.from_yaml(path)
    assert config.valid_range_v == (-1e9, 1e9)
    assert config.threshold == 1000.0
    assert config.sample_rate_hz == 400.0


def test_a_chain_is_read_from_a_section_with_the_nodes_own_parameters(write):
    path = write(
        'slip_detector:\n  ros__parameters:\n'
        '    gain: 3.0\n    heartbeat_hz: 5.0\n    publish_groups: false\n'
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)
    assert type(ChainConfig.from_yaml(path)) is ChainConfig
    assert DetectorConfig.from_yaml(path) == DetectorConfig(
        gain=3.0, heartbeat_hz=5.0, publish_groups=False
    )


@pytest.mark.parametrize(
    ('line', 'start'),
    [
        ('gain: -1', 'parameter gain is -1'),
        ('heartbeat_hz: 0', 'parameter heartbeat_hz is 0 Hz'),
        ('publish_groups: 1', 'parameter publish_groups is 1'),
        ('heart_beat_hz: 5', 'unknown parameter heart_beat_hz = 5; did you mean heartbeat_hz?'),
        ('groups: {TP: [1, 2]}', 'parameter groups leaves out channel 3'),
    ],
)
@pytest.mark.parametrize('kind', [ChainConfig, DetectorConfig])
def test_a_bad_value_in_a_file_is_an_error_that_names_the_file(write, kind, line, start):
    path = write(f'slip_detector:\n  ros__parameters:\n    {line}\n')
    assert message_of(kind.from_yaml, path).startswith(f'{path}: {start}')


@pytest.mark.parametrize(
    ('content', 'says'),
    [
        (b'slip_detector: [1, 2\n', 'line 2 is not YAML'),
        (b'a: b: c\n', 'line 1 is not YAML'),
        (b'a: 1\n\tb: 2\n', 'line 2 is not YAML'),
        (b'a: !!python/object:os.system {}\n', 'line 1 is not YAML'),
        (b'\xff\xfe\x00slip', 'is not text'),
        (b'a: \x01\n', 'is not YAML'),
        (b'a: 1\n---\nb: 2\n', 'is not YAML'),
        (b'', 'is not a'),
        (b'- 1\n- 2\n', 'is not a'),
        (b'just text\n', 'is not a'),
        (b'slip_detector:\n  threshold: 0.7\n', 'slip_detector/threshold has no ros__parameters'),
        (b'slip_detector:\n  ros__parameters:\n', 'slip_detector has no names under ros__'),
        (b'slip_detector:\n  ros__parameters: [1]\n', 'slip_detector has no names under ros__'),
        (b'slip_detector:\n', 'slip_detector has no ros__parameters'),
        (b'threshold: 0.7\n', 'threshold has no ros__parameters'),
    ],
)
@pytest.mark.parametrize('kind', SETS)
def test_a_file_of_another_kind_is_an_error_that_names_it(tmp_path, kind, content, says):
    path = tmp_path / 'finger.yaml'
    path.write_bytes(content)
    message = message_of(kind.from_yaml, path)
    assert message.startswith(f'{path}:')
    assert says in message


@pytest.mark.parametrize('kind', SETS)
def test_a_file_that_cannot_be_opened_is_an_error_that_names_it(tmp_path, kind):
    for path in (tmp_path / 'missing.yaml', tmp_path):
        message = message_of(kind.from_yaml, path)
        assert message.startswith(f'{path}: cannot be read (')


def test_what_rclpy_reads_itself_may_stand_in_the_file(tmp_path):
    path = tmp_path / 'finger.yaml'
    path.write_text(
        '/**:\n  ros__parameters: {use_sim_time: true}\n'
        '/**/slip_detector:\n'
        '  ros__parameters:\n'
        '    qos_overrides: {/slip: {publisher: {depth: 3}}}\n'
        '    gain: 3.0\n'
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)


def test_a_node_may_stand_nested_in_its_namespace(tmp_path):
    path = tmp_path / 'finger.yaml'
    path.write_text('left:\n  index:\n    slip_detector:\n      ros__parameters: {gain: 3.0}\n')
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)


def test_a_node_in_several_namespaces_is_not_guessed(tmp_path):
    path = tmp_path / 'hand.yaml'
    path.write_text(
        '/left/slip_detector:\n  ros__parameters: {gain: 3.0}\n'
        '/right/slip_detector:\n  ros__parameters: {gain: 4.0}\n'
    )
    message = message_of(ChainConfig.from_yaml, path)
    assert '/left/slip_detector, /right/slip_detector' in message


def test_a_file_for_other_packages_is_refused(tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text('/camera:\n  ros__parameters: {gain: 3.0}\n')
    message = message_of(ChainConfig.from_yaml, path)
    assert message.startswith(f'{path}: has no section of this package')


# --- one section for all nodes -------------------------------------------------------------


def test_what_any_node_knows_may_stand_in_the_section_for_all(write):
    path = write(
        """
        /**:
          ros__parameters:
            sample_rate_hz: 400.0
            frame_id: thumb
            limit_n: 8.0
            groups: {all: [1, 2]}
            channels: 2
        """
    )
    detector = DetectorConfig.from_yaml(path)
    assert (detector.sample_rate_hz, detector.channels) == (400.0, 2)
    assert detector.groups == {'all': (1, 2)}
    assert DriverConfig.from_yaml(path) == DriverConfig(frame_id='thumb', channels=2)
    assert GraspConfig.from_yaml(path) == GraspConfig(limit_n=8.0)
    others = names_for_others(path, 'slip_driver')
    assert others == {'sample_rate_hz', 'limit_n', 'groups.all'}


@pytest.mark.parametrize('kind', SETS)
def test_what_no_node_knows_is_refused_in_the_section_for_all(write, kind):
    path = write('/**:\n  ros__parameters: {sample_rate_h: 400.0}\n')
    message = message_of(kind.from_yaml, path)
    assert message.startswith(f'{path}: unknown parameter sample_rate_h = 400.0; ')


def test_the_suggestion_for_a_typing_error_is_a_near_name(write):
    path = write('/**:\n  ros__parameters: {sample_rate_h: 400.0}\n')
    assert message_of(DetectorConfig.from_yaml, path).endswith('did you mean sample_rate_hz?')


def test_a_parameter_of_another_node_is_refused_in_a_nodes_own_section(write):
    path = write(
        '/**:\n  ros__parameters: {threshold: 0.7}\n'
        'slip_driver:\n  ros__parameters: {threshold: 0.7}\n'
    )
    message = message_of(DriverConfig.from_yaml, path)
    assert message.endswith('threshold = 0.7; it is a parameter of slip_detector')
    assert DetectorConfig.from_yaml(path).threshold == 0.7


def test_a_name_that_is_given_nested_and_flat_is_refused(write):
    path = write('slip_detector:\n  ros__parameters:\n    groups: {a: [1]}\n    groups.a: [2]\n')
    assert message_of(read_parameter_file, path, 'slip_detector') == (
        f'{path}: section slip_detector has groups.a again, allowed: once'
    )
