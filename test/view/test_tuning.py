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


"""Tuning on what the page recorded: stopped, failing, and when slip_view is killed."""

import asyncio
import time
from pathlib import Path

import pytest

from slip_detector.parameters import DetectorConfig
from slip_detector.report.tables import MAIN_FIGURES, heading
from slip_detector.view import tuning
from slip_detector.view.recordings import KINDS, RecordedFolder
from slip_detector.view.tuning import TuneJob, TuneRun, learnt
from support.training import write_recordings

DEADLINE_S = 120.0


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp('recorded')
    write_recordings(folder)
    return folder


def listed(folder):
    recorded = RecordedFolder(folder)
    asyncio.run(recorded.refresh())
    return recorded


async def finished(run, each=lambda: None):
    """Run to the end, and call a function all the time."""
    deadline_s = time.monotonic() + DEADLINE_S
    task = asyncio.create_task(run.run())
    while not task.done():
        assert time.monotonic() < deadline_s
        each()
        await asyncio.sleep(0.02)


def test_a_stopped_search_keeps_what_it_found_judged_by_what_was_held_out(recorded, monkeypatch):
    monkeypatch.setattr(tuning, 'TRIALS', 120)
    run = TuneRun(listed(recorded), 'index', DetectorConfig())
    steps = []

    def stop_when_something_is_found():
        if run.step not in steps[-1:]:
            steps.append(run.step)
        if run.share > 0.2:
            run.stop()

    asyncio.run(finished(run, stop_when_something_is_found))
    assert not run.failed
    assert 0.0 < run.share < 1.0
    assert [step for step in steps if step and 'searching:' not in step] == [
        'learning the noise of rest_1',
        'learning the impacts of taps_1',
        'searching',
        'comparing on what was held out',
    ]
    assert 'mains of 50 Hz' in run.lines[0]
    assert run.held_out == ['rest_2', 'slip_3', 'slip_6']
    rows = {row[0]: row for row in run.table}
    assert rows[heading('slips')][1:3] == ('2', '2')
    assert rows[heading('false_time_percent')][3] == 'better'
    assert run.kept == ''
    found = DetectorConfig.from_yaml(recorded / 'tuning' / 'tuned.yaml').to_parameters()
    changes = run.to_apply(DetectorConfig())
    assert run.described()['changes'] == len(changes)
    assert {**DetectorConfig().to_parameters(), **changes} == found


def test_what_is_worse_on_what_was_held_out_is_not_written_and_that_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, 'TRIALS', 5)
    # All is learnt from noise and slips that are far stronger.
    learnt_from = {'rest_1', 'taps_1', 'slip_1', 'slip_2', 'slip_4', 'slip_5'}
    write_recordings(tmp_path, gains=dict.fromkeys(learnt_from, 10.0))
    running = DetectorConfig.from_yaml(Path('config/onset.yaml'))
    run = TuneRun(listed(tmp_path), 'index', running)
    asyncio.run(finished(run))
    assert run.kept.startswith('on the held-out recordings the best found is worse: misses 2 of 2')
    assert DetectorConfig.from_yaml(tmp_path / 'tuning' / 'tuned.yaml') == running
    assert run.described()['changes'] > 0  # They can be applied nevertheless.


def test_a_run_that_is_stopped_before_the_search_found_nothing(recorded):
    run = TuneRun(listed(recorded), 'index', DetectorConfig())
    asyncio.run(finished(run, run.stop))
    assert run.failed == 'stopped before anything was found'


def test_there_have_to_be_two_slips(tmp_path):
    write_recordings(tmp_path, slips=1)
    with pytest.raises(ValueError, match='there are 1 recordings of slips, allowed: two or more'):
        TuneRun(listed(tmp_path), 'index', DetectorConfig())


def test_what_tunes_ends_when_nobody_listens_any_more_as_slip_view_was_killed(recorded):
    run = TuneRun(listed(recorded), 'index', DetectorConfig())
    run._connection.close()
    run._process.join(DEADLINE_S)
    assert run._process.exitcode == 1


def changes_between(before, after):
    """Return by heading what is said of a change of figures."""
    return {row[0]: row[3] for row in tuning.compared(before, after)}


def test_of_what_finds_no_slip_or_was_on_before_nothing_is_better():
    before = {**dict.fromkeys(MAIN_FIGURES, 1.0), 'latency_p90_ms': 90.0}
    never = {**dict.fromkeys(MAIN_FIGURES, 0.0), 'latency_p90_ms': None}
    assert {*changes_between(before, never).values()} == {'worse', ''}
    fewer = {**before, 'recall': 0.5, 'latency_p90_ms': 50.0}
    assert changes_between(before, fewer)[heading('latency_p90_ms')] == ''
    early = {**before, 'latency_median_ms': -96.3, 'latency_p90_ms': 80.0}
    changes = changes_between(early, before)
    assert changes[heading('latency_median_ms')] == ''
    assert changes[heading('latency_p90_ms')] == 'worse'


def test_what_is_left_out_as_its_rate_is_another_is_said_first(recorded):
    folder = listed(recorded)
    folder.sample_rate_hz, folder.rates_hz['slip_3'] = 380.0, 420.0
    run = TuneRun(folder, 'index', DetectorConfig())
    run.kill()
    words = ['slip_3 is left out: it has 420 Hz by its stamps, the detector 380 Hz']
    assert run.lines == words
    assert 'slip_3' not in run.held_out
    job = TuneJob({}, {kind: [] for kind in KINDS}, [], words, recorded, 1)
    assert learnt(job, {}, lambda **changes: None)[1][:1] == words
