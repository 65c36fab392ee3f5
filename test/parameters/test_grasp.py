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

"""The parameters of the grasp controller."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.grasp import GraspConfig, commands_of_a_scene
from support.config_cases import message_of


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        (
            {'grip_n': 3.0, 'limit_n': 2.0},
            'parameter grip_n is 3 N, allowed: at most limit_n, 2 N',
        ),
        ({'limit_n': math.nan}, 'parameter limit_n is not a number, allowed: a number'),
        ({'limit_n': 1000.1}, 'parameter limit_n is 1000.1 N, allowed: 0.001 to 1000 N'),
        ({'step_factor': 0.5}, 'parameter step_factor is 0.5, allowed: 1 to 100'),
        ({'repeat_s': -0.1}, 'parameter repeat_s is -0.1 s, allowed: 0 to 60 s'),
        ({'closing_n_s': 0.0}, 'parameter closing_n_s is 0 N/s, allowed: 0.001 to 1e+06 N/s'),
        ({'on_invalid': 'drop'}, "parameter on_invalid is 'drop', allowed: hold, open"),
        ({'deadline_s': 0.0}, 'parameter deadline_s is 0 s, allowed: 0.001 to 60 s'),
        (
            {'command_type': 'std_msgs/msg/Float32'},
            "parameter command_type is 'std_msgs/msg/Float32', allowed: "
            'sensor_msgs/msg/JointState, std_msgs/msg/Float64MultiArray',
        ),
        *(
            (
                {'command_topic': topic},
                f'parameter command_topic is {topic!r}, allowed: names of letters, digits and _ '
                'with / between, no digit first',
            )
            for topic in ('', '/', 'a//b', 'hand/', '1/commands', 'grip force', 'ü')
        ),
        *(
            (
                {'command_joints': joints},
                f'parameter command_joints is {joints}, allowed: at least one name, each once',
            )
            for joints in ([], ['left', 'left'])
        ),
        (
            {'command_joints': 'grip'},
            "parameter command_joints is 'grip', allowed: a list",
        ),
        (
            {'command_factor': 0.0},
            'parameter command_factor is 0, allowed: any other number from -1e+06 to 1e+06, else '
            'nothing grips',
        ),
        (
            {'command_factor': -math.inf},
            'parameter command_factor is -inf, allowed: -1e+06 to 1e+06',
        ),
        ({'command_hz': '100 Hz'}, "parameter command_hz is '100 Hz', allowed: a number"),
    ],
)
def test_a_bad_value_is_an_error_that_says_what_is_allowed(values, message):
    assert message_of(GraspConfig, **values) == message


def test_slip_has_to_raise_the_force():
    message = message_of(GraspConfig, step_factor=1.0, step_n=0.0)
    assert message.startswith('parameter step_factor is 1 and step_n is 0, allowed: ')
    assert GraspConfig(step_factor=1.0, step_n=0.1).step_n == 0.1
    assert GraspConfig(step_factor=1.1, step_n=0.0).step_factor == 1.1


@given(st.floats(0.001, 1000.0), st.floats(0.001, 1000.0))
def test_the_first_grip_is_at_most_the_limit(grip_n, limit_n):
    if grip_n <= limit_n:
        config = GraspConfig(grip_n=grip_n, limit_n=limit_n)
        assert (config.grip_n, config.limit_n) == (grip_n, limit_n)
    else:
        message = message_of(GraspConfig, grip_n=grip_n, limit_n=limit_n)
        assert message.startswith('parameter grip_n is ')


def test_the_deadline_allows_for_two_heartbeats_of_the_detector():
    assert GraspConfig().deadline_s >= 2.0 / DetectorConfig().heartbeat_hz


@pytest.mark.parametrize('topic', ['a', '~/a', '/a1/b_c', '_hidden/commands'])
def test_topics_are_relative_private_or_absolute(topic):
    assert GraspConfig(command_topic=topic).command_topic == topic


def test_a_scene_is_told_newtons_of_one_grip_whatever_the_real_gripper_is_told():
    real = GraspConfig(command_topic='/hand', command_joints=['l', 'r'], command_factor=-2)
    tried = GraspConfig.from_parameters({**real.to_parameters(), **commands_of_a_scene()})
    assert tried == GraspConfig()
