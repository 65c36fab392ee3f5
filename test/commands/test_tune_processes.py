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

"""``slip_tune`` in several processes, and what Ctrl-C leaves."""

import signal

import optuna
import pytest

from slip_detector.parameters.detector import DetectorConfig
from support.interrupts import DEADLINE_S, check_interrupted_search, start_tune, wait_for
from support.tuning_cases import journal, run, trials_of


def test_two_processes_share_a_study(case):
    folder, words = case
    where = folder / 'study.journal'
    storage = journal(where)
    workers = [
        start_tune(*words, '--out', folder / f'{k}.yaml', '--storage', where,
                   '--trials', 100_000, '--seed', k)
        for k in range(2)
    ]  # fmt: skip
    wait_for(lambda: both_have_tried(storage, 3), *workers)
    for worker in workers:
        worker.send_signal(signal.SIGINT)
    for k, worker in enumerate(workers):
        _, err = worker.communicate(timeout=DEADLINE_S)
        assert worker.returncode == 0, err
        assert 'Traceback' not in err
        assert DetectorConfig.from_yaml(folder / f'{k}.yaml').channels == 4
    trials = trials_of(storage)
    starts = [trial.params for trial in trials if trial.params == trials[0].params]
    assert 1 <= len(starts) <= 2  # both may have begun at once
    assert all(trial.state.is_finished() for trial in trials)


def both_have_tried(storage, many):
    if not optuna.get_all_study_names(storage):
        return False
    names = [trial.user_attrs['worker'] for trial in trials_of(storage)]
    return len({name for name in names if names.count(name) >= many}) == 2


def test_any_number_of_jobs_finds_the_same_to_the_bit(case):
    folder, words = case
    found = {}
    for jobs in (1, 2):
        out = folder / f'{jobs}.yaml'
        run(*words, '--out', out, '--trials', 20, '--jobs', jobs)
        found[jobs] = [
            (trial.params, trial.values, trial.user_attrs['found'])
            for trial in trials_of(journal(f'{out}.study.journal'))
        ]
    assert len(found[1]) == 20
    assert found[2] == found[1]
    assert DetectorConfig.from_yaml(folder / '2.yaml') == DetectorConfig.from_yaml(
        folder / '1.yaml'
    )


@pytest.mark.parametrize('jobs', [1, 2])
def test_an_interrupt_keeps_what_was_found_and_the_same_command_goes_on(case, jobs):
    words, store = check_interrupted_search(case, '--jobs', jobs)
    before = len(trials_of(journal(store)))
    run(*words, '--trials', before + 2)
    assert len(trials_of(journal(store))) == before + 2
