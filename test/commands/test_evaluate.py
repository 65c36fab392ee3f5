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

"""``slip_evaluate``: its figures, tables, files and what it refuses."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.commands import evaluate as evaluation
from slip_detector.commands.evaluate import main
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from support.evaluation_cases import (
    complaint,
    config_file,
    expected_scores,
    report_of,
    roc_auc,
    write,
)
from support.full_disk import full_disk


def test_json_has_the_figures_of_each_recording_and_of_all_rows_together(capsys, tmp_path):
    paths = [write(tmp_path / 'set' / f'{name}.npz', seed) for seed, name in enumerate('ab')]
    report = report_of(capsys, tmp_path / 'set')
    assert list(report) == ['set']
    assert list(report['set']['recordings']) == ['a.npz', 'b.npz']
    scores = [expected_scores(path) for path in paths]
    for path, (score, slip) in zip(paths, scores, strict=True):
        area = roc_auc(score, slip)
        assert 0.5 < area < 1.0
        wanted = {
            'auc_all': area,
            'auc_moving': None,
            'rows': 600,
            'slip_rows': 150,
            'moving_rows': None,
            'slips': 1,
        }
        figures = report['set']['recordings'][path.name]
        assert {name: figures[name] for name in wanted} == wanted
    pooled = roc_auc(*(np.concatenate(parts) for parts in zip(*scores, strict=True)))
    assert report['set']['auc_all'] == pooled
    assert (report['set']['rows'], report['set']['slip_rows']) == (1200, 300)


def test_each_recording_starts_with_a_chain_that_remembers_nothing(capsys, tmp_path):
    a, b = (write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('ab'))
    after_a = report_of(capsys, a, b)[tmp_path.name]['recordings']['b.npz']
    alone = report_of(capsys, b)[tmp_path.name]['recordings']['b.npz']
    assert after_a == alone


def test_the_table_has_a_line_for_each_recording_and_the_whole_last(capsys, tmp_path):
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
    whole = f'{figures["auc_all"]:.3f}'
    assert re.split(r'\s{2,}', lines[3]) == ['all rows', '1200', '150', '-', '328', whole, '-']
    assert lines[-2] == 'set: no bad samples, no gaps, no rows dropped'
    assert lines[-1].startswith('-: not defined')
    assert len({len(line) for line in lines[:4]}) == 1


def test_figures_are_those_of_the_replay(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    config = config_file(tmp_path / 'c.yaml', {'threshold': 2.0}, early_s=0.4, late_after_s=0.05)
    with np.load(path) as file:
        outcome = Replay(
            ChainConfig(threshold=2.0), EvaluationConfig(early_s=0.4, late_after_s=0.05)
        ).run([Samples.evenly(file['volts'], 380.0, file['slip'])])
    found = report_of(capsys, path, '--config', config)[tmp_path.name]['recordings']['a.npz']
    assert figures_of_merit([outcome]).items() <= found.items()
    # The ridges begin 150 rows before they are called slip.
    assert figures_of_merit([outcome])['matched'] == 1
    assert -0.4 < outcome.slips[0].latency_s < -0.2
    assert found['slip_events'] == [
        {**dataclasses.asdict(slip), 'channel_delays_s': list(slip.channel_delays_s)}
        for slip in outcome.slips
    ]
    assert found['alarm_events'] == [dataclasses.asdict(alarm) for alarm in outcome.alarms]


def test_several_sets_have_their_figures_and_those_of_all(capsys, tmp_path):
    a, b = write(tmp_path / 'x' / 'a.npz'), write(tmp_path / 'y' / 'b.npz', seed=1)
    assert main([str(a), str(b), '--json']) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report['sets']) == ['x', 'y']
    assert (report['all']['rows'], report['all']['slips']) == (1200, 2)
    assert main([str(a), str(b)]) == 0
    text = capsys.readouterr().out
    assert re.search(r'^all sets +rows .*\nx +600 .*\ny +600 .*\nall rows +1200 ', text, re.M)


def test_a_report_and_pictures_are_written_and_named(capsys, tmp_path):
    for folder in 'xy':
        write(tmp_path / folder / 'a.npz', seed=ord(folder))
    page, folder = tmp_path / 'page.html', tmp_path / 'pictures'
    arguments = [str(tmp_path / 'x'), str(tmp_path / 'y'), '--report', str(page)]
    assert main([*arguments, '--plot', str(folder), '--json']) == 0
    written = [Path(path) for path in json.loads(capsys.readouterr().out)['written']]
    assert written[0] == page
    assert set(written[1:]) == set(folder.iterdir())
    assert folder / 'evaluation.png' in written
    assert all(path.stat().st_size for path in written)
    text = page.read_text(encoding='utf-8')
    assert 'x/a.npz' in text
    assert 'y/a.npz' in text
    assert main([*arguments]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f'Written: {page}'


def test_a_place_that_cannot_be_written_to_is_named(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    page = tmp_path / 'no' / 'page.html'
    assert complaint(capsys, path, '--report', page) == (
        f'{page}: cannot be written (No such file or directory)'
    )
    assert complaint(capsys, path, '--plot', path) == f'{path}: cannot be made (File exists)'


def test_a_full_disk_leaves_the_report_and_the_pictures_as_they_were(capsys, tmp_path):
    path, page = write(tmp_path / 'in' / 'a.npz'), tmp_path / 'page.html'
    folder = tmp_path / 'pictures'
    folder.mkdir()
    names = ('evaluation.png', 'filters.png', 'timeline_a.npz.png', 'figures.txt')
    before = dict.fromkeys([page, *(folder / name for name in names)], b'of yesterday')
    for file, content in before.items():
        file.write_bytes(content)
    with full_disk(left_bytes=20_000):
        line = complaint(capsys, path, '--report', page, '--plot', folder)
        assert line == f'{page}: cannot be written (File too large)'
        picture, _, why = complaint(capsys, path, '--plot', folder).partition(': ')
    assert why == 'cannot be written (File too large)'
    assert Path(picture) in before
    assert Path(picture).suffix == '.png'
    assert {file: file.read_bytes() for file in [page, *folder.iterdir()]} == before
    assert set(tmp_path.iterdir()) == {path.parent, page, folder}


def test_a_report_is_not_written_over_a_recording(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    before = path.read_bytes()
    for given in (path, tmp_path):
        assert complaint(capsys, given, '--report', path) == (
            f'--report {path}: is read too, allowed: a file of its own'
        )
    assert path.read_bytes() == before


def test_a_report_that_cannot_be_written_is_said_before_anything_is_read(capsys, tmp_path):
    line = complaint(capsys, tmp_path / 'not there.npz', '--report', tmp_path)
    assert line == f'{tmp_path}: cannot be written (is a folder)'


def test_an_interrupt_is_one_line(capsys, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, 'evaluate', interrupted)
    assert main([str(write(tmp_path / 'a.npz'))]) == 130
    assert capsys.readouterr() == ('', 'slip_evaluate: ended before it was done\n')


def test_the_folder_one_stands_in_has_its_name_too(capsys, tmp_path, monkeypatch):
    write(tmp_path / 'here' / 'a.npz')
    monkeypatch.chdir(tmp_path / 'here')
    assert list(report_of(capsys, '.')) == ['here']
    assert list(report_of(capsys, 'a.npz')) == ['here']


def test_no_recording_an_empty_folder_and_a_doubled_one_are_refused(capsys, tmp_path):
    assert complaint(capsys, code=2).startswith('the following arguments are required: RECORDING')
    assert complaint(capsys, '--what', code=2).startswith('unrecognized arguments: --what')
    (tmp_path / 'notes.txt').touch()
    assert complaint(capsys, tmp_path) == (
        f'{tmp_path}: has no recordings, allowed: .npz, .csv, .mcap, .db3 or bags'
    )
    path = write(tmp_path / 'a.npz')
    assert complaint(capsys, path, tmp_path) == f'{path}: is given twice, allowed: each once'


@pytest.mark.parametrize(
    ('sections', 'said'),
    [
        ({'detector': {'vote': 9}}, 'parameter vote is 9, allowed: at most 4'),
        ({'driver': {'recording_key': 'a'}}, 'unknown parameter recording_key'),
        ({'moving_above': -1.0}, 'parameter moving_above is -1 m/s, allowed: 0 to 1e+06 m/s'),
        ({'motion_columns': ['v_x']}, "parameter motion_key is '', allowed: the name of an array"),
        (
            {'motion_key': 'v', 'motion_columns': [1]},
            'parameter motion_columns has 1, allowed: a list of names',
        ),
        ({'motion_key': 'v', 'motion_columns': 'v_x'}, "motion_columns is 'v_x', allowed: a list"),
        ({'moving': 1}, 'unknown parameter moving'),
    ],
)
def test_a_wrong_configuration_is_named(capsys, tmp_path, sections, said):
    config = config_file(tmp_path / 'c.yaml', **sections)
    line = complaint(capsys, write(tmp_path / 'a.npz'), '--config', config)
    assert line.startswith(f'{config}: ')
    assert said in line


def test_a_missing_configuration_is_named(capsys, tmp_path):
    config = tmp_path / 'no.yaml'
    line = complaint(capsys, write(tmp_path / 'a.npz'), '--config', config)
    assert line == f'{config}: cannot be read (No such file or directory)'
