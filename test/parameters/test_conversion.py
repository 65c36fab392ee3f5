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

"""Values in the type of their parameter, or refused."""

import dataclasses
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.conversion import shown
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.fields import default_of
from support.config_cases import message_of


@pytest.mark.parametrize(
    ('values', 'name', 'expected'),
    [
        ({'sample_rate_hz': 400}, 'sample_rate_hz', 400.0),
        ({'gain': 5}, 'gain', 5.0),
        ({'threshold': 1}, 'threshold', 1.0),
        ({'threshold': '1e9'}, 'threshold', 1e9),
        ({'valid_range_v': ['-1e9', '1e9']}, 'valid_range_v', (-1e9, 1e9)),
        ({'valid_range_v': [0, 5]}, 'valid_range_v', (0.0, 5.0)),
        ({'passband_hz': [10, 150]}, 'passband_hz', (10.0, 150.0)),
        ({'passband_hz': [10, 0]}, 'passband_hz', (10.0, 0.0)),
        ({'stopbands_hz': [1, 2, 48, 52]}, 'stopbands_hz', ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': [[1, 2], [48, 52]]}, 'stopbands_hz', ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': []}, 'stopbands_hz', ()),
        ({'channels': 8.0}, 'channels', 8),
        ({'exponent': 2.0}, 'exponent', 2),
        ({'disabled_channels': [3, 1]}, 'disabled_channels', (3, 1)),
        ({'vote': 3}, 'vote', 3),
        ({'vote': '3'}, 'vote', 3),
        ({'vote': 'mean'}, 'vote', 'mean'),
        ({'groups': {'a': [1, 2]}, 'channels': 2}, 'groups', {'a': (1, 2)}),
        ({'groups': {'a': (1.0, 2.0)}, 'channels': 2}, 'groups', {'a': (1, 2)}),
    ],
)
def test_values_are_brought_to_the_parameters_type(values, name, expected):
    value = getattr(ChainConfig(**values), name)
    assert value == expected
    assert type(value) is type(expected)
    if isinstance(expected, tuple):
        assert [type(item) for item in value] == [type(item) for item in expected]


@given(st.floats())
def test_any_float_is_taken_or_refused_in_one_line(value):
    for field in dataclasses.fields(DetectorConfig):
        if type(default_of(field)) is not float:
            continue
        low, high = field.metadata['low'], field.metadata['high']
        if not low <= value <= high:
            message = message_of(DetectorConfig, **{field.name: value})
            assert re.fullmatch(rf'parameter {field.name} .+, allowed: .+', message)
            continue
        try:
            config = DetectorConfig(**{field.name: value})
        except ValueError as error:
            # Allowed on its own, not with the others: edges against the rate, windows and the
            # mains too.
            message = str(error)
            config = None
        if config is None:
            of_the_rate = {'sample_rate_hz', 'mains_hz', 'envelope_window_s', 'decision_window_s'}
            assert field.name in of_the_rate
            assert re.fullmatch(r'parameter \w+ .+, allowed: .+', message)
        else:
            assert getattr(config, field.name) == value


@pytest.mark.parametrize('vote', ['٣', '³', '1_0', ' 3', '0', 0, -1, True])
def test_a_vote_is_a_number_in_the_digits_that_all_read(vote):
    said = f'parameter vote is {shown(vote)}, allowed: all, mean, or a whole number from 1'
    assert message_of(ChainConfig, vote=vote) == said


@pytest.mark.parametrize('text', ['٣', '٣.٣', '1_0', '1_0e3'])
def test_a_number_in_other_digits_is_no_number(text):
    assert message_of(ChainConfig, threshold=text) == (
        f'parameter threshold is {text!r}, allowed: a number'
    )
