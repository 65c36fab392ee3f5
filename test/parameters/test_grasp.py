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

"""The parameters of the grasp controller and of the evaluation, against each other."""

import pytest

from slip_detector.parameters import DetectorConfig, EvaluationConfig, GraspConfig
from slip_detector.parameters.grasp import ACTIONS, commands_of_a_scene
from support.config_cases import message_of

TOPIC = 'names of letters, digits and _ with / between, no digit first, at most 128'


@pytest.mark.parametrize(
    ('values', 'said'),
    [
        ({'grip_n': 3.0, 'limit_n': 2.0}, 'grip_n is 3 N, allowed: at most limit_n, 2 N'),
        ({'step_factor': 1.0}, 'step_factor is 1 and step_n is 0, allowed: one of them larger'),
        *(
            ({'command_topic': topic}, f'command_topic is {topic!r}, allowed: {TOPIC}')
            for topic in ('', '/', 'a//b', 'hand/', '1/commands', 'grip force', 'ü')
        ),
        ({'command_joints': []}, 'command_joints is (), allowed: at least one name'),
        ({'command_joints': ['l', 'l']}, "command_joints has 'l' twice, allowed: each name once"),
        ({'command_factor': 0.0}, 'command_factor is 0, allowed: not 0, else nothing grips'),
        *(
            ({'command_type': action, **values}, said)
            for action in ACTIONS
            for values, said in (
                ({'command_factor': -1.0}, 'command_factor is -1, allowed: above 0'),
                ({'on_invalid': 'open'}, "on_invalid is 'open', allowed: hold with the action"),
            )
        ),
    ],
)
def test_a_gripper_that_could_not_grip_is_refused(values, said):
    assert message_of(GraspConfig, **values).startswith(f'parameter {said}')


def test_topics_are_relative_private_or_absolute():
    for topic in ('a', '~/a', '/a1/b_c', '_hidden/commands'):
        GraspConfig(command_topic=topic)


def test_the_deadline_allows_for_two_heartbeats_of_the_detector():
    assert GraspConfig().deadline_s >= 2.0 / DetectorConfig().heartbeat_hz


def test_commands_of_a_scene_replace_those_of_a_real_gripper():
    real = GraspConfig(command_topic='/hand', command_joints=['l', 'r'], command_factor=-2)
    tried = GraspConfig.from_parameters({**real.to_parameters(), **commands_of_a_scene()})
    assert tried == GraspConfig()


def test_columns_of_motion_need_the_array_that_they_are_in():
    message = message_of(EvaluationConfig, motion_columns=('v_x',))
    assert message.startswith("parameter motion_key is '', allowed: the name of an array")
    assert EvaluationConfig(motion_key='arm', motion_columns=['v_x', 'v_y'])
