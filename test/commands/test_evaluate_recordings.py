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

"""What ``slip_evaluate`` reads of recordings: their labels, rates, gaps and motion."""

import numpy as np
import pytest

from slip_detector.commands.evaluate import main
from support.evaluation_cases import (
    RATE_HZ,
    bag,
    complaint,
    config_file,
    expected_scores,
    report_of,
    roc_auc,
    write,
)


def test_motion_is_the_norm_over_the_named_columns_above_the_limit(capsys, tmp_path):
    # Column v_z would make every row one of motion, v_x or v_y alone none.
    moving = np.arange(600) >= 200
    arm = np.column_stack([0.03 * moving, np.ones(600), -0.04 * moving])
    names = ['v_x', 'v_z', 'v_y']
    path = write(tmp_path / 'a.npz', arm=arm, arm_names=names)
    keys = {'motion_key': 'arm', 'motion_columns': ['v_x', 'v_y'], 'moving_above': 0.045}
    config = config_file(tmp_path / 'c.yaml', **keys)
    figures = report_of(capsys, path, '--config', config)[tmp_path.name]
    score, slip = expected_scores(path)
    assert figures['moving_rows'] == 400
    assert figures['auc_moving'] == roc_auc(score[moving], slip[moving])
    assert figures['auc_moving'] != figures['auc_all']
    faster = config_file(tmp_path / 'd.yaml', **{**keys, 'moving_above': 0.051})
    figures = report_of(capsys, path, '--config', faster)[tmp_path.name]
    assert figures['moving_rows'] == 0
    assert figures['auc_moving'] is None
    every = config_file(tmp_path / 'e.yaml', motion_key='arm')
    assert report_of(capsys, path, '--config', every)[tmp_path.name]['moving_rows'] == 600


def test_bad_samples_and_gaps_are_counted(capsys, tmp_path):
    rng = np.random.default_rng(0)
    volts = 4.3 + 0.01 * rng.normal(size=(600, 16))
    volts[100, 3:5] = np.nan
    volts[200, 0] = np.inf
    time_s = np.arange(600) / RATE_HZ
    time_s[300:] += 10 / RATE_HZ
    time_s[500:] += 1.0
    table = np.column_stack([time_s, volts, np.zeros(600)])
    head = ','.join(['time_s', *(f'ch{i + 1}' for i in range(16)), 'slip'])
    np.savetxt(tmp_path / 'a.csv', table, '%.17g', ',', header=head, comments='')
    met = {'bad_samples': 3, 'gaps': 1, 'bridged_rows': 10, 'long_gaps': 1, 'dropped': 0}
    figures = report_of(capsys, tmp_path / 'a.csv')[tmp_path.name]
    assert met.items() <= figures.items()
    assert met.items() <= figures['recordings']['a.csv'].items()
    assert figures['rows'] == 610
    assert main([str(tmp_path / 'a.csv')]) == 0
    lines = capsys.readouterr().out.splitlines()
    (at,) = (k for k, line in enumerate(lines) if line.startswith('faults'))
    assert lines[at + 1].split() == ['a.csv', '3', '1', '10', '1', '0']
    # The detector's own parameter says which gap is bridged.
    config = config_file(tmp_path / 'c.yaml', {'max_gap_s': 2.0})
    figures = report_of(capsys, tmp_path / 'a.csv', '--config', config)[tmp_path.name]
    assert (figures['gaps'], figures['long_gaps']) == (2, 0)


@pytest.mark.parametrize('name', ['a.mcap', 'a.db3', 'a'])
def test_a_bag_and_an_npz_of_the_same_rows_have_the_same_figures(capsys, tmp_path, name):
    source = bag(tmp_path / 'bags' / name)
    expected = report_of(capsys, source)['source']
    # A folder of bags is a set, one that is a bag is a recording.
    for given_path in (tmp_path / 'bags', tmp_path / 'bags' / name):
        found = report_of(capsys, given_path)['bags']
        assert list(found['recordings']) == [name]
        for figure in ('rows', 'slips', 'alarms', 'auc_all', 'mean_delay_ms', 'long_gaps'):
            assert found[figure] == expected[figure]


def test_a_bag_that_was_cut_off_is_evaluated_and_says_so(capsys, tmp_path):
    path = tmp_path / 'bags' / 'a.mcap'
    bag(path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    figures = report_of(capsys, path)['bags']
    assert 0 < figures['rows'] < 600
    (of_file,) = figures['recordings'].values()
    assert 'is lost' in of_file['lost']
    assert main([str(path)]) == 0
    assert f'a.mcap: {of_file["lost"]}' in capsys.readouterr().out.splitlines()


def test_a_bag_without_labels_or_topic_says_what_is_missing(capsys, tmp_path):
    path = tmp_path / 'bags' / 'a.mcap'
    bag(path, truth=False)
    assert complaint(capsys, path) == (
        f'{path}: has no topic slip_truth or platform_position to label the slips, allowed: '
        'one, or a file of labels beside it, a.labels.yaml (--labels: elsewhere)'
    )
    assert '/voltages' in complaint(capsys, path, '--topic', 'nowhere')
    assert complaint(capsys, path, '--field', 'nothing').startswith(f'{path}: ')
    labels = tmp_path / 'a.labels.yaml'
    labels.write_text('slip_s:\n- [0.5, 1.0]\n')
    figures = report_of(capsys, path, '--labels', labels)['bags']
    assert (figures['slips'], figures['slip_rows']) == (1, 190)


@pytest.mark.parametrize('rate_hz', [RATE_HZ * 0.979, RATE_HZ * 1.021])
def test_another_rate_is_refused_naming_both(capsys, tmp_path, rate_hz):
    path = write(tmp_path / 'a.npz', rate_hz=rate_hz)
    assert complaint(capsys, path) == (
        f'{path}: has {rate_hz:g} Hz where the parameter sample_rate_hz is 380 Hz, '
        'allowed: at most 2% apart, or --resample (recording_resample: true)'
    )
    assert report_of(capsys, path, '--resample')


def test_a_recording_that_does_not_suit_is_named(capsys, tmp_path):
    narrow = write(tmp_path / 'narrow.npz', channels=8)
    assert complaint(capsys, narrow) == (
        f'{narrow}: has 8 channels, allowed: 16, the parameter channels'
    )
    unlabelled = write(tmp_path / 'unlabelled.npz', slip=None)
    assert complaint(capsys, unlabelled) == (
        f'{unlabelled}: has no label slip, there are: sample_rate_hz, volts; allowed: one, or a '
        'file of labels beside it, unlabelled.labels.yaml (--labels: elsewhere)'
    )
    broken = tmp_path / 'broken.npz'
    broken.write_bytes(unlabelled.read_bytes()[:-100])
    assert complaint(capsys, broken) == f'{broken}: is broken or not npz'
    missing = tmp_path / 'missing.npz'
    assert complaint(capsys, missing) == f'{missing}: cannot be read (No such file or directory)'
    assert 'is .wav, allowed: .npz, .csv' in complaint(capsys, tmp_path / 'a.wav')
