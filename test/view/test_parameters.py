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

"""Parameters as pages show and type them, what pages request, and what is saved, and where."""

import asyncio
import dataclasses

from hypothesis import given

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fitting import fitting
from slip_detector.parameters.yaml_files import write_yaml
from slip_detector.view.access import Access
from slip_detector.view.detectors import Finger
from slip_detector.view.parameters import (
    PRESETS,
    ParameterRequests,
    describe_parameters,
    preset,
    read_text,
    text_of,
)
from slip_detector.view.server import Server
from support.random_chains import configs
from support.simulated_detectors import SimulatedDetectors

NAME = '/index/slip_detector'

#: What no file of a page may be called.
NO_NAMES = None, '..', '../a', '/tmp/a', 'a.b', '', 'a\0', 'a\n', '-rf', 'Ä', 'a' * 65, 'a__b'


def server_of(tmp_path, files=(), labels=('index',), overridden=(), **access):
    server = Server(SimulatedDetectors(labels, real_time=False), Access(**access))
    ParameterRequests(server, tmp_path / 'saved', files, overridden)
    (tmp_path / 'saved').mkdir()
    return server


def ask(server, **message):
    return asyncio.run(server.answer({'finger': NAME, **message}))


@given(chain=configs())
def test_a_shown_value_typed_again_is_unchanged(chain):
    config = DetectorConfig(**vars(chain))
    retyped = {n: read_text(n, text_of(v)) for n, v in config.to_parameters().items()}
    assert DetectorConfig.from_parameters(retyped) == config


def test_every_parameter_stands_under_the_heading_of_the_docs():
    parts = describe_parameters(Finger(NAME, DetectorConfig()))
    rows = {row['name']: row for part in parts for row in part['parameters']}
    assert [*rows] == [*DetectorConfig().to_parameters()]
    assert (parts[0]['heading'], parts[-1]['heading']) == ('Samples', 'Fingertip')
    band, threshold = rows['passband_hz'], rows['threshold']
    assert (band['text'], band['unit'], threshold['allowed']) == ('7, 50', 'Hz', '1e-30 to 1e+30')
    assert '; now rising, 0.0038 Hz to below 190 Hz' in band['allowed']
    assert rows['rectify']['choices'] == ('full', 'half')
    assert rows['publish_groups']['choices'] == ['true', 'false']
    assert rows['groups.TP']['meaning'].startswith('Channels (from 1) of each group')
    assert [name for name, row in rows.items() if row['read_only']] == ['autostart']


def test_impossible_requests_are_refused_in_words_and_change_nothing(tmp_path):
    server = server_of(tmp_path)
    for message in (
        {'type': 'set', 'finger': '/none', 'values': {'threshold': 1}},
        *({'type': 'set', 'values': v} for v in ({}, {'threshold': {}}, {'threshold': 'low'})),
        *({'type': 'preset', 'preset': none} for none in ('none', ['sure'])),
        *({'type': 'save', 'fingers': none, 'name': 'a'} for none in ([], ['/none'])),
        *({'type': 'save', 'fingers': [NAME], 'name': name} for name in NO_NAMES),
    ):
        assert 0 < len(ask(server, **message)['refusal']) < 400, message
    assert server.detectors.fingers[NAME].config == DetectorConfig()
    assert [*tmp_path.rglob('*')] == [tmp_path / 'saved']


def test_a_detector_has_the_file_of_its_namespace(tmp_path):
    files = [tmp_path / 'onset.yaml', tmp_path / 'sure.yaml']
    for file, threshold in zip(files, (0.25, 0.75), strict=True):
        text = f'/**/slip_detector: {{ros__parameters: {{threshold: {threshold}}}}}'
        file.write_text(text, encoding='utf-8')
    server = server_of(tmp_path, files, labels=('index/onset', 'index/sure', 'other'))
    server.tick()
    for label, threshold in (('index/onset', 0.25), ('index/sure', 0.75), ('other', 0.5)):
        name = f'/{label}/slip_detector'
        assert ask(server, type='as_in_file', finger=name)['refusal'] == ''
        assert server.detectors.fingers[name].config.threshold == threshold


def test_a_preset_sets_the_whole_decision_and_leaves_the_sensor_as_it_is(tmp_path):
    server = server_of(tmp_path)
    finger = server.detectors.fingers[NAME]
    ask(server, type='set', values={'sample_rate_hz': 400.0, 'impact_v': 0.3})
    before = finger.config
    for name in PRESETS:
        wanted = dataclasses.replace(preset(name), sample_rate_hz=400.0, taxel_positions_m=())
        assert ask(server, type='preset', preset=name)['refusal'] == ''
        assert finger.config == wanted
        server.tick()
        assert f'"preset": "{name}"' in server.news['parameters']
    for _ in PRESETS:
        assert ask(server, type='undo')['refusal'] == ''
    assert finger.config == before
    # Groups of other channels mean nothing to it.
    few = DetectorConfig(channels=4, groups={'a': (1, 2), 'b': (3, 4)})
    finger = server.detectors.add('few', few).finger
    assert ask(server, type='preset', preset='grasp', finger=finger.name)['refusal'] == ''
    assert finger.config.groups == few.groups
    assert finger.config.threshold == preset('grasp').threshold


def test_a_file_that_cannot_be_read_is_named_and_values_can_be_set(tmp_path):
    server = server_of(tmp_path, [tmp_path / 'none.yaml'])
    server.tick()
    for request in ({'type': 'as_in_file'}, {'type': 'save', 'fingers': [NAME], 'name': 'kept'}):
        assert 'none.yaml: cannot be read' in ask(server, **request)['refusal']
    assert ask(server, type='set', values={'threshold': 0.25})['refusal'] == ''


def test_a_saved_file_is_named_and_replaced_on_request(tmp_path):
    server = server_of(tmp_path)
    assert ask(server, type='set', values={'threshold': 0.25})['refusal'] == ''
    save = {'type': 'save', 'fingers': [NAME], 'name': 'kept'}
    answer = ask(server, **save)
    assert (answer['refusal'], answer['launch']) == ('', f'config:={tmp_path}/saved/kept.yaml')
    saved = tmp_path / 'saved' / 'kept.yaml'
    assert DetectorConfig.from_yaml(saved) == DetectorConfig(threshold=0.25)
    assert 'kept.yaml: already exists' in ask(server, **save)['taken']
    saved.write_text('')
    assert ask(server, **save, replace=True)['refusal'] == ''
    assert DetectorConfig.from_yaml(saved) == DetectorConfig(threshold=0.25)


def test_values_with_which_a_detector_was_started_in_place_of_its_file_are_not_saved(tmp_path):
    file = tmp_path / 'sensor.yaml'
    config = DetectorConfig(input_field='data', gain=7.0)
    write_yaml(file, config.to_document())
    server = server_of(tmp_path, [file], overridden=['input_field'])
    server.tick()
    assert ask(server, type='as_in_file')['refusal'] == ''
    now = server.detectors.fingers[NAME].config
    assert (now.input_field, now.gain) == ('position', 7.0)
    assert ask(server, type='set', values={'threshold': 0.25})['refusal'] == ''
    assert ask(server, type='save', fingers=[NAME], name='kept')['refusal'] == ''
    saved = DetectorConfig.from_yaml(tmp_path / 'saved' / 'kept.yaml')
    assert saved == dataclasses.replace(config, threshold=0.25)


def test_a_detector_is_made_to_take_what_comes(tmp_path):
    server = server_of(tmp_path)
    finger = server.detectors.fingers[NAME]
    finger.to_fit = fitting(finger.config, 6, 200.0)
    assert ask(server, type='take_input')['refusal'] == ''
    assert (finger.config.channels, finger.config.sample_rate_hz) == (6, 200.0)


def test_pages_get_changes_with_their_author_and_hear_that_a_detector_is_gone(tmp_path):
    server = server_of(tmp_path)
    ask(server, type='set', page='1-2', values={'threshold': 0.25, 'gain': '7'})
    server.tick()
    words = '"page 1-2", "gain from 100 to 7, threshold from 0.5 to 0.25'
    assert words in server.news['parameters']
    server.detectors.remove('index')
    server.tick()
    assert '"gone": true' in server.news['parameters']
