"""``slip_tune`` in several processes, and what Ctrl-C leaves."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import optuna
import pytest

from slip_detector.commands.tune import main
from slip_detector.parameters.detector import DetectorConfig
from support.tuning_cases import journal, trials_of

DEADLINE_S = 120.0


def run(*words, code=0):
    assert main([str(word) for word in words]) == code


def start(*words):
    command = [sys.executable, '-m', 'slip_detector.commands.tune', *map(str, words)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONWARNINGS': 'ignore'},
    )  # fmt: skip


@pytest.mark.parametrize('kind', ['journal', 'sqlite'])
def test_two_processes_share_a_study(case, kind):
    folder, words = case
    store = folder / f'study.{"journal" if kind == "journal" else "db"}'
    where = str(store) if kind == 'journal' else f'sqlite:///{store}'
    storage = journal(store) if kind == 'journal' else where
    workers = [
        start(*words, '--out', folder / f'{k}.yaml', '--storage', where, '--trials', 100_000,
              '--seed', k)
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


def wait_for(condition, *processes):
    """Look again and again, with a deadline: a storage tells nobody that it has changed."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        for process in processes:
            assert process.poll() is None, process.communicate()
        time.sleep(0.1)


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
    folder, words = case
    out = folder / 'out.yaml'
    store = Path(f'{out}.study.journal')
    process = start(*words, '--out', out, '--trials', 100_000, '--jobs', jobs)
    wait_for(lambda: store.exists() and store.read_bytes().count(b'"op_code":4') >= 4, process)
    process.send_signal(signal.SIGINT)
    shown, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, err
    assert 'Traceback' not in err
    assert 'Stopped early.' in shown
    assert DetectorConfig.from_yaml(out).channels == 4
    before = len(trials_of(journal(store)))
    assert before >= 3
    run(*words, '--out', out, '--trials', before + 2)
    assert len(trials_of(journal(store))) == before + 2
