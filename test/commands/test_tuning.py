"""The command slip_tune: files, studies that go on, and what it never does."""

import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import optuna
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.commands.tune import main
from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.problem import SEARCHED
from slip_detector.tuning.study import Study
from slip_detector.tuning.tracks import track_of
from slip_detector.tuning.verdict import judge
from support.tuning_cases import CHAIN, PARAMETERS, problem, slips, track, write

DEADLINE_S = 120.0


@pytest.fixture
def case(tmp_path):
    """A parameter file and three short recordings."""
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc')]
    return tmp_path, [*paths, '--config', str(tmp_path / 'given.yaml')]


def run(*words, code=0):
    assert main([str(word) for word in words]) == code


def trials_of(storage):
    (name,) = optuna.get_all_study_names(storage)
    return optuna.load_study(study_name=name, storage=storage).get_trials(deepcopy=False)


def journal(path):
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    return JournalStorage(JournalFileBackend(str(path)))


def test_the_file_has_the_figures_and_all_that_was_not_searched(case, capsys):
    folder, words = case
    out = folder / 'out.yaml'
    run(*words, '--out', out, '--report', folder / 'report.html', '--trials', 12)
    shown = capsys.readouterr()
    assert 'Held out, and not tuned on: c.npz (4 slips in 0.2 min)' in shown.out
    assert '12 of 12 trials, best' in shown.err
    text = out.read_text()
    comments = [line for line in text.splitlines() if line.startswith('#')]
    assert any('Tuned on: a.npz, b.npz (8 slips in 0.4 min)' in line for line in comments)
    assert any('false alarms per minute' in line for line in comments)
    before, after = yaml.safe_load(PARAMETERS), yaml.safe_load(text)
    tuned = after['/**/slip_detector']['ros__parameters']
    for name, value in before['/**/slip_detector']['ros__parameters'].items():
        assert name in SEARCHED or tuned[name] == value
    for section in ('/**/slip_driver', '/**/slip_evaluate', '/**/other_node'):
        assert after[section] == before[section]
    config = DetectorConfig.from_yaml(out)
    assert config.heartbeat_hz == 20.0
    assert config.threshold != 0.05
    assert (folder / 'report.html').read_text().startswith('<!DOCTYPE html>')


@pytest.mark.nodes
def test_the_node_starts_with_the_file(case):
    pytest.importorskip('rclpy', reason='needs rclpy')
    from support.harness import Bench, Detected

    folder, words = case
    out = folder / 'out.yaml'
    run(*words, '--out', out, '--trials', 3)
    bench = Bench()
    try:
        detected = Detected(bench, '--params-file', out)
        detected.settle([4.3] * 4, 1_000_000_000, round(1e9 / 380.0))
        assert len(detected.envelope[-1].position) == 4
    finally:
        bench.close()


def test_the_same_command_goes_on_and_another_question_begins_anew(case, capsys):
    folder, words = case
    out = folder / 'out.yaml'
    store = f'{out}.study.journal'
    run(*words, '--out', out, '--trials', 4)
    first = [trial.params for trial in trials_of(journal(store))]
    run(*words, '--out', out, '--trials', 7)
    params = [trial.params for trial in trials_of(journal(store))]
    assert len(params) == 7
    assert params[:4] == first
    run(*words, '--out', out, '--trials', 7)
    assert [trial.params for trial in trials_of(journal(store))] == params
    capsys.readouterr()
    run(*words, '--out', out, '--trials', 2, '--hold-out', 0.6)
    assert '2 trials (2 asked for)' in capsys.readouterr().out
    assert len(optuna.get_all_study_names(journal(store))) == 2


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


def test_jobs_are_processes_of_one_study(case):
    folder, words = case
    out = folder / 'out.yaml'
    run(*words, '--out', out, '--trials', 30, '--jobs', 2)
    trials = trials_of(journal(f'{out}.study.journal'))
    assert 30 <= len(trials) <= 31
    assert 1 <= len({trial.user_attrs['worker'] for trial in trials}) <= 2
    assert DetectorConfig.from_yaml(out).channels == 4


def test_what_is_held_out_by_name_is_not_tuned_on(case, capsys):
    folder, words = case
    (folder / 'link.npz').symlink_to(folder / 'b.npz')
    run(*words, '--held-out', folder / 'link.npz', '--out', folder / 'out.yaml', '--trials', 2)
    shown = capsys.readouterr().out
    assert 'Tuned on: a.npz, c.npz (8 slips in 0.4 min)' in shown
    assert 'Held out, and not tuned on: link.npz (4 slips in 0.2 min)' in shown


def test_a_copy_of_what_is_tuned_on_is_not_held_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path('given.yaml').write_text(PARAMETERS)
    write('a.npz', 1)
    shutil.copy('a.npz', 'b.npz')
    run('a.npz', 'b.npz', '--config', 'given.yaml', '--out', 'o.yaml', code=1)
    assert capsys.readouterr().err == (
        'slip_tune: b.npz: is held out and holds the same as a.npz, which is tuned on, allowed: '
        'each recording once\n'
    )


def test_a_file_takes_the_place_of_an_old_one_and_leaves_nothing_beside_it(case, monkeypatch):
    folder, words = case
    out = folder / 'out.yaml'
    out.write_text('old')
    before = set(folder.iterdir())
    monkeypatch.setattr(os, 'replace', lambda *_: (_ for _ in ()).throw(OSError(28, 'is full')))
    run(*words, '--out', out, '--trials', 1, code=1)
    assert set(folder.iterdir()) == before | {Path(f'{out}.study.journal')}
    assert out.read_text() == 'old'
    monkeypatch.undo()
    run(*words, '--out', out, '--trials', 1)
    assert DetectorConfig.from_yaml(out).channels == 4
    assert out.stat().st_mode == (folder / 'given.yaml').stat().st_mode


def test_the_report_marks_the_given_and_the_tuned_in_the_trade_off(case):
    folder, words = case
    page = folder / 'page.html'
    pictures = folder / 'out'
    run(*words, '--out', folder / 'out.yaml', '--report', page, '--plot', pictures, '--trials', 12)
    assert {path.name for path in pictures.iterdir()} == {
        'timeline_1_c.npz.png', 'timeline_2_a.npz.png', 'timeline_3_b.npz.png', 'filters.png',
        'front.png', 'figures.txt',
    }  # fmt: skip
    text = page.read_text()
    assert '12 trials, of which' in text
    section = text[text.index('<h2>Trade-off') : text.index('<h2>Filter')]
    assert '<tr><td>given</td>' in section
    assert '<tr><td>tuned</td>' in section


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


@settings(max_examples=6)
@given(seed=st.integers(0, 1000), held_hz=st.sampled_from([4.0, 18.0, 70.0, 150.0]))
def test_what_is_handed_back_is_never_worse_on_what_was_held_out(seed, held_hz):
    """Also where the held-out slips are of another kind than those tuned on."""
    from slip_detector.tuning.search import search

    asked = problem([track(seed, slip_hz=18.0), track(seed + 1, slip_hz=18.0)])
    held = [track(seed + 2, slip_hz=held_hz)]
    study = asked.study(None, 'a', seed=seed)
    search(asked, study, 10, lambda: False, lambda count: None)
    verdict = judge(asked, held, asked.choice(study))
    objective = Objective(held, EvaluationConfig(), TuneConfig())
    before, after = objective.as_it_is(asked.given), objective.as_it_is(verdict.chain)
    assert after.figures.worse_than(before.figures) == []
    assert after.cost_ms <= before.cost_ms
    if verdict.kept:
        assert verdict.chain is asked.given


def test_adversarial_recordings_leave_the_given_parameters(tmp_path, capsys):
    """Tuned on slips of 150 Hz, judged on slips of 18 Hz beside hum of 150 Hz."""
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    paths = [write(tmp_path / f'{k}.npz', k, slip_hz=150.0) for k in range(2)]
    held = write(tmp_path / 'held.npz', 9, slip_hz=18.0)
    volts, truth = slips(9, slip_hz=18.0)
    volts += (
        ~truth[:, None] * 2.0 * np.sin(2 * np.pi * 150.0 * np.arange(len(truth)) / 380.0)[:, None]
    )
    np.savez(held, volts=volts, label=truth, sample_rate_hz=380.0)
    out = tmp_path / 'out.yaml'
    given = tmp_path / 'given.yaml'
    run(*paths, '--held-out', held, '--config', given, '--out', out, '--trials', 15)
    assert 'The given parameters are kept: on the held-out recordings' in capsys.readouterr().out
    assert ChainConfig.from_yaml(out) == CHAIN
    assert 'are kept' in out.read_text()


def test_with_trade_one_figure_may_get_worse(case):
    tracks = [track(1), track(2)]
    asked = problem(tracks)
    free = dataclasses.replace(asked, config=TuneConfig(trade=True), figures=None)
    objective = Objective(tracks, EvaluationConfig(), TuneConfig())
    found = objective.as_it_is(dataclasses.replace(CHAIN, threshold=0.03))
    given_too_careful = dataclasses.replace(CHAIN, threshold=0.5)
    free = dataclasses.replace(free, given=given_too_careful)
    asked = dataclasses.replace(asked, given=given_too_careful)
    before = objective.as_it_is(given_too_careful)
    assert found.cost_ms < before.cost_ms
    worse = found.figures.worse_than(before.figures)
    assert judge(free, tracks, found).kept == ''
    assert bool(judge(asked, tracks, found).kept) == bool(worse)


ERRORS = {
    'no recording': (['--out', 'o.yaml'], 'are required: RECORDING', 2),
    'no such recording': (['nix.npz', '--out', 'o.yaml'], 'nix.npz: ', 1),
    'no label': (['bare.npz', '--out', 'o.yaml'], 'bare.npz: has no label', 1),
    'no slip': (['still.npz', '--out', 'o.yaml'], 'still.npz: has no slip', 1),
    'no slip held out': (
        ['a.npz', '--held-out', 'still.npz', '--out', 'o.yaml'],
        'still.npz: has no slip, allowed: some with slips held out', 1,
    ),
    'all held out by name': (
        ['a.npz', '--held-out', 'a.npz', '--out', 'o.yaml'],
        'no recording is left, allowed: some with slips to tune on', 1,
    ),
    'a device': (['a.npz', '--out', '/dev/null'], '/dev/null: cannot be written (is no file)', 1),
    'one slip': (['short.npz', '--out', 'o.yaml'], 'short.npz: has one slip', 1),
    'no folder': (['a.npz', '--out', 'nix/o.yaml'], 'nix/o.yaml: cannot be written', 1),
    'no folder of the report': (
        ['a.npz', '--out', 'o.yaml', '--report', 'nix/r.html'],
        'nix/r.html: cannot be written', 1,
    ),
    'unknown storage': (
        ['a.npz', '--out', 'o.yaml', '--storage', 'study.txt'],
        'storage study.txt: is not known', 1,
    ),
    'unknown database': (
        ['a.npz', '--out', 'o.yaml', '--storage', 'nix://x'], 'storage nix://x: ', 1,
    ),
    'broken journal': (
        ['a.npz', '--out', 'o.yaml', '--storage', 'broken.journal'],
        'storage broken.journal: ', 1,
    ),
    'broken database': (
        ['a.npz', '--out', 'o.yaml', '--storage', 'sqlite:///broken.journal'],
        'storage sqlite:///broken.journal: ', 1,
    ),
    'half of quiet': (['--quiet', 'still.npz', '--out', 'o.yaml'], 'go together', 2),
    'quiet and more': (
        ['a.npz', '--quiet', 'still.npz', '--false-alarms-per-hour', '1', '--out', 'o.yaml'],
        'allowed: no RECORDING with it', 2,
    ),
    'no rate': (
        ['--quiet', 'still.npz', '--false-alarms-per-hour', '0', '--out', 'o.yaml'],
        'allowed: a number above 0', 2,
    ),
    'all held out': (['a.npz', '--hold-out', '1', '--out', 'o.yaml'], 'between 0 and 1', 2),
    'no trials': (['a.npz', '--trials', '0', '--out', 'o.yaml'], 'whole number from 1', 2),
}  # fmt: skip


@pytest.mark.parametrize('what', ERRORS)
def test_what_is_wrong_is_said_in_one_line(what, tmp_path, monkeypatch, capsys):
    words, line, code = ERRORS[what]
    monkeypatch.chdir(tmp_path)
    Path('given.yaml').write_text(PARAMETERS)
    write('a.npz', 1)
    write('bare.npz', 1, label=False)
    write('still.npz', 1, slips=False)
    write('short.npz', 1, duration_s=3.0)
    Path('broken.journal').write_text('no journal\n' * 100)
    if code == 2:
        with pytest.raises(SystemExit) as left:
            main([*words, '--config', 'given.yaml'])
        assert left.value.code == code
    else:
        run(*words, '--config', 'given.yaml', code=code)
    error = capsys.readouterr().err
    assert error.startswith('slip_tune: ')
    assert line in error
    assert error.count('\n') == 1
    assert not Path('o.yaml').exists()


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


def test_without_optuna_it_says_what_to_install(case, monkeypatch, capsys):
    folder, words = case
    monkeypatch.setitem(sys.modules, 'optuna', None)
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    run(*words, '--out', folder / 'out.yaml', code=1)
    assert capsys.readouterr().err == (
        "slip_tune: needs optuna, which is not installed: pip install 'slip_detector[tune]'\n"
    )


def test_a_bad_sample_and_a_gap_are_counted(tmp_path, capsys):
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    volts, truth = slips(1, duration_s=12.0)
    volts[100, 2] = np.nan
    np.savez(tmp_path / 'a.npz', volts=volts, label=truth, sample_rate_hz=380.0)
    words = ['--config', tmp_path / 'given.yaml', '--out', tmp_path / 'o.yaml', '--trials', 2]
    run(tmp_path / 'a.npz', *words)
    assert 'a.npz: 1 values that are no number' in capsys.readouterr().out


def test_a_track_of_a_recording_with_a_gap_keeps_its_time():
    volts, truth = slips(1, duration_s=6.0)
    stamps = np.round(np.arange(len(volts)) * 1e9 / 380.0).astype(np.int64)
    stamps[1000:] += 2_000_000_000
    pieces = [
        LabelledRows(volts[:1000], truth[:1000], stamps[:1000]),
        LabelledRows(volts[1000:], truth[1000:], stamps[1000:], new_stretch=True),
    ]
    whole = track_of('a', pieces, 380.0)
    assert whole.pieces[1].first_row == 1000 + 760
    assert whole.slips[-1].start == np.flatnonzero(np.diff(truth.astype(int)) == 1)[-1] + 1 + 760
