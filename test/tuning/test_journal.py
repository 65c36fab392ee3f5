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

"""Journals of studies that were cut off or hold something else."""

import json

import optuna
import pytest

from slip_detector.tuning.journal import mend_journal
from slip_detector.tuning.study import Study

DISTRIBUTIONS = {'x': optuna.distributions.FloatDistribution(0.0, 1.0)}


@pytest.fixture
def journal(tmp_path):
    """A journal of three trials."""
    path = tmp_path / 'study.journal'
    study = Study(str(path), 'a', DISTRIBUTIONS, seed=0)
    for x in (0.25, 0.5, 0.75):
        study.tell(study.ask({'x': x}), x, {})
    return path


def trials_of(path):
    study = Study(str(path), 'a', DISTRIBUTIONS, seed=0)
    return [trial.params['x'] for trial in study.trials], study.lost


def test_a_journal_cut_at_any_byte_of_its_last_line_goes_on_without_it(journal):
    whole = journal.read_bytes()
    begin = whole.rstrip(b'\n').rfind(b'\n') + 1
    for end in (begin + 1, begin + 40, len(whole) - 2, len(whole) - 1):
        journal.write_bytes(whole[:end])
        read, lost = trials_of(journal)
        assert read == [0.25, 0.5]
        assert lost.startswith(f'{journal}: line {whole.count(10)} was cut off after')
        study = Study(str(journal), 'a', DISTRIBUTIONS, seed=0)
        study.tell(study.ask({'x': 0.1}), 0.1, {})
        assert trials_of(journal) == ([0.25, 0.5, 0.1], '')


def test_a_whole_journal_is_not_changed(journal):
    whole = journal.read_bytes()
    assert mend_journal(journal) == ''
    assert journal.read_bytes() == whole
    assert mend_journal(journal.with_name('new.journal')) == ''
    assert not journal.with_name('new.journal').exists()


@pytest.mark.parametrize(
    'line', ['[1,2]', 'null', '7', 'no JSON', '{}', '{"op_code": "x"}', '[' * 100_000]
)
def test_a_line_that_is_no_entry_is_named(journal, line):
    whole = journal.read_text()
    journal.write_text(f'{whole}{line}\n')
    number = whole.count('\n') + 1
    with pytest.raises(ValueError, match=rf'^storage .*: line {number} is ') as caught:
        trials_of(journal)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < len(str(journal)) + 120


def test_an_entry_that_optuna_cannot_read_is_one_line(journal):
    lines = journal.read_text().splitlines()
    for key in json.loads(lines[-1]):
        broken = json.dumps({**json.loads(lines[-1]), key: 99})
        journal.write_text('\n'.join([*lines[:-1], broken, '']))
        try:
            trials_of(journal)
        except ValueError as error:
            assert str(error).startswith(f'storage {journal}: ')  # noqa: PT017
            assert '\n' not in str(error)  # noqa: PT017


def test_what_is_no_file_is_refused(tmp_path):
    (tmp_path / 'a.journal').mkdir()
    with pytest.raises(ValueError, match=r'^storage .*a\.journal: is no file, allowed'):
        trials_of(tmp_path / 'a.journal')
