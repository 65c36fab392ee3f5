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
