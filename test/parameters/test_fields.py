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

"""The values of parameters: in the type of their parameter, or refused in one line."""

import math

import numpy as np
import pytest

from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig, EvaluationConfig
from slip_detector.parameters.fields import quote
from support.config_cases import message_of

NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ('values', 'expected'),
    [
        ({'gain': 5}, 5.0),
        ({'threshold': '1e9'}, 1e9),
        ({'valid_range_v': ['-1e9', 0]}, (-1e9, 0.0)),
        ({'passband_hz': [10, 0]}, (10.0, 0.0)),
        ({'stopbands_hz': [1, 2, 48, 52]}, ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': [[1, 2], [48, 52]]}, ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': []}, ()),
        ({'noise_floor': 2}, (2.0,)),
        ({'noise_floor': '1e-3'}, (1e-3,)),
        ({'exponent': 2.0}, 2),
        ({'disabled_channels': [3, 1]}, (3, 1)),
        ({'vote': '3'}, 3),
        ({'vote': 'mean'}, 'mean'),
        ({'groups': {'a': (1.0, 2.0)}, 'channels': 2}, {'a': (1, 2)}),
        ({'threshold': np.float32(0.5)}, 0.5),
        ({'noise_floor': [np.float32(0.5), np.int8(2)], 'channels': 2}, (0.5, 2.0)),
        ({'channels': np.int64(4)}, 4),
        ({'stopbands_hz': np.array([[1, 2], [48, 52]])}, ((1.0, 2.0), (48.0, 52.0))),
        ({'channel_names': np.array(['a', 'b']), 'channels': 2}, ('a', 'b')),
        ({'groups': {'a': np.array([1, 2])}, 'channels': 2}, {'a': (1, 2)}),
    ],
)
def test_values_are_converted_to_the_type_of_the_parameter(values, expected):
    value = getattr(ChainConfig(**values), next(iter(values)))
    assert value == expected
    assert type(value) is type(expected)
    if isinstance(expected, tuple):
        assert [type(item) for item in value] == [type(item) for item in expected]


#: The set, the bad value of a parameter, and the message after the name of the parameter.
REFUSED = [
    # Numbers.
    (ChainConfig, 'sample_rate_hz', 0.5, 'is 0.5 Hz, allowed: 1 to 1e+06 Hz'),
    (ChainConfig, 'sample_rate_hz', INF, 'is inf Hz, allowed: 1 to 1e+06 Hz'),
    (ChainConfig, 'sample_rate_hz', 'fast', "is 'fast', allowed: a number"),
    (ChainConfig, 'sample_rate_hz', NAN, 'is nan, allowed: a number'),
    (ChainConfig, 'threshold', 'nan', "is 'nan', allowed: a number"),
    (ChainConfig, 'threshold', [1.0] * 1000, f'is {quote([1.0] * 1000)}, allowed: a number'),
    (ChainConfig, 'channels', 10**7, 'is 1e+07, allowed: 1 to 1e+06'),
    (ChainConfig, 'channels', 16.5, 'is 16.5, allowed: a whole number'),
    (ChainConfig, 'channels', '16', "is '16', allowed: a whole number"),
    (ChainConfig, 'channels', 10**400, f'is {quote(10**400)}, allowed: a whole number'),
    (ChainConfig, 'envelope_window_s', 61, 'is 61 s, allowed: one sample to 60 s'),
    # Texts and switches.
    (ChainConfig, 'decision', 'cusum', "is 'cusum', allowed: mean, evidence"),
    (ChainConfig, 'noise_floor_learnt', 1, 'is 1, allowed: true, false'),
    (DriverConfig, 'source', 'camera', "is 'camera', allowed: scene, recording, serial or udp"),
    (DriverConfig, 'frame_id', None, 'is None, allowed: text'),
    *(
        (ChainConfig, 'vote', vote, f'is {quote(vote)}, allowed: all, mean, or a whole number')
        for vote in ('٣', '³', '1_0', ' 3', '0', -1, True)
    ),
    # Lists.
    (ChainConfig, 'passband_hz', 7, 'is 7, allowed: a list'),
    (ChainConfig, 'passband_hz', '7, 50', "is '7, 50', allowed: a list"),
    (ChainConfig, 'passband_hz', (7, 20, 50), 'has 3 numbers, allowed: 2'),
    (ChainConfig, 'stopbands_hz', (0.5, 7, 50), 'has 3 numbers, allowed: pairs [low, high]'),
    (ChainConfig, 'stopbands_hz', (0.5, 7, NAN, 180), 'is nan, allowed: a number'),
    (ChainConfig, 'valid_range_v', (0, INF), 'is inf V, allowed: -1e+12 to 1e+12 V'),
    (DetectorConfig, 'taxel_positions_m', (0, 0, 10.5), 'is 10.5 m, allowed: three numbers a'),
    (EvaluationConfig, 'motion_columns', ['v_x', ''], "has '', allowed: a list of names"),
    # Names.
    (ChainConfig, 'channel_names', 'ab', "is 'ab', allowed: a list"),
    *(
        (ChainConfig, 'channel_names', [name], f'has {name!r}, allowed: up to 64 letters, digits')
        for name in ('', '2b', 'b/c', 'ä', 7, 'a\n')
    ),
    (ChainConfig, 'channel_names', ('a', 'a'), "has 'a' twice, allowed: each name once"),
    (ChainConfig, 'groups', [1, 2], 'is [1, 2], allowed: a list of channel numbers per name'),
    (ChainConfig, 'groups', {'a b': [1]}, "has 'a b', allowed: up to 64 letters, digits, _"),
    (ChainConfig, 'groups', {'a': 3}, "is {'a': 3}, allowed: a list of channel numbers per name"),
    (ChainConfig, 'groups.a', {'a': ['1']}, "is '1', allowed: a whole number"),
]


@pytest.mark.parametrize(('kind', 'name', 'value', 'said'), REFUSED)
def test_a_bad_value_is_refused_with_parameter_value_and_what_is_allowed(kind, name, value, said):
    parameters = {name.partition('.')[0]: value}
    message = message_of(kind, **parameters)
    assert message.startswith(f'parameter {name} {said}')
    lead = message_of(kind.from_parameters, parameters, 'here.yaml')
    assert lead == f'here.yaml: {message}'
