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

"""Sets of parameters: names, copies, and what is written is read."""

import dataclasses
import re
import tempfile
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.fields import default_of
from support.config_cases import SETS, message_of


@pytest.mark.parametrize('kind', SETS)
def test_a_set_of_parameters_cannot_be_changed(kind):
    config = kind()
    for field in dataclasses.fields(kind):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(config, field.name, default_of(field))


def test_a_changed_copy_is_checked_too():
    config = ChainConfig()
    assert dataclasses.replace(config, threshold=2.0).threshold == 2.0
    assert 'threshold' in message_of(dataclasses.replace, config, threshold=-2.0)


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('treshold', 'did you mean threshold?'),
        ('passband', 'did you mean passband_hz?'),
        ('envelope_window', 'did you mean envelope_window_s?'),
        ('stopband_hz', 'did you mean stopbands_hz?'),
        ('Gain', 'did you mean gain?'),
        ('zzz', 'allowed: channel_names, channels, common_mode'),
        ('threshold.a', 'did you mean threshold?'),
        ('threshold.', 'did you mean threshold?'),
        ('groups.', 'did you mean groups?'),
    ],
)
def test_an_unknown_parameter_is_an_error_that_suggests_a_near_name(name, hint):
    message = message_of(ChainConfig.from_parameters, {'gain': 1.0, name: 0.7}, 'a.yaml')
    assert message.startswith(f'a.yaml: unknown parameter {name} = 0.7; ')
    assert hint in message


def test_from_parameters_takes_nested_names():
    config = ChainConfig.from_parameters(
        {'channels': 3, 'groups.left': [1, 3], 'groups.right': [2], 'vote': 1}
    )
    assert config.groups == {'left': (1, 3), 'right': (2,)}


@pytest.mark.parametrize('names', [('groups', 'groups.new'), ('groups.new', 'groups')])
def test_groups_are_given_whole_or_one_by_one(names):
    message = message_of(ChainConfig.from_parameters, {name: [1] for name in names})
    assert message == 'parameter groups is given beside groups.new, allowed: either'


ANY_NAME = st.one_of(
    st.sampled_from([field.name for kind in SETS for field in dataclasses.fields(kind)]),
    st.sampled_from(['groups', 'groups.', 'groups.TP', 'groups.new', 'groups.a.b', 'groups..']),
    st.text(max_size=5),
)
#: What a parameter of ROS can be; Python's tools give any list.
ONE_VALUE = st.one_of(
    st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.binary(max_size=2)
)
ANY_VALUE = st.one_of(ONE_VALUE, st.none(), st.lists(ONE_VALUE, max_size=5))


@pytest.mark.parametrize('kind', SETS)
@given(st.dictionaries(ANY_NAME, ANY_VALUE, max_size=4))
def test_whatever_is_given_is_a_set_or_refused_in_one_line(kind, parameters):
    values = kind().to_parameters() | parameters
    try:
        config = kind.from_parameters(values)
    except ValueError as error:
        config, refusal = kind(), str(error)
    else:
        refusal = ''
    assert '\n' not in refusal
    assert kind.from_parameters(config.to_parameters()) == config


def test_a_message_without_a_file_leads_with_the_parameter():
    assert message_of(ChainConfig.from_parameters, {'gain': 0}).startswith('parameter gain is 0')


@st.composite
def chain_values(draw):
    rate = draw(st.floats(1.0, 1e6))
    channels = draw(st.integers(1, 20))
    order = draw(st.permutations(range(1, channels + 1)))
    enabled = order[: draw(st.integers(1, channels))]
    n_groups = draw(st.integers(1, min(3, len(enabled))))
    names = st.from_regex(r'[A-Za-z][A-Za-z0-9_]{0,8}', fullmatch=True)
    # Words that YAML takes for something else.
    words = st.sampled_from(['on', 'no', 'null', 'true', 'y', 'NaN', 'e1', 'all'])
    labels = draw(
        st.lists(st.one_of(names, words), min_size=n_groups, max_size=n_groups, unique=True)
    )
    groups = {label: enabled[i::n_groups] for i, label in enumerate(labels)}
    few = min(len(members) for members in groups.values())
    shares = st.floats(2e-5, 0.24)
    low = draw(shares) * rate
    high_pass = draw(st.booleans())
    stopbands = [(a * rate, (a + b) * rate) for a, b in draw(st.lists(st.tuples(shares, shares)))]
    windows = st.floats(1.001, 50.0).map(lambda samples: min(samples / rate, 60.0))
    return {
        'sample_rate_hz': rate,
        'channels': channels,
        'channel_names': draw(
            st.one_of(
                st.just([]),
                st.lists(
                    st.one_of(names, words), min_size=channels, max_size=channels, unique=True
                ),
            )
        ),
        'disabled_channels': order[len(enabled) :],
        'valid_range_v': (draw(st.floats(-1e12, -1e-300)), draw(st.floats(0, 1e12))),
        'flat_after_s': draw(st.floats(0, 3600)),
        'common_mode': draw(st.sampled_from(['none', 'mean', 'median'])),
        'passband_hz': (low, 0.0 if high_pass else low + draw(shares) * rate),
        'passband_degree': draw(st.integers(1, 10)) * (1 if high_pass else 2),
        'gain': draw(st.floats(1e-6, 1e6)),
        'stopbands_hz': stopbands,
        'stopband_degree': 2 * draw(st.integers(1, 10)),
        'stopband_ripple_db': draw(st.floats(1e-4, 3)),
        'stopband_attenuation_db': draw(st.floats(6, 120)),
        'rectify': draw(st.sampled_from(['full', 'half'])),
        'exponent': draw(st.integers(1, 6)),
        'envelope_window_s': draw(windows),
        'decision_window_s': draw(windows),
        'threshold': draw(st.floats(1e-30, 1e30)),
        'vote': draw(st.one_of(st.sampled_from(['all', 'mean']), st.integers(1, few))),
        'groups': groups,
    }


def read_back(config):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'parameters.yaml'
        path.write_text(config.to_yaml(), encoding='utf-8')
        return type(config).from_yaml(path)


@given(chain_values())
def test_a_chain_written_to_yaml_reads_back_equal(values):
    config = ChainConfig(**values)
    assert read_back(config) == config
    assert list(read_back(config).groups) == list(config.groups)
    assert ChainConfig.from_parameters(config.to_parameters()) == config


@given(
    chain_values(),
    st.fixed_dictionaries(
        {
            'max_gap_s': st.floats(0, 60),
            'input_timeout_s': st.floats(0.01, 3600),
            'heartbeat_hz': st.floats(0.1, 1000),
            'publish_groups': st.booleans(),
            'publish_channels': st.booleans(),
        }
    ),
)
def test_a_detector_written_to_yaml_reads_back_equal(values, more):
    config = DetectorConfig(**values, **more)
    assert read_back(config) == config


@given(
    st.fixed_dictionaries(
        {
            'source': st.sampled_from(['scene', 'recording']),
            'scene': st.text(),
            'seed': st.integers(0, 2**31 - 1),
            'recording': st.text(min_size=1),
            'rate': st.floats(0.001, 1000),
            'loop': st.booleans(),
            'frame_id': st.one_of(st.text(), st.sampled_from(['1e9', 'on', 'null', '~', '0x1'])),
        }
    )
)
def test_a_driver_written_to_yaml_reads_back_equal(values):
    config = DriverConfig(**values)
    assert read_back(config) == config


@pytest.mark.parametrize('kind', SETS)
def test_the_defaults_written_to_yaml_are_a_ros_parameter_file(kind):
    assert read_back(kind()) == kind()
    document = yaml.safe_load(kind().to_yaml())
    assert list(document) == [f'/**/{kind.NODE}']
    parameters = document[f'/**/{kind.NODE}']['ros__parameters']
    assert list(parameters) == [field.name for field in dataclasses.fields(kind)]
    # ROS takes numbers, text, booleans, and flat lists of one type.
    for name, value in kind().to_parameters().items():
        items = value if isinstance(value, list) else [value]
        assert len({type(item) for item in items}) <= 1, name
        assert all(isinstance(item, (bool, int, float, str)) for item in items), name


def test_to_parameters_gives_flat_lists_and_nested_names():
    parameters = ChainConfig().to_parameters()
    assert parameters['stopbands_hz'] == [0.5, 7.0, 50.0, 180.0]
    assert parameters['groups.TP'] == [14, 16, 11, 9]
    assert 'groups' not in parameters


#: By the end of a parameter's name, the longer first.
UNITS = {
    '_rate_db_s': 'dB/s',
    '_limit_db_s': 'dB s',
    '_n_s': 'N/s',
    '_ms': 'ms',
    '_hz': 'Hz',
    '_db': 'dB',
    '_s': 's',
    '_n': 'N',
    '_m': 'm',
    '_v': 'V',
}


@pytest.mark.parametrize('kind', SETS)
def test_every_parameter_is_described_and_its_default_allowed(kind):
    for field in dataclasses.fields(kind):
        assert re.fullmatch(r'[a-z][a-z0-9_]*', field.name)
        meaning = field.metadata['meaning']
        assert meaning.endswith(('.', ')')), field.name
        assert len(meaning) < 160, field.name
        choices = field.metadata['choices']
        assert not choices or default_of(field) in choices
        for suffix, unit in UNITS.items():
            if field.name.endswith(suffix):
                assert field.metadata['unit'] == unit, field.name
                break
    assert kind() == kind()
