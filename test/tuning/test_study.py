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

from slip_detector.tuning.study import Study

DISTRIBUTIONS = {'x': optuna.distributions.FloatDistribution(0.0, 1.0)}


@pytest.mark.parametrize('where', ['{}/study.journal', 'sqlite:///{}/study.db'])
def test_workers_of_one_study_read_each_others_trials(where, tmp_path):
    where = where.format(tmp_path)
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


@pytest.mark.parametrize(
    ('where', 'line'),
    [
        ('study.txt', 'is not known, allowed: a path that ends in .journal'),
        ('nix://study', ''),
        ('sqlite:///old.journal', ''),
        ('folder.journal', 'Is a directory'),
    ],
)
def test_what_is_no_storage_is_refused_in_one_line(where, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'old.journal').write_text('no journal')
    (tmp_path / 'folder.journal').mkdir()
    with pytest.raises(ValueError, match=f'^storage {where}: {line}[^\n]*$'):
        Study(where, 'a', DISTRIBUTIONS, seed=0)


@pytest.mark.parametrize(
    'more', ['{"op_co', '[1,2]\n', 'null\n', '{"op_code": "x"}\n', '[' * 100_000 + '\n']
)
def test_a_damaged_journal_is_refused_in_one_line_and_is_not_changed(more, tmp_path):
    path = tmp_path / 'study.journal'
    Study(str(path), 'a', DISTRIBUTIONS, seed=0)
    damaged = path.read_text() + more
    path.write_text(damaged)
    with pytest.raises(ValueError, match=r'^storage .*study.journal: [^\n]{1,200}$') as refused:
        Study(str(path), 'a', DISTRIBUTIONS, seed=0)
    assert ('was cut off after 7 bytes' in str(refused.value)) == (not more.endswith('\n'))
    assert path.read_text() == damaged
