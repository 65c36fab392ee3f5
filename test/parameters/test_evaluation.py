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

"""The parameters of the evaluation."""

import pytest

from slip_detector.parameters.evaluation import EvaluationConfig
from support.config_cases import message_of


@pytest.mark.parametrize('name', ['early_s', 'tail_s', 'late_after_s'])
def test_a_tolerance_is_0_to_10_seconds(name):
    for seconds in (0.0, 10.0):
        assert getattr(EvaluationConfig(**{name: seconds}), name) == seconds
    for seconds in (-0.001, 10.001):
        message = message_of(EvaluationConfig, **{name: seconds})
        assert message == f'parameter {name} is {seconds:g} s, allowed: 0 to 10 s'


def test_columns_of_motion_need_the_array_that_they_are_in():
    message = message_of(EvaluationConfig, motion_columns=('v_x',))
    assert message.startswith("parameter motion_key is '', allowed: the name of an array")
    config = EvaluationConfig(motion_key='arm', motion_columns=['v_x', 'v_y'])
    assert config.motion_columns == ('v_x', 'v_y')


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'moving_above': -1.0}, 'parameter moving_above is -1 m/s, allowed: 0 to 1e+06 m/s'),
        ({'motion_key': 3}, 'parameter motion_key is 3, allowed: text'),
        (
            {'motion_key': 'arm', 'motion_columns': 'v_x'},
            "parameter motion_columns is 'v_x', allowed: a list",
        ),
        (
            {'motion_key': 'arm', 'motion_columns': ['v_x', '']},
            "parameter motion_columns has '', allowed: a list of names",
        ),
    ],
)
def test_a_bad_value_is_an_error_that_says_what_is_allowed(values, message):
    assert message_of(EvaluationConfig, **values) == message


def test_they_are_read_from_the_section_of_the_command(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('slip_evaluate:\n  ros__parameters: {tail_s: 0.2}\n')
    assert EvaluationConfig.from_yaml(path) == EvaluationConfig(tail_s=0.2)
