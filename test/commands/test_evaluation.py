"""Figures of merit against their definitions, and the command line that prints them."""

import dataclasses
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.commands import evaluate as evaluation
from slip_detector.commands.evaluate import main, recording_sets
from slip_detector.evaluation.labelled_rows import REST, SLIP, LabelledRows
from slip_detector.evaluation.replay import Replay, figures_of_merit
from slip_detector.evaluation.scores import ScoreTally
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import write_recording

ROOT = Path(__file__).parents[2]
TALLY = ScoreTally()
XELA_CONFIG = ROOT / 'config' / 'xela_uskin.yaml'
XELA = ROOT.parent / 'shared' / 'data' / 'xela_uskin_slip'
needs_xela = pytest.mark.skipif(not XELA.is_dir(), reason=f'no recordings at {XELA}')

RATE_HZ = 380.0


# Command line.


HALF_OF_IT = np.arange(600) >= 450


def write(path, seed=0, channels=16, rate_hz=RATE_HZ, slip=HALF_OF_IT, **more):
    """Write a recording: noise, and in its second half ridges of which half is called slip."""
    rng = np.random.default_rng(seed)
    t = np.arange(600) / rate_hz
    volts = 4.3 + 0.01 * rng.normal(size=(600, channels))
    volts += 0.02 * (np.sin(2 * np.pi * 25.0 * t) * (t > t[300]))[:, np.newaxis]
    arrays = {'volts': volts, 'sample_rate_hz': rate_hz, **more}
    if slip is not None:
        arrays['slip'] = slip
    path.parent.mkdir(exist_ok=True)
    np.savez(path, **arrays)
    return path


def config_file(path, detector=None, driver=None, **evaluate):
    sections = {'slip_detector': detector, 'slip_driver': driver, 'slip_evaluate': evaluate}
    document = {
        f'/**/{node}': {'ros__parameters': values} for node, values in sections.items() if values
    }
    path.write_text(yaml.safe_dump(document))
    return str(path)


def report_of(capsys, *arguments):
    assert main([*map(str, arguments), '--json']) == 0
    captured = capsys.readouterr()
    assert captured.err == ''
    return json.loads(captured.out)['sets']


def complaint(capsys, *arguments, code=1):
    """Run what must fail; returns the one line that it says."""
    try:
        status = main([*map(str, arguments)])
    except SystemExit as leave:
        status = leave.code
    captured = capsys.readouterr()
    assert status == code
    assert captured.out == ''
    assert captured.err.count('\n') == 1
    assert captured.err.endswith('\n')
    return captured.err.removeprefix('slip_evaluate: ').rstrip('\n')


def roc_auc(score, label):
    TALLY.add(score, np.where(label, SLIP, REST))
    return TALLY.take().auc()


def expected_scores(path):
    with np.load(path) as file:
        result = SlipChain().update(file['volts'], votes=('all',))
        return result.vote_statistic[:, 0], file['slip']


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


def test_rows_of_slip_count_also_where_the_robot_stands(capsys, tmp_path):
    moving = np.arange(600) < 450  # All but the rows with slip.
    path = write(tmp_path / 'a.npz', speed=1.0 * moving)
    config = config_file(tmp_path / 'c.yaml', motion_key='speed')
    figures = report_of(capsys, path, '--config', config)[tmp_path.name]
    assert figures['moving_rows'] == 450
    assert figures['auc_moving'] == figures['auc_all']


def test_the_table_has_a_line_for_each_recording_and_the_whole_last(capsys, tmp_path):
    write(tmp_path / 'set' / 'a.npz')
    write(tmp_path / 'set' / 'b.npz', slip=np.zeros(600))
    figures = report_of(capsys, tmp_path / 'set')['set']
    assert main([str(tmp_path / 'set')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.split(r'\s{2,}', lines[0]) == [
        'set', 'rows', 'slip rows', 'moving rows', 'AUC all', 'AUC moving'
    ]  # fmt: skip
    of_a = f'{figures["recordings"]["a.npz"]["auc_all"]:.3f}'
    assert lines[1].split() == ['a.npz', '600', '150', '-', of_a, '-']
    assert lines[2].split() == ['b.npz', '600', '0', '-', '-', '-']
    whole = f'{figures["auc_all"]:.3f}'
    assert re.split(r'\s{2,}', lines[3]) == ['all rows', '1200', '150', '-', whole, '-']
    assert lines[-2] == 'set: no bad samples, no gaps, no rows dropped'
    assert lines[-1].startswith('-: not defined')
    assert len({len(line) for line in lines[:4]}) == 1


def test_figures_are_those_of_the_replay(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    config = config_file(tmp_path / 'c.yaml', {'threshold': 2.0}, early_s=0.4, late_after_s=0.05)
    with np.load(path) as file:
        outcome = Replay(
            ChainConfig(threshold=2.0), EvaluationConfig(early_s=0.4, late_after_s=0.05)
        ).run([LabelledRows(file['volts'], file['slip'])])
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
    (at,) = (k for k, line in enumerate(lines) if line.startswith('what was met'))
    assert lines[at + 1].split() == ['a.csv', '3', '1', '10', '1', '0']
    # The detector's own parameter says which gap is bridged.
    config = config_file(tmp_path / 'c.yaml', {'max_gap_s': 2.0})
    figures = report_of(capsys, tmp_path / 'a.csv', '--config', config)[tmp_path.name]
    assert (figures['gaps'], figures['long_gaps']) == (2, 0)


def bag(path, n=600, truth=True):
    """Write the recording of :func:`write` as a bag."""
    pytest.importorskip('rosbags', reason='needs rosbags')
    source = write(path.parents[1] / 'source' / 'a.npz')
    with np.load(source) as file:
        rows = Samples(
            file['volts'][:n],
            np.rint(np.arange(n) * 1e9 / RATE_HZ).astype(np.int64),
            file['slip'][:n] if truth else None,
        )
    write_recording(path, [rows], RATE_HZ, [f'ch{i + 1}' for i in range(16)])
    return source


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
        f'{path}: has no topic slip_truth or platform_position that tells the slips, allowed: '
        'one, or a file of labels beside it, a.labels.yaml (--labels: elsewhere)'
    )
    assert '/voltages' in complaint(capsys, path, '--topic', 'nowhere')
    assert complaint(capsys, path, '--field', 'nothing').startswith(f'{path}: ')
    labels = tmp_path / 'a.labels.yaml'
    labels.write_text('slip_s:\n- [0.5, 1.0]\n')
    figures = report_of(capsys, path, '--labels', labels)['bags']
    assert (figures['slips'], figures['slip_rows']) == (1, 190)


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
    line = complaint(capsys, path, '--plot', path)
    assert line.startswith(f'{path}: cannot be written')


def test_a_report_that_cannot_be_written_is_said_before_anything_is_read(capsys, tmp_path):
    line = complaint(capsys, tmp_path / 'not there.npz', '--report', tmp_path)
    assert line == f'{tmp_path}: cannot be written (is a folder)'


def test_an_interrupt_is_one_line(capsys, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, 'evaluate', interrupted)
    assert main([str(write(tmp_path / 'a.npz'))]) == 130
    assert capsys.readouterr() == ('', 'slip_evaluate: ended before it was done\n')


def test_csv_and_npz_of_the_same_rows_score_the_same(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    with np.load(path) as file:
        table = np.column_stack([np.arange(600) / RATE_HZ, file['volts'], file['slip']])
    head = ','.join(['time_s', *(f'ch{i + 1}' for i in range(16)), 'slip'])
    np.savetxt(tmp_path / 'a.csv', table, '%.17g', ',', header=head, comments='')
    recordings = report_of(capsys, tmp_path)[tmp_path.name]['recordings']
    assert list(recordings) == ['a.csv', 'a.npz']
    a, b = recordings['a.csv'], recordings['a.npz']
    # The rate of a csv file is that of its times, to their last digits.
    events = {'slip_events', 'alarm_events', 'lost'}
    assert a == {
        name: a[name] if name in events or value is None else pytest.approx(value)
        for name, value in b.items()
    }
    assert len(a['slip_events']) == len(b['slip_events']) == 1


def test_files_of_one_folder_are_one_set_and_folders_are_sorted(tmp_path):
    for name in ('x/b.npz', 'x/a.csv', 'x/notes.txt', 'y/c.npz', 'z/x/d.npz'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    x, y, zx = tmp_path / 'x', tmp_path / 'y', tmp_path / 'z' / 'x'
    given_files = [str(x / 'b.npz'), str(y / 'c.npz'), str(y / '..' / 'x' / 'a.csv')]
    assert {k: [f.name for f in v] for k, v in recording_sets(given_files).items()} == {
        'x': ['b.npz', 'a.csv'],
        'y': ['c.npz'],
    }
    assert recording_sets([str(x)]) == {'x': [x / 'a.csv', x / 'b.npz']}
    # Two folders of one name are told apart.
    assert list(recording_sets([str(x), str(y), str(zx)])) == [str(x), 'y', str(zx)]


def test_the_folder_one_stands_in_has_its_name_too(capsys, tmp_path, monkeypatch):
    write(tmp_path / 'here' / 'a.npz')
    monkeypatch.chdir(tmp_path / 'here')
    assert list(report_of(capsys, '.')) == ['here']
    assert list(report_of(capsys, 'a.npz')) == ['here']


@pytest.mark.parametrize('rate_hz', [RATE_HZ * 0.981, RATE_HZ * 1.019])
def test_a_rate_within_two_percent_is_taken(capsys, tmp_path, rate_hz):
    assert report_of(capsys, write(tmp_path / 'a.npz', rate_hz=rate_hz))


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
    assert 'is .bag, allowed: .npz, .csv' in complaint(capsys, tmp_path / 'a.bag')


def test_one_bad_recording_in_a_folder_is_no_reason_to_leave_it_out(capsys, tmp_path):
    write(tmp_path / 'set' / 'a.npz')
    unlabelled = write(tmp_path / 'set' / 'b.npz', slip=None)
    assert complaint(capsys, tmp_path / 'set').startswith(f'{unlabelled}: has no label')


def test_a_csv_with_other_names_than_configured_is_refused(capsys, tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('time_s,right,left,slip\n0,1,1,0\n0.1,2,2,1\n')
    detector = {
        'sample_rate_hz': 10.0,
        'channels': 2,
        'channel_names': ['left', 'right'],
        'passband_hz': [1.0, 4.0],
        'stopbands_hz': [],
        'envelope_window_s': 0.1,
        'decision_window_s': 0.1,
    }
    config = config_file(tmp_path / 'c.yaml', detector)
    assert complaint(capsys, path, '--config', config) == (
        f'{path}: has the channels right, left, allowed: left, right, the parameter channel_names'
    )
    config = config_file(tmp_path / 'c.yaml', {**detector, 'channel_names': ['right', 'left']})
    assert report_of(capsys, path, '--config', config)


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
    ('arrays', 'evaluate', 'said'),
    [
        ({}, {'motion_key': 'v'}, ': has no array v, there are: sample_rate_hz, slip, volts'),
        (
            {'v': np.zeros(599)},
            {'motion_key': 'v'},
            ': v has 599 rows, allowed: as many as the recording has',
        ),
        (
            {'v': np.zeros(601)},
            {'motion_key': 'v'},
            ': v has 601 rows, allowed: as many as the recording has',
        ),
        (
            {'v': np.zeros((600, 2, 2))},
            {'motion_key': 'v'},
            ': v has the shape (600, 2, 2) and type float64, allowed: numbers of shape',
        ),
        (
            {'v': np.array(['a'] * 600)},
            {'motion_key': 'v'},
            ': v has the shape (600,) and type <U1, allowed: numbers of shape',
        ),
        (
            {'v': np.where(np.arange(600) == 41, np.nan, 1.0)},
            {'motion_key': 'v'},
            ': v is not finite in row 42, allowed: finite numbers',
        ),
        (
            {'v': np.zeros((600, 2))},
            {'motion_key': 'v', 'motion_columns': ['v_x']},
            ': v_names is not there, allowed: a name for each of 2 columns',
        ),
        (
            {'v': np.zeros((600, 2)), 'v_names': ['v_x']},
            {'motion_key': 'v', 'motion_columns': ['v_x']},
            ': v_names has the shape (1,), allowed: a name for each of 2 columns',
        ),
        (
            {'v': np.zeros((600, 2)), 'v_names': ['v_x', 'v_y']},
            {'motion_key': 'v', 'motion_columns': ['v_z']},
            ': v_names has v_z 0 times, allowed: once; there are: v_x, v_y',
        ),
    ],
)
def test_velocities_that_are_not_as_configured_are_named(capsys, tmp_path, arrays, evaluate, said):
    path = write(tmp_path / 'a.npz', **arrays)
    config = config_file(tmp_path / 'c.yaml', **evaluate)
    assert complaint(capsys, path, '--config', config).startswith(f'{path}{said}')


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


# As a process.


def command(*arguments):
    return [sys.executable, '-m', 'slip_detector.commands.evaluate', *map(str, arguments)]


def run(*arguments, **more):
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    # Without buffers there is nothing left over that could fail once more at the end.
    environment.pop('PYTHONUNBUFFERED', None)
    more = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, **more}
    return subprocess.run(
        command(*arguments), text=True, check=False, timeout=120, env=environment, **more
    )


def test_as_a_process_it_prints_and_ends_with_its_exit_code(tmp_path):
    path = write(tmp_path / 'a.npz')
    good = run(path)
    assert (good.returncode, good.stderr) == (0, '')
    assert good.stdout.splitlines()[2].startswith('all rows')
    bad = run(tmp_path / 'no.npz')
    assert (bad.returncode, bad.stdout) == (1, '')
    assert bad.stderr == (
        f'slip_evaluate: {tmp_path / "no.npz"}: cannot be read (No such file or directory)\n'
    )


def test_a_reader_that_leaves_early_is_no_error(tmp_path):
    path = write(tmp_path / 'a.npz')
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = run(path, stdout=writer)
    finally:
        os.close(writer)
    assert (ended.returncode, ended.stderr) == (0, '')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no /dev/full')
def test_a_full_disk_is_said(tmp_path):
    path = write(tmp_path / 'a.npz')
    with open('/dev/full', 'w', encoding='utf-8') as full:
        ended = run(path, stdout=full)
    assert ended.returncode == 1
    assert ended.stderr == (
        'slip_evaluate: the output cannot be written (No space left on device)\n'
    )


def test_it_needs_neither_ros_nor_a_plotting_library():
    code = (
        'import sys; before = set(sys.modules); import slip_detector.commands.evaluate; '
        'print({"rclpy", "std_msgs", "matplotlib"} & (set(sys.modules) - before))'
    )
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    ended = subprocess.run(
        [sys.executable, '-c', code], env=environment, capture_output=True, text=True, check=True
    )
    assert ended.stdout.strip() == 'set()'


# Real recordings.


def test_the_configuration_of_the_real_finger_suits_every_node():
    detector = DetectorConfig.from_yaml(XELA_CONFIG)
    recording = RecordingConfig.from_yaml(XELA_CONFIG)
    evaluate = EvaluationConfig.from_yaml(XELA_CONFIG)
    assert (detector.channels, detector.sample_rate_hz) == (96, 60.0)
    assert detector.groups == {'y': tuple(range(2, 97, 3))}
    assert set(detector.disabled_channels) == set(range(1, 97)) - set(detector.groups['y'])
    assert recording.recording_volts_key == 'tactile'
    assert evaluate.motion_columns == ('v_x', 'v_y')
    sections = yaml.safe_load(XELA_CONFIG.read_text(encoding='utf-8'))
    assert list(sections) == ['/**/slip_detector', '/**/slip_driver', '/**/slip_evaluate']


@needs_xela
def test_the_real_finger_is_told_sliding_from_holding_and_from_moving(capsys):
    report = report_of(capsys, XELA, '--config', XELA_CONFIG)['xela_uskin_slip']
    assert len(report['recordings']) == 7
    assert (report['rows'], report['slip_rows'], report['moving_rows']) == (2195, 196, 1512)
    # What a detector that knows nothing else reaches (the README of the data).
    assert report['auc_all'] > 0.91
    assert report['auc_moving'] > 0.85
    # What the configuration says of itself.
    assert report['auc_all'] == pytest.approx(0.951, abs=1e-3)
    assert report['auc_moving'] == pytest.approx(0.926, abs=1e-3)
    within = [part['auc_moving'] for part in report['recordings'].values() if part['slip_rows']]
    assert within == pytest.approx([0.849, 0.733, 0.886], abs=2e-3)


@needs_xela
def test_what_the_configuration_says_of_the_data_is_so():
    config = ChainConfig.from_yaml(XELA_CONFIG)
    speeds, slips, decisions = [], [], []
    for path in sorted(XELA.glob('*.npz')):
        with np.load(path) as file:
            names = list(file['robot_state_names'])
            columns = file['robot_state'][:, [names.index('v_x'), names.index('v_y')]]
            speeds.append(np.hypot(*columns.T.astype(float)))
            slips.append(file['slip'] == 1)
            decisions.append(SlipChain(config).update(file['tactile']).slip)
            axes = [name[-1] for name in file['taxel_names']]
    assert {axes[channel - 1] for channel in config.groups['y']} == {'y'}
    speed, slip, on = (np.concatenate(parts) for parts in (speeds, slips, decisions))
    moving = speed > 0.01
    assert roc_auc(speed, slip) == pytest.approx(0.878, abs=1e-3)
    assert roc_auc(speed[slip | moving], slip[slip | moving]) == pytest.approx(0.814, abs=1e-3)
    assert on[slip].mean() == pytest.approx(0.99, abs=0.01)
    assert on[moving & ~slip].mean() == pytest.approx(0.22, abs=0.01)
