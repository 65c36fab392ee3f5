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

"""Parameter files that are written."""

import yaml

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.writing import with_parameters, write_file


def test_changes_win_over_every_section_and_all_else_stays(tmp_path):
    path = tmp_path / 'given.yaml'
    path.write_text(
        '/**/slip_detector:\n  ros__parameters: {threshold: 0.7, gain: 50.0}\n'
        'slip_driver:\n  ros__parameters: {seed: 3}\n'
        '/**:\n  ros__parameters: {threshold: 0.9}\n'
    )
    document = with_parameters(path, {'threshold': 0.2})
    write_file(tmp_path / 'new.yaml', document, ['Tuned.', ''])
    text = (tmp_path / 'new.yaml').read_text()
    assert text.startswith('# Tuned.\n#\n')
    assert ChainConfig.from_yaml(tmp_path / 'new.yaml') == ChainConfig(threshold=0.2, gain=50.0)
    assert yaml.safe_load(text)['slip_driver'] == {'ros__parameters': {'seed': 3}}
    # What was given is not changed.
    assert yaml.safe_load(path.read_text())['/**']['ros__parameters']['threshold'] == 0.9


def test_a_file_without_the_detectors_section_gets_one(tmp_path):
    path = tmp_path / 'given.yaml'
    path.write_text('slip_driver:\n  ros__parameters: {seed: 3}\n')
    document = with_parameters(path, {'threshold': 0.2})
    assert document['/**/slip_detector'] == {'ros__parameters': {'threshold': 0.2}}
