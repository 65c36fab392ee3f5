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

"""The study of a search, in memory and in storages that workers share."""

import optuna
import pytest

from slip_detector.tuning.study import Study, open_storage


def test_a_storage_that_stays_locked_is_said_to_be(tmp_path, monkeypatch):
    import sqlite3

    monkeypatch.setattr('slip_detector.tuning.study.PATIENCE_S', 0.2)
    where = f'sqlite:///{tmp_path}/study.db'
    distributions = {'x': optuna.distributions.FloatDistribution(0.0, 1.0)}
    study = Study(where, 'a', distributions, seed=0)
    with sqlite3.connect(tmp_path / 'study.db') as other:
        other.execute('BEGIN EXCLUSIVE')
        trial = study.ask()
        with pytest.raises(ValueError, match=r'storage sqlite:.*locked'):
            study.tell(trial, 1.0, {})
        other.rollback()


DISTRIBUTIONS = {'x': optuna.distributions.FloatDistribution(0.0, 1.0)}


def test_workers_of_one_study_read_each_others_trials(tmp_path):
    where = str(tmp_path / 'study.journal')
    a, b = (Study(where, 'a', DISTRIBUTIONS, seed) for seed in range(2))
    a.tell(a.ask({'x': 0.25}), 3.0, {'found': 'by a'})
    b.tell(b.ask({'x': 0.5}), 2.0, {'found': 'by b'})
    assert (a.follow(), b.follow()) == (2, 2)
    for study in (a, b):
        told = {
            trial.params['x']: (trial.value, trial.user_attrs['found']) for trial in study.trials
        }
        assert told == {0.25: (3.0, 'by a'), 0.5: (2.0, 'by b')}
    # Another question in the same storage knows nothing of them.
    assert Study(where, 'other', DISTRIBUTIONS, 0).follow() == 0


def test_a_point_without_a_chain_counts_as_tried_and_has_no_cost():
    study = Study(None, 'a', DISTRIBUTIONS, seed=0)
    study.tell(study.ask(), None, {})
    assert study.follow() == 1
    assert study.trials == []


def test_a_seed_asks_for_the_same_points():
    points = []
    for _ in range(2):
        study = Study(None, 'a', DISTRIBUTIONS, seed=3)
        points.append([])
        for _ in range(15):
            trial = study.ask()
            points[-1].append(trial.params['x'])
            study.tell(trial, trial.params['x'], {})
    assert points[0] == points[1]


def test_a_storage_that_is_none_is_named():
    with pytest.raises(
        ValueError, match=r'^storage study.txt: is not known, allowed: a path that'
    ):
        open_storage('study.txt')
