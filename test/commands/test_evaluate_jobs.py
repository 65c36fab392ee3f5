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

"""``slip_evaluate`` with several processes: the same figures, progress, and what Ctrl-C leaves."""

import json

import pytest

from slip_detector.commands.evaluate import main
from support.evaluation_cases import complaint, write
from support.interrupts import check_interrupted_evaluation


def test_any_number_of_jobs_gives_the_same_figures_and_report(capsys, tmp_path):
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc')]
    outputs, pages = [], []
    for jobs in ('1', '2'):
        page = tmp_path / 'page.html'
        words = [*map(str, paths), '--jobs', jobs, '--json', '--report', str(page)]
        assert main(words) == 0
        shown = capsys.readouterr()
        assert shown.err == ''
        outputs.append(shown.out)
        pages.append(page.read_text(encoding='utf-8'))
    assert list(json.loads(outputs[0])['sets'][tmp_path.name]['recordings']) == [
        'a.npz', 'b.npz', 'c.npz',
    ]  # fmt: skip
    assert outputs[1] == outputs[0]
    assert pages[1] == pages[0]


def test_what_is_wrong_with_a_recording_is_said_as_without_jobs(capsys, tmp_path):
    good = write(tmp_path / 'a.npz')
    bad = tmp_path / 'no.npz'
    assert complaint(capsys, good, bad, '--jobs', 2) == complaint(capsys, good, bad)


@pytest.mark.parametrize('jobs', ['1', '2'])
def test_a_terminal_shows_how_many_are_done_and_an_interrupt_leaves_these(tmp_path, jobs):
    check_interrupted_evaluation(tmp_path, '--jobs', jobs)


def test_an_interrupt_is_said_in_the_tables(capsys, tmp_path, monkeypatch):
    def interrupted(self, function, arguments):
        yield 0, function(arguments[0])
        raise KeyboardInterrupt

    monkeypatch.setattr('slip_detector.commands.workers.Workers.results', interrupted)
    paths = [write(tmp_path / f'{name}.npz') for name in 'ab']
    assert main([*map(str, paths)]) == 130
    assert capsys.readouterr().out.splitlines()[-1] == f'Stopped early, not evaluated: {paths[1]}'


def test_processes_and_a_cluster_exclude_each_other_and_the_protocol(capsys, tmp_path):
    words = [write(tmp_path / 'a.npz'), '--jobs', 2, '--cluster', 'tcp://127.0.0.1:8786']
    assert complaint(capsys, *words, code=2).startswith(
        'argument --cluster: not allowed with argument --jobs'
    )
    assert complaint(capsys, '--protocol', 'paper', '--jobs', 2, code=2).startswith(
        '--jobs is for recordings, allowed: without --protocol'
    )
