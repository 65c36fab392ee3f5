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

"""Changes of a configuration in use: whole files, taken or refused."""

import pytest

from slip_detector.parameters import DetectorConfig
from slip_detector.parameters.changes import changed, fitting
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.sections import parameters_for
from support.config_cases import message_of

FILES = {path.stem: path for path in sorted((shared_folder() / 'config').glob('*.yaml'))}


def any_runs(config):
    pass


def test_only_groups_can_be_deleted():
    said = 'parameter threshold cannot be deleted, allowed: groups.<name>'
    assert message_of(changed, DetectorConfig(), {'threshold': None}) == said


@pytest.mark.parametrize('order', [list, reversed])
@pytest.mark.parametrize('new', FILES)
@pytest.mark.parametrize('old', FILES)
def test_each_file_is_loaded_onto_each_other_as_a_whole_or_not_at_all(old, new, order):
    config = DetectorConfig.from_yaml(FILES[old])
    values = dict(order([*parameters_for(FILES[new], 'slip_detector')[0].items()]))
    # The file says nothing of what another sensor needed: it stays as it was, and does not fit.
    if (old, new) != ('xela_uskin', 'xela_uskin') and old == 'xela_uskin':
        assert message_of(fitting, config, values, any_runs).startswith('parameter ')
        return
    now = changed(config, fitting(config, values, any_runs))
    loaded = DetectorConfig.from_yaml(FILES[new])
    names = {name.split('.')[0] for name in values}
    assert all(getattr(now, name) == getattr(loaded, name) for name in names)


def test_a_configuration_that_cannot_be_run_is_refused():
    def cannot(config):
        raise ValueError(f'no memory for {config.channels} channels')

    said = message_of(fitting, DetectorConfig(), {'channels': 16}, cannot)
    assert said == 'no memory for 16 channels'
