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

from slip_detector.commands.evaluate import main
from slip_detector.evaluation import evaluator
from slip_detector.evaluation.evaluator import evaluate_recording
from support.evaluation_cases import complaint, report_of, write
from support.pages import ROOT

#: Recordings of a real finger.
XELA = ROOT.parent / 'shared' / 'data' / 'xela_uskin_slip'


def test_json_has_the_figures_of_each_recording_of_each_set_and_of_all(capsys, tmp_path):
    paths = [write(tmp_path / f'{folder}' / 'a.npz', seed) for seed, folder in enumerate('xy')]
    assert main([*map(str, paths), '--json']) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report['sets']) == ['x', 'y']
    for whole in report['sets'].values():
        figures = whole['recordings']['a.npz']
        assert figures['auc_all'] == whole['auc_all'] > 0.5
        assert (figures['rows'], figures['slip_rows'], figures['slips']) == (600, 150, 1)
        assert (figures['auc_moving'], figures['moving_rows']) == (None, None)
    assert (report['all']['rows'], report['all']['slips']) == (1200, 2)
    assert main([*map(str, paths), '--verbose']) == 0
    shown = capsys.readouterr().out
    assert shown.startswith('\n'.join([*report['answer'], '\nrows ']))
    rows = r'^x/a.npz .*\ny/a.npz .*\nall of x +600 +150 .*\nall of y .*\nall recordings +1200 '
    assert re.search(rows, shown, re.M)


def test_what_cannot_be_used_of_a_folder_or_one_in_it_is_left_out_with_a_line(capsys, tmp_path):
    write(tmp_path / 'a.npz')
    write(tmp_path / 'in' / 'b.npz')
    write(tmp_path / 'other.npz', channels=3)
    (tmp_path / 'broken.npz').write_text('time_s,a')
    assert main([str(tmp_path)]) == 0
    said = capsys.readouterr().out.splitlines()
    wrong = 'has 3 channels, allowed: 16, the parameter channels'
    assert f'Left out: {tmp_path / "other.npz"}: {wrong}' in said
    broken = f'{tmp_path / "broken.npz"}: is cut off, or no npz, allowed: what numpy.savez writes'
    assert f'Left out: {broken}' in said
    assert main([str(tmp_path), '--json']) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report['sets']) == [tmp_path.name, 'in']
    assert report['left_out'][wrong] == [str(tmp_path / 'other.npz')]


def test_decisions_that_mean_nothing_are_warned_of_in_line_json_and_report(capsys, tmp_path):
    counts = 20000 + np.round(20 * np.random.default_rng(0).standard_normal((8 * 250, 2)))
    np.savez(tmp_path / 'a.npz', volts=counts, sample_rate_hz=250.0)
    (tmp_path / 'c.yaml').write_text(
        'slip_detector: {ros__parameters: {sample_rate_hz: 250.0, channels: 2, stopbands_hz: [], '
        'decision: evidence, noise_floor: [1.0e-9], gain: 1.0, exponent: 1}}'
    )
    page = tmp_path / 'page.html'
    words = [str(tmp_path / 'a.npz'), '--config', str(tmp_path / 'c.yaml'), '--report', str(page)]
    said = 'noise floor of ch1, ch2 at its upper limit, noise_floor_range_db above noise_floor: '
    assert main(words) == 0
    assert f'\na.npz: {said}' in capsys.readouterr().out
    assert f'<p>a.npz: {said}' in page.read_text(encoding='utf-8')
    assert main([*words, '--json']) == 0
    (one,) = json.loads(capsys.readouterr().out)['sets'].values()
    assert one['recordings']['a.npz']['warnings'][0].startswith(said)


def test_any_number_of_jobs_gives_the_same_figures_and_report(capsys, tmp_path):
    for seed, name in enumerate(('s10', 's9', 'r')):
        write(tmp_path / f'{name}.npz', seed)
    (tmp_path / 'broken.npz').touch()
    outputs, page = [], tmp_path / 'page.html'
    for jobs in ('1', '2'):
        words = [str(tmp_path), '--jobs', jobs, '--json', '--report', str(page)]
        assert main(words) == 0
        shown = capsys.readouterr()
        assert shown.err == ''
        report = json.loads(shown.out)
        assert report['written'] == [str(page)]
        assert [*report['left_out'].values()] == [[str(tmp_path / 'broken.npz')]]
        outputs.append((shown.out, re.sub(r'[\d-]+ [\d:]+ UTC', '', page.read_text('utf-8'))))
    assert outputs[1] == outputs[0]
    assert re.findall(r'<td>(\w+).npz', outputs[0][1])[:3] == ['r', 's9', 's10']


def test_what_cannot_be_done_is_refused_in_one_line_before_anything_is_read(capsys, tmp_path):
    recording, no_labels = tmp_path / 'not there.npz', tmp_path / 'no'
    kinds = '.npz, .csv, .mcap, .db3, .bag or folders of bags'
    missing = 'cannot be read (No such file or directory)'
    for words, said in (
        ((recording, '--report', tmp_path), f'{tmp_path}: cannot be written (is no file)'),
        ((recording, '--labels', no_labels), f'--labels {no_labels}: {missing}'),
        ((tmp_path,), f'{tmp_path}: has no recordings, allowed: {kinds}'),
    ):
        assert complaint(capsys, *words) == said


def test_an_interrupt_leaves_what_was_evaluated(capsys, tmp_path, monkeypatch):
    paths = [write(tmp_path / f'{name}.npz') for name in 'ab']

    def one_done(loader, path, observe):
        if path.name == 'b.npz':
            raise KeyboardInterrupt
        return evaluate_recording(loader, path, observe)

    monkeypatch.setattr(evaluator, 'evaluate_recording', one_done)
    assert main([*map(str, paths)]) == 130
    assert capsys.readouterr().out.splitlines()[-1] == f'Stopped early, not evaluated: {paths[1]}'
    with pytest.raises(KeyboardInterrupt):
        main([str(paths[1])])


@pytest.mark.skipif(not XELA.is_dir(), reason=f'no recordings at {XELA}')
def test_the_real_finger_is_told_sliding_from_holding_and_from_moving(capsys):
    (report,) = report_of(capsys, XELA, '--config', 'xela_uskin.yaml').values()
    assert len(report['recordings']) == 7
    assert (report['rows'], report['slip_rows'], report['moving_rows']) == (2195, 196, 1512)
    # On the rows that the configuration was chosen on.
    assert report['auc_all'] == pytest.approx(0.964, abs=1e-3)
    assert report['auc_moving'] == pytest.approx(0.947, abs=1e-3)
    assert (report['slips'], report['settling_slips'], report['matched']) == (4, 0, 3)
    assert (report['false_alarms'], report['rest_s']) == (2, pytest.approx(28.2, abs=0.1))
    assert report['false_time_percent'] == pytest.approx(4.6, abs=0.1)
