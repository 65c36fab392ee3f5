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

"""The command line of the benchmarks."""

import json
import subprocess
import sys

import pytest

from benchmarks.__main__ import COMMANDS, main
from benchmarks.processes import CHECKOUT
from benchmarks.scenes import command as scenes_command
from support.benchmarks import run


def test_json_is_one_object_on_stdout():
    code, output, errors = run('tune', '--quick', '--part', 'read', '--json')
    assert code == 0, errors
    figures = json.loads(output)
    assert set(figures) == {'machine', 'quick', 'read', 'wanted'}
    assert figures['quick'] is True
    assert figures['read']['recorded_s'] == 30.0


def test_without_json_a_table_is_printed(capsys):
    assert main(['tune', '--quick', '--part', 'read']) == 0
    assert 'reading an hour of MCAP, times real time' in capsys.readouterr().out


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit, match='0'):
        main(['--help'])
    output = capsys.readouterr().out
    assert all(f'  {name} ' in output for name in COMMANDS)
    folders = {path.parent.name for path in (CHECKOUT / 'benchmarks').glob('*/command.py')}
    assert folders == set(COMMANDS)


@pytest.mark.parametrize('command', COMMANDS)
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit, match='0'):
        main([command, '--help'])
    assert f'python -m benchmarks {command} ' in capsys.readouterr().out


def test_an_unknown_command_is_refused_with_those_there_are(capsys):
    with pytest.raises(SystemExit, match='2'):
        main(['speed'])
    error = capsys.readouterr().err
    assert all(name in error for name in COMMANDS)


def test_run_as_a_folder_it_says_how_it_is_run():
    command = [sys.executable, str(CHECKOUT / 'benchmarks'), 'chain']
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert 'python -m benchmarks' in done.stderr


def test_a_package_that_is_missing_is_named(monkeypatch, capsys):
    def options():
        raise ModuleNotFoundError(name='mpmath')

    monkeypatch.setattr(scenes_command, 'options', options)
    assert main(['scenes']) == 1
    assert capsys.readouterr().err.startswith('benchmarks: the package mpmath is missing: pip ')


@pytest.mark.parametrize('command', ['chain', 'scenes'])
@pytest.mark.parametrize(
    ('picture', 'said'),
    [('folder', 'folder: cannot be written'), ('picture.doc', 'has the ending .doc, allowed: .')],
)
def test_a_picture_that_cannot_be_written_is_said_before_the_measurement(
    command, picture, said, tmp_path, monkeypatch, capsys
):
    def measured(*_):
        raise AssertionError('it was measured')

    for name in ('chain.command.measure_chain_speed', 'chain.command.measure_chain_precision'):
        monkeypatch.setattr(f'benchmarks.{name}', measured)
    monkeypatch.setattr(scenes_command, 'measure_scenes', measured)
    (tmp_path / 'folder').mkdir()
    assert main([command, '--quick', '--plot', str(tmp_path / picture)]) == 1
    error = capsys.readouterr().err
    assert error.startswith('benchmarks: ')
    assert said in error
    assert error.count('\n') == 1
