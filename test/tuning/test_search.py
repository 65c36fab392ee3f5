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

"""A search in this process and in others, its study and its end."""

import contextlib
import dataclasses
import os
import pickle
import signal
from pathlib import Path

import numpy as np
import pytest

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.tuning.problem import Candidate, Problem
from slip_detector.tuning.search import Study, Trial, search
from slip_detector.tuning.tracks import TrainingFiles
from slip_detector.tuning.verdict import TuningParameters, tune
from support.limits import full_disk
from support.python_runs import run_python
from support.tuning_cases import (
    CHAIN,
    EVIDENCE,
    RATE_HZ,
    problem,
    slips,
    study_of,
    track,
    track_with,
    write,
)

PARAMETERS = TuningParameters(CHAIN, RecordingConfig(recording_truth_key='label'))
PROBLEM, FOUND = Problem([], CHAIN), Candidate(CHAIN, 3.0, {'recall': 1.0})
POINT = Study(PROBLEM, 0).space.point(CHAIN)


class OnlyStages(Study):
    """Ends a search where chance would begin."""

    def ask(self):
        raise LookupError


def searched(asked, trials=10_000, storage=None, results=None):
    """Search up to a number of trials, but not by chance; return point and cost of all."""
    study = OnlyStages(asked, 0, storage)
    with contextlib.suppress(LookupError):
        search(study, trials, results=results)
    return [(point, candidate.cost_ms) for point, candidate in study.trials]


def test_a_search_tries_nothing_twice_and_the_same_in_parts_and_in_any_order(tmp_path):
    asked = problem([track(1, duration_s=6.0)])
    study = Study(asked, 0)

    def backwards(points):
        places = range(len(points) - 1, -1, -1)
        return ((place, study.candidate_at(points[place])) for place in places)

    whole, storage = searched(asked, 45), str(tmp_path / 'study.journal')
    for trials in (3, 20, 21, 45, 45):
        parts = searched(asked, trials, storage, backwards)
    assert parts == whole
    points = [trial.point for trial in study_of(asked, 300).trials]
    assert all(point not in points[:k] for k, point in enumerate(points))


def humming(seed, kind='', knock_v=0.0):
    """Return slips or knocks, all but one with hum, which differ from channel to channel."""
    volts, truth = slips(seed, slip_hz=90.0, slips=not kind)
    volts[truth] += 0.5 * np.random.default_rng(seed).standard_normal((truth.sum(), 4))
    signs, time_s = np.array([1.0, -1.0, -1.0, 1.0]), np.arange(len(volts)) / RATE_HZ
    hum = sum(np.sin(2 * np.pi * 60.0 * harmonic * time_s) for harmonic in range(1, 4))
    volts += 2.0 * (seed > 1) * signs * hum[:, np.newaxis]
    for at in range(200, len(volts), 380):
        volts[at : at + 12] += knock_v * signs * (-1.0) ** np.arange(12)[:, np.newaxis]
    return track_with(volts, truth, f'seed {seed}', kind=kind)


def test_stages_that_help_are_kept_while_others_are_tried():
    given = dataclasses.replace(EVIDENCE, passband_hz=(40.0, 0.0))
    asked = problem([humming(1), humming(2), humming(3, 'rest'), humming(4, 'taps', 20.0)], given)
    point, cost_ms = min(searched(asked), key=lambda one: one[1])
    assert (point['mains_hz'], point['impact']) == (60.0, 'learnt')
    for without in ({'mains_hz': 0.0}, {'impact': 'none'}):
        assert Study(asked, 0).candidate_at({**point, **without}).cost_ms > 2 * cost_ms


@pytest.fixture
def files(tmp_path):
    write(tmp_path / 'a.npz', 1)
    write(tmp_path / 'b.npz', 2)
    return TrainingFiles([str(tmp_path)], RecordingLoader(*PARAMETERS[:3]))


def test_other_processes_find_the_same_and_are_sent_the_recordings_once(files):
    functions = []

    def calls(function, points):
        functions.append(function)
        return enumerate(map(pickle.loads(pickle.dumps(function)), points))

    here, there = tune(files, PARAMETERS, 9), tune(files, PARAMETERS, 9, calls=calls)
    assert here.study.trials == there.study.trials
    assert functions[0] is functions[-1]
    assert len(functions) == 2


@pytest.mark.parametrize('where', ['{}/study.journal', 'sqlite:///{}/study.db'])
def test_workers_of_one_study_read_each_others_trials(where, tmp_path):
    where = where.format(tmp_path)
    trials = [Trial({**POINT, 'exponent': k}, FOUND._replace(cost_ms=float(k))) for k in (2, 1)]
    studies = [Study(PROBLEM, seed, where) for seed in range(2)]
    for study, trial in zip(studies, trials, strict=True):
        study.tell(*trial)
    assert [study.follow() for study in studies] == [2, 2]
    assert [study.trials for study in studies] == [trials, trials]
    assert studies[0].cheapest == trials[1].candidate
    assert Study(Problem([], EVIDENCE), 0, where).follow() == 0


@pytest.mark.parametrize(
    'where', ['nix://study', 'sqlite:///old.journal', 'folder.journal', 'pipe', 'sqlite:///pipe']
)
def test_what_is_no_storage_is_refused_in_one_line(where, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'old.journal').write_text('no journal')
    (tmp_path / 'folder.journal').mkdir()
    os.mkfifo(tmp_path / 'pipe')
    with pytest.raises(ValueError, match=f'^storage {where}: [^\n]+$'):
        Study(PROBLEM, 0, where)


@pytest.mark.parametrize(
    'more', ['{"op_co', 'null\n', 'no json\n{}\n', '{"op_code": "x"}\n', '[' * 100_000 + '\n']
)
def test_a_damaged_journal_is_refused_in_one_line_and_is_not_changed(more, tmp_path):
    path = tmp_path / 'study.journal'
    Study(PROBLEM, 0, str(path))
    damaged = path.read_text() + more
    path.write_text(damaged)
    with pytest.raises(ValueError, match=r'^storage .*study.journal: [^\n]{1,200}$') as refused:
        Study(PROBLEM, 0, str(path))
    said = 'is damaged (' if more.endswith('\n') else 'is cut off'
    assert said in str(refused.value)
    assert path.read_text() == damaged


@pytest.mark.timeout(60)
def test_what_a_killed_search_leaves_beside_a_journal_does_not_hold_up_the_next(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path('out').mkdir()
    # Killed while it writes; and as Optuna's own lock is left.
    done = run_python(
        '-c',
        'import os, signal\nfrom slip_detector.tuning.search import Problem, Study, _JournalLock\n'
        'Study(Problem([]), 0, "out/study.journal")\n_JournalLock("out/study.journal").acquire()\n'
        'os.kill(os.getpid(), signal.SIGKILL)',
    )
    assert done.returncode == -signal.SIGKILL
    Path('out/study.journal.lock').symlink_to('out/study.journal')
    Study(PROBLEM, 0, 'out/study.journal').tell(POINT, FOUND)


def test_damaged_trials_are_refused_in_one_line(files, tmp_path):
    path = tmp_path / 'study.journal'
    tune(files, PARAMETERS, 4, storage=str(path))
    path.write_text(path.read_text().replace('"figures"', '"figure"'))
    with pytest.raises(ValueError, match=f"^storage {path}: is damaged .KeyError: 'figures'.$"):
        tune(files, PARAMETERS, 5, storage=str(path))


def test_a_full_disk_is_one_line_and_the_trials_before_it_are_kept(tmp_path):
    path = tmp_path / 'study.journal'
    study = Study(PROBLEM, 0, str(path))
    study.tell(POINT, FOUND)
    whole = path.read_bytes()
    with (
        full_disk(len(whole) + 7),
        pytest.raises(ValueError, match=f'^storage {path}: File too large$'),
    ):
        study.tell({**POINT, 'exponent': 2}, FOUND)
    path.write_bytes(whole)  # without the line that was cut off
    assert Study(PROBLEM, 0, str(path)).follow() == 1
