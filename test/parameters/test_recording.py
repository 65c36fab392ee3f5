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

"""The parameters that describe a recording."""

import dataclasses

from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.recording import RecordingConfig
from support.config_cases import message_of


def test_a_recording_is_described_in_the_drivers_section(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text(
        'slip_driver:\n  ros__parameters: {recording_topic: /taxels, source: udp, seed: 3}\n'
    )
    assert RecordingConfig.from_yaml(path) == RecordingConfig(recording_topic='/taxels')
    assert type(RecordingConfig.from_yaml(path)) is RecordingConfig
    # The whole section is checked.
    path.write_text('slip_driver:\n  ros__parameters: {recording_topic: /taxels, seed: -3}\n')
    assert 'parameter seed is -3' in message_of(RecordingConfig.from_yaml, path)


def test_the_driver_has_every_parameter_of_a_recording():
    names = {field.name for field in dataclasses.fields(RecordingConfig)}
    assert names < {field.name for field in dataclasses.fields(DriverConfig)}
    assert all(name.startswith('recording_') for name in names)
