"""Figures of merit against their definitions, and the command line that prints them."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.chain import COMPILED, SlipChain
from slip_detector.config import ChainConfig, DetectorConfig, DriverConfig, EvaluationConfig
from slip_detector.evaluation import (
    decision_statistic,
    false_positive_percent,
    first_on_delay_s,
    main,
    mean_delay,
    recording_sets,
    roc_auc,
)

ROOT = Path(__file__).parents[1]
XELA_CONFIG = ROOT / 'config' / 'xela_uskin.yaml'
XELA = ROOT.parent / 'shared' / 'data' / 'xela_uskin_slip'
needs_xela = pytest.mark.skipif(not XELA.is_dir(), reason=f'no recordings at {XELA}')

RATE_HZ = 380.0


# The decision statistic.


@st.composite
def chains(draw):
    """Draw a configuration and rows for it, with bad samples, held values and quiet channels."""
    channels = draw(st.integers(1, 12), label='channels')
    enabled = draw(st.integers(1, channels), label='enabled')
    order = draw(st.permutations(range(1, channels + 1)), label='order')
    n_groups = draw(st.integers(1, min(enabled, 3)), label='groups')
    groups = {f'g{i}': tuple(order[:enabled][i::n_groups]) for i in range(n_groups)}
    fewest = min(map(len, groups.values()))
    config = ChainConfig(
        sample_rate_hz=400.0,
        channels=channels,
        groups=groups,
        disabled_channels=tuple(order[enabled:]),
        passband_hz=(20.0, 100.0),
        stopbands_hz=(),
        gain=1.0,
        exponent=draw(st.integers(1, 3), label='exponent'),
        envelope_window_s=draw(st.sampled_from([0.0025, 0.02]), label='envelope'),
        decision_window_s=draw(st.sampled_from([0.0025, 0.02]), label='decision'),
        flat_after_s=draw(st.sampled_from([0.0, 0.01]), label='flat'),
        vote=draw(st.sampled_from(['all', 'mean', *range(1, fewest + 1)]), label='vote'),
    )
    seed = draw(st.integers(0, 2**32 - 1), label='seed')
    rng = np.random.default_rng(seed)
    volts = rng.normal(size=(120, channels)) * rng.choice([0.0, 0.5, 1.0, 2.0], channels)
    volts[rng.random(volts.shape) < draw(st.sampled_from([0.0, 0.02, 0.5]), label='bad')] = np.nan
    if draw(st.booleans(), label='held'):
        volts[40:80, rng.random(channels) < 0.5] = 1.0
    return config, volts


def replaced(config, **changes):
    return ChainConfig(**{**config.__dict__, **changes})


@settings(max_examples=300 if COMPILED else 30)
@given(chains(), st.floats(0.01, 0.99))
def test_the_statistic_is_above_one_where_the_chain_says_slip_at_any_threshold(drawn, share):
    config, volts = drawn
    first = SlipChain(config).update(volts)
    # A threshold out of the midst of the levels, so that there is something to decide.
    levels = first.level[first.valid & (first.level > 0.0)]
    threshold = float(np.quantile(levels, share)) if levels.size else 1.0
    config = replaced(config, threshold=threshold)
    result = SlipChain(config).update(volts)
    statistic = decision_statistic(result, config)
    assert statistic.shape == (len(volts),)
    ratio = result.level / threshold
    rounding = np.isclose(ratio, 1.0, rtol=1e-9) & result.valid
    sure = ~rounding.any(axis=1) & ~np.isclose(statistic, 1.0, rtol=1e-9)
    np.testing.assert_array_equal((statistic > 1.0)[sure], result.slip[sure])
    # And so it is the score of a ROC curve: a limit on it is another threshold.
    other = replaced(config, threshold=2.0 * threshold)
    sure &= ~np.isclose(ratio, 2.0, rtol=1e-9).any(axis=1) & ~np.isclose(statistic, 2.0, rtol=1e-9)
    np.testing.assert_array_equal(
        (statistic > 2.0)[sure], SlipChain(other).update(volts).slip[sure]
    )


@pytest.mark.parametrize(
    ('vote', 'valid', 'expected'),
    [
        ('all', [1, 1, 1, 1], 0.5),
        ('all', [0, 1, 1, 1], 1.0),
        ('all', [0, 0, 0, 1], 8.0),
        ('all', [0, 0, 0, 0], 0.0),
        (1, [1, 1, 1, 1], 8.0),
        (2, [1, 1, 1, 1], 4.0),
        (2, [1, 1, 0, 1], 1.0),
        (3, [1, 1, 0, 0], 0.0),
        (1, [0, 0, 0, 0], 0.0),
        ('mean', [1, 1, 1, 1], 2.0),
        ('mean', [0, 1, 0, 1], np.sqrt(8.0)),
        ('mean', [0, 0, 0, 0], 0.0),
    ],
)
def test_the_statistic_of_a_group_by_hand(vote, valid, expected):
    config = ChainConfig(channels=4, vote=vote, threshold=2.0)
    result = SimpleNamespace(level=np.array([[1.0, 2.0, 8.0, 16.0]]), valid=np.array([valid]) == 1)
    np.testing.assert_allclose(decision_statistic(result, config), [expected])


def test_the_statistic_of_a_silent_channel_is_zero_in_the_geometric_mean():
    config = ChainConfig(channels=2, vote='mean', threshold=1.0)
    result = SimpleNamespace(level=np.array([[0.0, 9.0]]), valid=np.ones((1, 2), bool))
    assert decision_statistic(result, config) == [0.0]


def test_the_statistic_is_that_of_the_group_nearest_to_slip():
    groups = {'a': (1, 4), 'b': (2, 3)}
    config = ChainConfig(channels=4, groups=groups, threshold=1.0)
    level = np.array([[1.0, 2.0, 5.0, 9.0], [3.0, 0.0, 5.0, 4.0]])
    result = SimpleNamespace(level=level, valid=np.ones((2, 4), bool))
    np.testing.assert_array_equal(decision_statistic(result, config), [2.0, 3.0])


def test_the_statistic_needs_the_level():
    result = SlipChain().update(np.zeros((3, 16)), level=False)
    with pytest.raises(ValueError, match='level was not kept'):
        decision_statistic(result, ChainConfig())


def test_the_statistic_of_no_rows_is_empty():
    result = SlipChain().update(np.zeros((0, 16)))
    assert decision_statistic(result, ChainConfig()).shape == (0,)


# Area under the ROC curve.


@given(
    st.lists(
        st.tuples(st.integers(-3, 3) | st.floats(allow_nan=False), st.booleans()), max_size=30
    )
)
def test_auc_is_the_share_of_pairs_in_order_and_ties_count_half(rows):
    score, label = [float(s) for s, _ in rows], [truth for _, truth in rows]
    positives = [s for s, truth in rows if truth]
    negatives = [s for s, truth in rows if not truth]
    area = roc_auc(score, label)
    if not positives or not negatives:
        assert area is None
        return
    points = [(p > n) + 0.5 * (p == n) for p in positives for n in negatives]
    assert area == pytest.approx(np.mean(points))


def test_auc_of_what_cannot_be_ordered_is_refused():
    with pytest.raises(ValueError, match='score has NaN'):
        roc_auc([1.0, np.nan], [True, False])
    with pytest.raises(ValueError, match=r'shapes \(2,\) and \(3,\)'):
        roc_auc([1.0, 2.0], [True, False, True])


# The paper's figures.


def test_the_delay_runs_from_the_start_of_slip_to_the_first_on_after_it():
    on = [True, False, False, True, True]
    time_s = [0.0, 0.5, 1.0, 1.5, 2.0]
    assert first_on_delay_s(on, time_s, 0.25) == 1.25
    assert first_on_delay_s(on, time_s, 1.5) == 0.0  # At the start counts.
    assert first_on_delay_s(on, time_s, 0.0) == 0.0
    assert first_on_delay_s(on, time_s, 2.1) is None
    assert first_on_delay_s([False] * 5, time_s, 0.0) is None
    assert first_on_delay_s([], [], 0.0) is None


@given(
    st.lists(st.booleans(), min_size=1, max_size=30),
    st.floats(-1, 31).map(lambda x: round(x, 2)),
)
def test_nothing_is_on_between_the_start_of_slip_and_its_delay(on, start_s):
    time_s = np.arange(len(on), dtype=float)
    delay_s = first_on_delay_s(on, time_s, start_s)
    after = np.array(on) & (time_s >= start_s)
    assert (delay_s is None) == (not after.any())
    if delay_s is not None:
        assert delay_s >= 0.0
        at = round(start_s + delay_s)
        assert start_s + delay_s == pytest.approx(at)
        assert after[at]
        assert not after[:at].any()


def test_the_mean_delay_is_over_the_channels_that_have_one():
    mean, sd = mean_delay([0.03, None, 0.05, 0.04, None])
    assert mean == pytest.approx(0.04)
    assert sd == pytest.approx(0.01)


def test_mean_and_deviation_of_too_few_delays_are_not_defined():
    assert mean_delay([]) == (None, None)
    assert mean_delay([None, None]) == (None, None)
    assert mean_delay([None, 0.02]) == (0.02, None)


@given(hnp.arrays(bool, st.tuples(st.integers(0, 40), st.just(2))))
def test_false_positives_are_the_share_of_on_among_rows_without_slip(rows):
    on, truth = rows.T
    percent = false_positive_percent(on, truth)
    without = int(np.count_nonzero(~truth))
    if not without:
        assert percent is None
    else:
        assert percent == pytest.approx(100.0 * np.count_nonzero(on & ~truth) / without)


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
    return json.loads(captured.out)


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


def expected_scores(path):
    with np.load(path) as file:
        config = ChainConfig()
        return decision_statistic(SlipChain(config).update(file['volts']), config), file['slip']


def test_json_has_the_figures_of_each_recording_and_of_all_rows_together(capsys, tmp_path):
    paths = [write(tmp_path / 'set' / f'{name}.npz', seed) for seed, name in enumerate('ab')]
    report = report_of(capsys, tmp_path / 'set')
    assert list(report) == ['set']
    assert list(report['set']['recordings']) == ['a.npz', 'b.npz']
    scores = [expected_scores(path) for path in paths]
    for path, (score, slip) in zip(paths, scores, strict=True):
        area = roc_auc(score, slip)
        assert 0.5 < area < 1.0
        assert report['set']['recordings'][path.name] == {
            'auc_all': area,
            'auc_moving': None,
            'rows': 600,
            'slip_rows': 150,
            'moving_rows': None,
        }
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
    assert lines[-1].startswith('-: not defined')
    assert len({len(line) for line in lines[:4]}) == 1


def test_a_table_without_gaps_needs_no_legend(capsys, tmp_path):
    path = write(tmp_path / 'a.npz', speed=np.ones(600))
    config = config_file(tmp_path / 'c.yaml', motion_key='speed')
    assert main([str(path), '--config', config]) == 0
    assert 'not defined' not in capsys.readouterr().out


def test_csv_and_npz_of_the_same_rows_score_the_same(capsys, tmp_path):
    path = write(tmp_path / 'a.npz')
    with np.load(path) as file:
        table = np.column_stack([np.arange(600) / RATE_HZ, file['volts'], file['slip']])
    head = ','.join(['time_s', *(f'ch{i + 1}' for i in range(16)), 'slip'])
    np.savetxt(tmp_path / 'a.csv', table, '%.17g', ',', header=head, comments='')
    recordings = report_of(capsys, tmp_path)[tmp_path.name]['recordings']
    assert list(recordings) == ['a.csv', 'a.npz']
    assert recordings['a.csv'] == recordings['a.npz']


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
        'allowed: at most 2% apart'
    )


def test_a_recording_that_does_not_suit_is_named(capsys, tmp_path):
    narrow = write(tmp_path / 'narrow.npz', channels=8)
    assert complaint(capsys, narrow) == (
        f'{narrow}: has 8 channels, allowed: 16, the parameter channels'
    )
    unlabelled = write(tmp_path / 'unlabelled.npz', slip=None)
    assert complaint(capsys, unlabelled) == (
        f'{unlabelled}: has no label slip, there are: sample_rate_hz, volts'
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
    assert (
        complaint(capsys, tmp_path) == f'{tmp_path}: has no recordings, allowed: .npz, .csv files'
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
            ': v has the shape (599,) and type float64, allowed: numbers of shape (600,) or',
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
    return [sys.executable, '-m', 'slip_detector.evaluation', *map(str, arguments)]


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
    assert good.stdout.splitlines()[-3].startswith('all rows')
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
        'import sys; before = set(sys.modules); import slip_detector.evaluation; '
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
    driver = DriverConfig.from_yaml(XELA_CONFIG)
    evaluate = EvaluationConfig.from_yaml(XELA_CONFIG)
    assert (detector.channels, detector.sample_rate_hz) == (96, 60.0)
    assert detector.groups == {'y': tuple(range(2, 97, 3))}
    assert set(detector.disabled_channels) == set(range(1, 97)) - set(detector.groups['y'])
    assert driver.recording_volts_key == 'tactile'
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
