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

"""A search: in this process, with recordings that are read where they are needed, and its end."""

import copy
import dataclasses
import pickle
import signal

import numpy as np
import pytest

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning import search as search_module
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.problem import searched
from slip_detector.tuning.search import FileObjective, TuningParameters, search, tune
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import TrainingFiles
from support.tuning_cases import CHAIN, problem, track, write


def test_a_search_finds_what_costs_less_and_keeps_the_rest_of_the_chain():
    given_chain = dataclasses.replace(CHAIN, passband_hz=(60.0, 120.0), stopbands_hz=())
    asked = problem([track(1), track(2)], given_chain)
    study = asked.study(None, 'a', seed=1)
    counts = []
    search(asked, study, 25, lambda: False, counts.append)
    assert counts == sorted(counts)
    assert set(counts) == set(range(1, 26))
    best = asked.best(study)
    free = Objective(asked.tracks, asked.evaluation, asked.config)
    assert best.cost_ms < free.as_it_is(given_chain).cost_ms - 20.0
    for field in dataclasses.fields(CHAIN):
        if field.name not in searched(best.chain):
            assert getattr(best.chain, field.name) == getattr(given_chain, field.name)
    choice = asked.choice(study)
    assert choice.cost_ms <= best.cost_ms + best.error_ms


def test_the_order_in_which_a_batch_is_done_changes_nothing():
    asked = problem([track(1)])
    objective = asked.objective()

    def in_order(points):
        return [
            (place, asked.candidates_at(objective, point)) for place, point in enumerate(points)
        ]

    found = []
    for results in (None, in_order, lambda points: in_order(points)[::-1]):
        study = asked.study(None, 'a', seed=1)
        search(asked, study, 24, lambda: False, lambda count: None, results)
        found.append(
            [(trial.params, trial.values, trial.user_attrs['found']) for trial in study.trials]
        )
    assert len(found[0]) > 15
    assert found[0] == found[1] == found[2]


def test_a_wish_to_stop_leaves_the_rest_of_a_batch_untold(tmp_path):
    asked = problem([track(1)])
    study = asked.study(str(tmp_path / 'a.journal'), 'a', seed=1)
    counts = []
    search(asked, study, 20, lambda: len(counts) >= 3, counts.append)
    assert study.follow() == 3


@pytest.fixture
def files(tmp_path):
    write(tmp_path / 'a.npz', 1)
    write(tmp_path / 'b.npz', 2)
    loader = RecordingLoader(
        CHAIN, RecordingConfig(recording_truth_key='label'), EvaluationConfig()
    )
    return TrainingFiles([str(tmp_path)], loader, share=0.5)


def test_it_says_what_the_objective_of_the_problem_says_and_is_small_to_send(files):
    asked = problem(files.load()[0])
    sent = pickle.dumps(FileObjective(files, asked))
    assert len(sent) < 10_000 < asked.tracks[0].volts.nbytes
    point = SearchSpace(CHAIN).starts()[0]
    assert pickle.loads(sent).candidates(point) == asked.candidates_at(asked.objective(), point)


def test_recordings_are_read_once_for_all_trials_of_a_problem(files, monkeypatch):
    objective = FileObjective(files, problem(files.load()[0]))
    point = SearchSpace(CHAIN).starts()[0]
    monkeypatch.setattr(search_module, '_last', ('', None))
    first = objective.candidates(point)
    monkeypatch.setattr(TrainingFiles, 'load', None)
    # As it comes with each call.
    assert copy.deepcopy(objective).candidates(point) == first


def test_other_recordings_under_the_same_paths_are_refused(files, monkeypatch):
    objective = FileObjective(files, problem(files.load()[0]))
    monkeypatch.setattr(search_module, '_last', ('', None))
    (folder,) = files.paths
    write(f'{folder}/a.npz', 3)
    with pytest.raises(ValueError, match=f'^{folder}: a worker finds other recordings there'):
        objective.candidates(SearchSpace(CHAIN).starts()[0])


def test_a_point_without_a_chain_has_no_candidates(files):
    objective = FileObjective(files, problem(files.load()[0]))
    point = SearchSpace(CHAIN).starts()[0]
    assert objective.candidates({**point, 'passband_low_hz': np.nan}) == []


def interrupted_at(*counts):
    """Return what interrupts a search when it has tried so many chains."""
    left = list(counts)

    def progress(count, best):
        while left and count >= left[0]:
            del left[0]
            signal.raise_signal(signal.SIGINT)

    return progress


def test_a_first_interrupt_keeps_what_was_found_and_a_second_ends_at_once(files, capsys):
    before = signal.getsignal(signal.SIGINT)
    parameters = TuningParameters(
        CHAIN, RecordingConfig(recording_truth_key='label'), EvaluationConfig(), TuneConfig()
    )
    result = tune(files, parameters, 1000, progress=interrupted_at(3))
    assert result.notes == ['Stopped early.']
    assert result.study.follow() == 3
    assert [track.name for track in result.held] == ['b.npz']
    with pytest.raises(KeyboardInterrupt):
        tune(files, parameters, 1000, progress=interrupted_at(3, 3))
    assert signal.getsignal(signal.SIGINT) is before
    assert capsys.readouterr().err.count('stopping') == 2


def test_the_best_chain_so_far_is_told_with_the_number_of_trials(files):
    told = []
    parameters = TuningParameters(
        CHAIN, RecordingConfig(recording_truth_key='label'), EvaluationConfig(), TuneConfig()
    )
    result = tune(files, parameters, 10, progress=lambda *each: told.append(each))
    counts, best = zip(*told, strict=True)
    assert counts == (0, *range(1, 9), 8, 9, 10, 10)
    assert best[0] is None
    assert best[-1] == result.problem.best(result.study)
