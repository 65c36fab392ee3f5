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


"""``slip_tune`` on what the page recorded: its progress, stopped, failing, in other words."""

import asyncio
import json
import subprocess
import sys

import pytest

from slip_detector.parameters import DetectorConfig
from slip_detector.report.texts import heading
from slip_detector.view import tuning
from slip_detector.view.recordings import RecordedFolder
from slip_detector.view.tuning import COMMAND, TuneRun
from support.training import write_recordings

DEADLINE_S = 120.0


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp('recorded')
    write_recordings(folder)
    return folder


async def test_a_stopped_search_keeps_what_it_found_judged_by_what_was_held_out(recorded):
    run = TuneRun(RecordedFolder(recorded), 'index', DetectorConfig())
    task, steps = asyncio.create_task(run.run()), ['']
    while not task.done():
        steps += [run.said['step']] if run.said['step'] != steps[-1] else []
        if run.said['share'] > 0.2:
            run.stop()
        await asyncio.sleep(0.02)
    assert 'comparing on what was held out' in steps
    assert any('mains of 50 Hz' in line for line in run.said['lines'])
    assert 'Stopped early.' in run.said['lines']
    rows = {row[0]: row for row in run.said['table']}
    assert rows[heading('false_time_percent')][3] == 'better'
    found = DetectorConfig.from_yaml(recorded / 'tuning' / 'tuned.yaml').to_parameters()
    assert run.said['answer'][0].startswith('Finds 2 of 2 slips')
    changes = run.to_apply(DetectorConfig())
    assert run.describe()['changes'] == len(changes)
    assert {**DetectorConfig().to_parameters(), **changes} == found


async def test_what_is_not_taken_can_be_applied_nevertheless(tmp_path, monkeypatch):
    said = {'lines': [], 'kept': 'it is worse', 'changes': {'threshold': 0.1}}
    code = f'print({json.dumps(said)!r})'
    monkeypatch.setattr(tuning, 'COMMAND', (sys.executable, '-c', code))
    run = TuneRun(RecordedFolder(tmp_path), 'index', DetectorConfig())
    await run.run()
    assert run.said['kept'] == 'it is worse'
    assert run.to_apply(DetectorConfig()) == {'threshold': 0.1}


async def test_a_run_fails_with_the_error_of_the_command_or_because_it_was_stopped(tmp_path):
    write_recordings(tmp_path, slips=1)
    run = TuneRun(RecordedFolder(tmp_path), 'index', DetectorConfig())
    await run.run()
    assert run.failed.startswith('slip_1, ')
    assert 'too few slips, allowed: some to tune on and others to hold out' in run.failed
    run = TuneRun(RecordedFolder(tmp_path), 'index', DetectorConfig())
    run.stop()
    await run.run()
    assert run.failed == 'stopped before anything was found'


async def test_a_run_that_is_stopped_while_its_command_starts_says_that(tmp_path, monkeypatch):
    starts = (
        'import os, signal\n'
        "ends = lambda *_: os.write(1, b'KeyboardInterrupt\\n') and os._exit(1)\n"
        'signal.signal(signal.SIGINT, ends)\n'
        """os.write(1, b'{"share": 0.1}\\n')\n"""
        'signal.pause()'
    )
    monkeypatch.setattr(tuning, 'COMMAND', (sys.executable, '-c', starts))
    run = TuneRun(RecordedFolder(tmp_path), 'index', DetectorConfig())
    task = asyncio.create_task(run.run())
    while not run.said['share']:
        await asyncio.sleep(0.02)
    run.stop()
    await task
    assert run.failed == 'stopped before anything was found'


def test_what_tunes_ends_without_a_word_when_slip_view_was_killed(recorded):
    words = str(recorded), '--config', 'config/onset.yaml', '--out', str(recorded / 'a.yaml')
    pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE}
    # Not nicely: beside tests that compute it would take long.
    with subprocess.Popen([*COMMAND[3:], *words, '--trials', '100000'], **pipes) as process:
        assert json.loads(process.stdout.readline())['step'] == 'reading the recordings'
        process.stdout.close()
        assert (process.wait(DEADLINE_S), process.stderr.read()) == (0, b'')
