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

"""``slip_tune``: the files that it writes, studies that go on, what it refuses, how it ends."""

import contextlib
import pkgutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from slip_detector.commands.tune import main
from slip_detector.parameters.detector import DetectorConfig
from support.evaluation_cases import complaint
from support.interrupts import check_interrupted_search
from support.tuning_cases import PARAMETERS, journal, run, slips, trials_of, write


@pytest.fixture
def case(tmp_path):
    """A parameter file and three short recordings."""
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc', 4)]
    return tmp_path, [*paths, '--config', str(tmp_path / 'given.yaml')]


def test_the_file_has_the_figures_and_all_that_was_not_searched(case, capsys):
    folder, words = case
    out, page = folder / 'out.yaml', folder / 'report.html'
    (folder / 'more').mkdir()
    (folder / 'c.npz').rename(folder / 'more' / 'c.npz')
    run(folder, *words[3:], '--out', out, '--report', page, '--verbose', '--trials', 12)
    shown = capsys.readouterr()
    assert '\n8 of 12 trials, ' in shown.err
    assert '12 of 12 trials, so far finds 8 of 8 slips, ON without slip ' in shown.err
    *lines, answer, written = shown.out.splitlines()
    assert answer.startswith('Finds 4 of 4 slips')
    assert written == f'Written: {out}, {page}'
    trials = trials_of(journal(f'{out}.study.journal'))
    usable = sum(trial.value is not None for trial in trials)
    assert lines[:3] == [
        f'12 trials, {usable} of them usable, seed 0',
        f'Tuned on: {folder.name}/a.npz, more/c.npz (8 slips in 0.4 min)',
        f'Held out, and not tuned on: {folder.name}/b.npz (4 slips in 0.2 min)',
    ]
    comments = [line[2:] for line in out.read_text().splitlines() if line.startswith('#')]
    assert comments[2:] == [answer, *lines]
    assert any('false alarms per minute' in line for line in lines)
    config = DetectorConfig.from_yaml(out)
    assert config.heartbeat_hz == 20.0
    assert config.threshold != 0.05
    assert '<td>all held out, tuned</td>' in page.read_text()


def test_without_optuna_it_says_what_to_install(case, monkeypatch, capsys):
    folder, words = case
    monkeypatch.setitem(sys.modules, 'optuna', None)
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    run(*words, '--out', folder / 'out.yaml', code=1)
    assert capsys.readouterr().err == (
        "slip_tune: needs optuna, which is not installed: pip install 'slip_detector[tune]'\n"
    )


#: What is refused: the arguments, a part of the line, and the exit code.
REFUSED = [
    ('--out o.yaml', 'are required: RECORDING', 2),
    ('nix.npz --out o.yaml', 'nix.npz: ', 1),
    ('still.npz --out o.yaml', 'still.npz: too few slips', 1),
    ('a.npz --out o.yaml --storage s --report s', '--report s: is read too', 1),
    ('a.npz --out given.yaml', '--out given.yaml: is read too, allowed: a file of its own', 1),
    ('a.npz --out o.yaml --seed x', "--seed: is 'x', allowed: a whole number, 0 to ", 2),
    ('--quiet still.npz --out o.yaml', 'parameter decision is mean, allowed: evidence', 1),
    ('a.npz --false-alarms-per-hour 1 --out o.yaml', 'goes with --quiet', 2),
    ('a.npz --quiet still.npz --out o.yaml', 'no RECORDING with it', 2),
    ('--quiet still.npz --false-alarms-per-hour 0 --out o.yaml', 'allowed: a number above 0', 2),
    ('--quiet still.npz --press still.npz --out o.yaml', 'nothing, allowed: no --press', 2),
]


@pytest.mark.parametrize(('words', 'line', 'code'), REFUSED)
def test_wrong_arguments_are_refused_in_one_line(words, line, code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path('given.yaml').write_text(PARAMETERS)
    write('a.npz', 1)
    write('still.npz', 1, slips=False)
    given = *words.split(), '--config', 'given.yaml'
    assert line in complaint(capsys, *given, code=code, command=main)
    assert not Path('o.yaml').exists()


def test_an_interrupt_keeps_what_was_found_and_the_same_command_goes_on(case):
    words, store = check_interrupted_search(case, '--jobs', 2, number=signal.SIGTERM)
    before = len(trials_of(journal(store)))
    run(*words, '--trials', before + 2)
    assert len(trials_of(journal(store))) == before + 2


#: Where an interrupt comes: the function, and whether there is something to keep.
PHASES = [
    ('slip_detector.tuning.tracks.load_tracks', False),
    ('slip_detector.tuning.verdict.contradictions', False),
    ('slip_detector.tuning.verdict.Study', False),
    ('slip_detector.tuning.verdict.judge', True),
    ('slip_detector.report.page.replay_variant', True),
    ('slip_detector.commands.tune.write_yaml', True),
    ('slip_detector.report.page.write_page', True),
]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(('name', 'kept'), PHASES)
def test_an_interrupt_at_any_moment_keeps_what_was_found(name, kept, number, case, monkeypatch):
    folder, words = case
    function, left = pkgutil.resolve_name(name), [number]

    def interrupted(*args, **kwargs):
        while left:
            signal.raise_signal(left.pop())
        return function(*args, **kwargs)

    monkeypatch.setattr(name, interrupted)
    files = [folder / 'out.yaml', folder / 'report.html']
    with contextlib.nullcontext() if kept else pytest.raises(KeyboardInterrupt):
        run(*words, '--out', files[0], '--report', files[1], '--trials', 3)
    assert [file.exists() for file in files] == [kept, kept]


def test_a_report_that_cannot_be_written_costs_only_the_report(case, monkeypatch, capsys):
    folder, words = case
    out, report = folder / 'out.yaml', folder / 'no' / 'report.html'
    monkeypatch.setattr('slip_detector.commands.workers.check_writable', lambda path: None)
    run(*words, '--out', out, '--report', report, '--trials', 2, code=1)
    assert f'{report}: cannot be written (' in (said := capsys.readouterr().err)
    assert said.endswith(f'; {out} is written\n')
    assert DetectorConfig.from_yaml(out).channels == 4


def test_what_finds_none_of_the_held_out_slips_says_so_first(case, capsys):
    folder, words = case
    volts, _ = slips(6, slips=False)
    np.savez(folder / 'b.npz', volts=volts, label=slips(6)[1], sample_rate_hz=380.0)
    run(*words, '--out', folder / 'out.yaml', '--trials', 12)
    *said, _ = capsys.readouterr().out.splitlines()
    assert [line.partition(' slips.')[0] for line in said] == [
        'Nothing better was found: on what was held out, the best that was tried finds none of 4',
        'The given parameters stay. Finds none of 4', 'What was tried: Finds none of 4',
    ]  # fmt: skip
