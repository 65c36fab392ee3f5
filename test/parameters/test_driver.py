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

"""The parameters of the driver, and those that describe a recording."""

import math

import pytest

from slip_detector.parameters.driver import DriverConfig
from support.config_cases import message_of

NAN, INF = math.nan, math.inf


def test_the_driver_has_no_source_unless_told():
    config = DriverConfig()
    assert (config.source, config.seed, config.rate, config.loop) == ('', 0, 1.0, False)
    assert DriverConfig(source='recording', recording='trial.npz').recording == 'trial.npz'


@pytest.mark.parametrize(
    ('name', 'value', 'shown', 'allowed_text'),
    [
        ('source', 'camera', "'camera'", 'scene, recording'),
        ('source', None, 'None', 'scene, recording'),
        ('scene', 3, '3', 'text'),
        ('seed', -1, '-1', '0 to 2.14748e+09'),
        ('seed', 2**31, '2.14748e+09', '0 to 2.14748e+09'),
        ('seed', 0.5, '0.5', 'a whole number'),
        ('seed', True, 'True', 'a whole number'),
        ('rate', 0, '0', '0.001 to 1000'),
        ('rate', NAN, 'not a number', 'a number'),
        ('rate', INF, 'inf', '0.001 to 1000'),
        ('loop', 1, '1', 'true, false'),
        ('loop', 'true', "'true'", 'true, false'),
        ('frame_id', None, 'None', 'text'),
    ],
)
def test_a_bad_value_of_the_driver_is_an_error(name, value, shown, allowed_text):
    before, comma, after = message_of(DriverConfig, **{name: value}).partition(', allowed: ')
    assert before.startswith(f'parameter {name} ')
    assert comma
    assert shown in before
    assert allowed_text in after


def test_a_driver_does_not_take_the_chains_parameters():
    message = message_of(DriverConfig.from_parameters, {'threshold': 0.5})
    assert message == 'unknown parameter threshold = 0.5; it is a parameter of slip_detector'
