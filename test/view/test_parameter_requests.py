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

"""What pages ask of the parameters, whatever they send."""

import asyncio

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.access import Access
from slip_detector.view.parameter_requests import ParameterRequests
from slip_detector.view.server import Server
from support.simulated_detectors import SimulatedDetectors

NAME = '/index/slip_detector'


def server_of(tmp_path, files=(), labels=('index',), **access):
    server = Server(SimulatedDetectors(labels, real_time=False), Access(**access))
    ParameterRequests(server, tmp_path / 'saved', files)
    (tmp_path / 'saved').mkdir()
    return server


def ask(server, **message):
    return asyncio.run(server.answer({'finger': NAME, **message}))


@pytest.mark.parametrize(
    'message',
    [
        {'type': 'set', 'finger': '/none', 'values': {'threshold': 1}},
        {'type': 'set', 'finger': [], 'values': {'threshold': 1}},
        {'type': 'set', 'values': {}},
        {'type': 'set', 'values': [1]},
        {'type': 'set', 'values': {'threshold': {}}},
        {'type': 'set', 'values': {'threshold': 'low'}},
        {'type': 'set', 'values': {'no_such': 1}},
        {'type': 'undo'},
        {'type': 'save', 'fingers': [], 'name': 'a'},
        {'type': 'save', 'fingers': ['/none'], 'name': 'a'},
        {'type': 'save', 'fingers': [[]], 'name': 'a'},
        {'type': 'save', 'fingers': [NAME], 'name': None},
        {'type': 'save', 'fingers': [NAME], 'name': '../a'},
    ],
)
def test_what_cannot_be_done_is_refused_in_words_and_changes_nothing(tmp_path, message):
    server = server_of(tmp_path)
    assert ask(server, **message)['refusal']
    assert server.detectors.fingers[NAME].config == DetectorConfig()
    assert list((tmp_path / 'saved').iterdir()) == []


@pytest.mark.parametrize('kind', ['set', 'undo', 'as_in_file', 'save'])
def test_whatever_changes_something_is_refused_to_pages_that_may_only_look(tmp_path, kind):
    server = server_of(tmp_path, read_only=True)
    answer = ask(server, type=kind, values={'threshold': 1}, fingers=[NAME], name='a')
    assert '--read-only' in answer['refusal']
    assert server.detectors.fingers[NAME].config == DetectorConfig()


def test_a_refusal_is_not_what_is_undone(tmp_path):
    server = server_of(tmp_path)
    assert ask(server, type='set', values={'threshold': 0.25})['refusal'] == ''
    assert ask(server, type='set', values={'threshold': -1, 'gain': 7.0})['refusal']
    assert ask(server, type='undo')['refusal'] == ''
    assert server.detectors.fingers[NAME].config == DetectorConfig()
    assert ask(server, type='undo')['refusal'] == 'there is nothing to undo'


def test_of_several_files_each_detector_has_the_one_of_its_namespace(tmp_path):
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


def test_a_file_that_cannot_be_read_is_named_and_nothing_else_fails(tmp_path):
    server = server_of(tmp_path, [tmp_path / 'none.yaml'])
    server.tick()
    assert 'none.yaml: cannot be read' in server.news['parameters']
    assert ask(server, type='set', values={'threshold': 0.25})['refusal'] == ''
    assert 'none.yaml: cannot be read' in ask(server, type='as_in_file')['refusal']
    answer = ask(server, type='save', fingers=[NAME], name='kept')
    assert (answer['refusal'], answer['launch']) == ('', f'config:={tmp_path}/saved/kept.yaml')
    assert 'none.yaml: cannot be read' in answer['lost']
    saved = tmp_path / 'saved' / 'kept.yaml'
    assert DetectorConfig.from_yaml(saved) == DetectorConfig(threshold=0.25)


def test_what_is_told_changes_with_the_parameters_and_with_nothing_else(tmp_path):
    server = server_of(tmp_path)
    server.tick()
    told = server.news['parameters']
    server.tick()
    assert server.news['parameters'] == told
    ask(server, type='set', page='1-2', values={'threshold': 0.25, 'gain': '7'})
    server.tick()
    assert '"by": "page 1-2"' in server.news['parameters']
    assert 'threshold from 0.5 to 0.25, gain from 100 to 7' in server.news['parameters']
    server.detectors.remove('index')
    server.tick()
    assert '"gone": true' in server.news['parameters']
