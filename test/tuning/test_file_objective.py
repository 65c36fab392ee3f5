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

"""The objective that reads the recordings of its problem itself."""

import copy
import pickle

import numpy as np
import pytest

from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.tuning import file_objective
from slip_detector.tuning.file_objective import FileObjective
from slip_detector.tuning.loading import TrainingFiles
from slip_detector.tuning.space import SearchSpace
from support.tuning_cases import CHAIN, problem, write


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
    monkeypatch.setattr(file_objective, '_last', ('', None))
    first = objective.candidates(point)
    monkeypatch.setattr(TrainingFiles, 'load', None)
    # As it comes with each call.
    assert copy.deepcopy(objective).candidates(point) == first


def test_other_recordings_under_the_same_paths_are_refused(files, monkeypatch):
    objective = FileObjective(files, problem(files.load()[0]))
    monkeypatch.setattr(file_objective, '_last', ('', None))
    (folder,) = files.paths
    write(f'{folder}/a.npz', 3)
    with pytest.raises(ValueError, match=f'^{folder}: a worker finds other recordings there'):
        objective.candidates(SearchSpace(CHAIN).starts()[0])


def test_a_point_without_a_chain_has_no_candidates(files):
    objective = FileObjective(files, problem(files.load()[0]))
    point = SearchSpace(CHAIN).starts()[0]
    assert objective.candidates({**point, 'passband_low_hz': np.nan}) == []
