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

"""Sets of parameters: names, copies, YAML, and changes in use."""

import dataclasses
import re

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters import ChainConfig, DetectorConfig
from slip_detector.parameters.fields import convert, parameter
from slip_detector.parameters.sets import ParameterSet
from slip_detector.parameters.yaml_files import write_yaml
from slip_detector.scenes.parts import PARTS
from support.config_cases import SETS, message_of
from support.random_chains import configs

# --- names and values ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('treshold', 'did you mean threshold?'),
        ('stopband_hz', 'did you mean stopbands_hz?'),
        ('zzz', 'allowed: activity_band_hz, activity_cap_db, activity_range_db'),
        ('threshold.a', 'did you mean threshold?'),
        ('groups.', 'did you mean groups?'),
        ('grip_n', 'it is a parameter of grasp_controller'),
    ],
)
def test_an_unknown_parameter_is_an_error_that_suggests_a_near_name(name, hint):
    message = message_of(ChainConfig.from_parameters, {'gain': 1.0, name: 0.7}, 'a.yaml')
    assert message.startswith(f'a.yaml: unknown parameter {name} = 0.7; ')
    assert hint in message


@pytest.mark.parametrize('groups', [{}, {'b': [1, 2]}])
def test_groups_are_given_in_one_way(groups):
    values = {'channels': 2, 'groups.a': [1, 2], 'groups': groups}
    said = 'parameter groups is given beside groups.<name>, allowed: one of both'
    assert message_of(ChainConfig.from_parameters, values) == said


#: By the end of a parameter's name, the longer first.
UNITS = {
    **{'_n_s_m': 'N s/m', '_n_m': 'N/m', '_m_s': 'm/s', '_v_n': 'V/N', 'drift_v': 'V/sqrt(s)'},
    **{'_rate_db_s': 'dB/s', '_limit_db_s': 'dB s', '_n_s': 'N/s', '_ms': 'ms', '_hz': 'Hz'},
    **{'_db': 'dB', '_s': 's', '_n': 'N', '_m': 'm', '_v': 'V'},
}


@pytest.mark.parametrize('kind', [*SETS, *PARTS.values()])
def test_every_parameter_is_described_its_name_has_its_unit_and_its_default_is_allowed(kind):
    for field in dataclasses.fields(kind):
        assert re.fullmatch(r'[a-z][a-z0-9_]*', field.name)
        assert field.metadata['meaning'].endswith(('.', ')')), field.name
        default = field.metadata['default']
        assert repr(convert(default, field, field.name)) == repr(default)
        units = [unit for suffix, unit in UNITS.items() if field.name.endswith(suffix)]
        assert not units or field.metadata['unit'] == units[0], field.name


# --- files that are written --------------------------------------------------------------------


@pytest.mark.parametrize('kind', SETS)
def test_the_defaults_written_to_yaml_are_a_ros_parameter_file(kind, tmp_path):
    path = tmp_path / 'a.yaml'
    write_yaml(path, kind().to_document())
    assert kind.from_yaml(path) == kind()
    ((section, content),) = yaml.safe_load(path.read_text()).items()
    assert section == f'/**/{kind.NODE}'
    assert list(content['ros__parameters']) == [field.name for field in dataclasses.fields(kind)]


def test_sets_of_users_are_read_beside_those_of_the_package(tmp_path):
    path = tmp_path / 'a.yaml'
    text = 'slip_detector: {ros__parameters: {gain: 2.0, tip: 3, heartbeat_hz: 5.0}}\n'
    path.write_text(f'{text}finger: {{ros__parameters: {{tip: 4}}}}\n')

    class Finger(ParameterSet):
        NODE = 'finger'
        tip: int = parameter(1, 'Number of the fingertip.', (0, 9))

    assert Finger.from_yaml(path) == Finger(tip=4)
    assert 'unknown parameter tip = 3' in message_of(ChainConfig.from_yaml, path)


# --- changes in use --------------------------------------------------------------------------


def test_only_groups_can_be_deleted():
    said = 'parameter threshold cannot be deleted, allowed: groups.<name>'
    assert message_of(DetectorConfig().with_values, {'threshold': None}) == said


@given(configs(), configs(), st.booleans())
def test_any_configuration_becomes_any_other_by_the_values_that_differ(
    config, other, keeps_sensor
):
    if keeps_sensor:
        kept = {name: getattr(config, name) for name in ('channels', 'disabled_channels')}
        other = ChainConfig(**{**vars(other), **kept, 'vote': 'all', 'groups': config.groups})
    assert config.with_values(config.changes_to(other)) == other
