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

"""``slip_evaluate`` on recordings: figures, tables and report, what it refuses, how it ends."""

import json
import re

import numpy as np
import pytest

from slip_detector.commands import evaluate as evaluation
from slip_detector.commands.evaluate import main
from slip_detector.evaluation.evaluator import evaluate_recording
from support.evaluation_cases import (
    complaint,
    config_file,
    expected_scores,
    report_of,
    roc_auc,
    write,
)
from support.full_disk import full_disk


def test_json_has_the_figures_of_each_recording_of_each_set_and_of_all(capsys, tmp_path):
    paths = [write(tmp_path / f'{folder}' / 'a.npz', seed) for seed, folder in enumerate('xy')]
    assert main([*map(str, paths), '--json']) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report['sets']) == ['x', 'y']
    scores = [expected_scores(path) for path in paths]
    for whole, (score, slip) in zip(report['sets'].values(), scores, strict=True):
        figures = whole['recordings']['a.npz']
        assert figures['auc_all'] == whole['auc_all'] == roc_auc(score, slip)
        assert (figures['rows'], figures['slip_rows'], figures['slips']) == (600, 150, 1)
        assert (figures['auc_moving'], figures['moving_rows']) == (None, None)
    pooled = roc_auc(*(np.concatenate(parts) for parts in zip(*scores, strict=True)))
    assert report['all']['auc_all'] == pooled
    assert (report['all']['rows'], report['all']['slips']) == (1200, 2)


def test_tables_have_a_line_for_each_recording_and_the_whole_last(capsys, tmp_path):
    write(tmp_path / 'set' / 'a.npz')
    write(tmp_path / 'set' / 'b.npz', slip=np.zeros(600))
    figures = report_of(capsys, tmp_path / 'set')['set']
    assert main([str(tmp_path / 'set')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.split(r'\s{2,}', lines[0]) == [
        'set', 'rows', 'slip rows', 'moving rows', 'settling rows', 'AUC all', 'AUC moving'
    ]  # fmt: skip
    of_a = f'{figures["recordings"]["a.npz"]["auc_all"]:.3f}'
    assert lines[1].split() == ['a.npz', '600', '150', '-', '164', of_a, '-']
    assert lines[2].split() == ['b.npz', '600', '0', '-', '164', '-', '-']
    assert re.split(r'\s{2,}', lines[3])[:3] == ['all rows', '1200', '150']
    write(tmp_path / 'other' / 'a.npz')
    assert main([str(tmp_path / 'set'), str(tmp_path / 'other')]) == 0
    text = capsys.readouterr().out
    assert re.search(r'^all sets .*\nset +1200 .*\nother +600 .*\nall rows +1800', text, re.M)


def test_any_number_of_jobs_gives_the_same_figures_and_report(capsys, tmp_path):
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc')]
    outputs, page = [], tmp_path / 'page.html'
    for jobs in ('1', '2'):
        words = [*map(str, paths), '--jobs', jobs, '--json', '--report', str(page)]
        assert main(words) == 0
        shown = capsys.readouterr()
        assert shown.err == ''
        assert json.loads(shown.out)['written'] == [str(page)]
        outputs.append((shown.out, page.read_bytes()))
    assert outputs[1] == outputs[0]


def test_a_report_that_cannot_be_written_is_refused_before_anything_is_read(capsys, tmp_path):
    path = write(tmp_path / 'in' / 'a.npz')
    line = complaint(capsys, tmp_path / 'not there.npz', '--report', tmp_path)
    assert line == f'{tmp_path}: cannot be written (is no file)'
    line = complaint(capsys, path.parent, '--report', path)
    assert line == f'--report {path}: is a recording, allowed: a file of its own'
    page = tmp_path / 'page.html'
    page.write_bytes(b'of yesterday')
    with full_disk(left_bytes=20_000):
        line = complaint(capsys, path, '--report', page)
    assert line == f'{page}: cannot be written (File too large)'
    assert page.read_bytes() == b'of yesterday'


def test_wrong_arguments_and_recordings_are_refused_in_one_line(capsys, tmp_path):
    assert complaint(capsys, code=2).startswith('required: either RECORDINGs or --protocol')
    path = write(tmp_path / 'in' / 'a.npz')
    (tmp_path / 'empty').mkdir()
    assert complaint(capsys, tmp_path / 'empty') == (
        f'{tmp_path / "empty"}: has no recordings, allowed: .npz, .csv, .mcap, .db3, .bag or bags'
    )
    assert complaint(capsys, path, path.parent) == f'{path}: is given twice, allowed: each once'
    unlabelled = write(tmp_path / 'in' / 'b.npz', slip=None)
    assert complaint(capsys, path.parent).startswith(f'{unlabelled}: has no label')
    config = config_file(tmp_path / 'c.yaml', {'vote': 9})
    said = f'{config}: parameter vote is 9, allowed: at most 4'
    assert complaint(capsys, path, '--config', config).startswith(said)
    said = f'{tmp_path / "no.yaml"}: cannot be read (No such file or directory)'
    assert complaint(capsys, path, '--config', tmp_path / 'no.yaml') == said


def test_an_interrupt_is_one_line_and_leaves_what_was_evaluated(capsys, tmp_path, monkeypatch):
    paths = [write(tmp_path / f'{name}.npz') for name in 'ab']

    def one_done(loader, path):
        if path.name == 'b.npz':
            raise KeyboardInterrupt
        return evaluate_recording(loader, path)

    monkeypatch.setattr(evaluation, 'evaluate_recording', one_done)
    assert main([*map(str, paths)]) == 130
    assert capsys.readouterr().out.splitlines()[-1] == f'Stopped early, not evaluated: {paths[1]}'
    with pytest.raises(KeyboardInterrupt):
        main([str(paths[1])])
