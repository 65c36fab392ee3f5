"""The benchmark: what it prints, that its rivals decide alike, and how its parts judge."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import chain_precision, chain_speed, scenes
from benchmarks import command as benchmark
from benchmarks.chain_speed import (
    QUICK_INTERPRETED,
    WANTED,
    NumpyChain,
    volts,
)
from benchmarks.command import Bound, least_times_s
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig
from support.commands import ROOT, run

COUNTS = ['16', '64', '1024', '10000']


@pytest.fixture(scope='module')
def result():
    return {'machine': benchmark.machine(), 'quick': True} | chain_speed.measure(
        quick=True, with_ros=False
    )


def test_every_section_has_its_figures(result):
    assert set(result) == {
        'machine', 'quick', 'blocks', 'one_row', 'channels', 'end_to_end', 'end_to_end_left_out',
        'wanted',
    }  # fmt: skip
    assert set(result['machine']) == {
        'cores', 'system', 'processor', 'python', 'numpy', 'scipy', 'numba', 'compiled',
    }  # fmt: skip
    assert set(result['blocks']) == {
        'rows', 'channels', 'rounds', 'chain_ns_per_row', 'numpy_ns_per_row', 'speedup',
        'agreement', 'slip_share', 'tuned',
    }  # fmt: skip
    assert set(result['one_row']) == {
        'channels', 'calls', 'rounds', 'chain_us_per_call', 'sosfilt_us_per_call', 'speedup',
        'kept_bytes_per_call', 'peak_bytes_per_call', 'temporary_bytes_per_channel',
    }  # fmt: skip
    assert set(result['channels']) == {
        'channel_samples', 'rounds', 'ns_per_channel_sample', 'ratio', 'worst_ratio',
    }  # fmt: skip
    assert result['quick'] is True
    assert result['end_to_end'] is None
    assert result['machine']['compiled'] is COMPILED
    assert (result['machine']['numba'] is None) is not COMPILED


def test_every_key_is_documented(result):
    names = {key for section in result.values() if isinstance(section, dict) for key in section}
    for name in (names | set(result)) - set(WANTED):
        assert f'``{name}``' in benchmark.__doc__ + chain_speed.__doc__


def test_the_figures_agree_with_each_other(result):
    blocks, row, channels = result['blocks'], result['one_row'], result['channels']
    assert blocks['chain_ns_per_row'] > 0
    assert blocks['speedup'] == pytest.approx(
        blocks['numpy_ns_per_row'] / blocks['chain_ns_per_row']
    )
    tuned = blocks['tuned']
    assert tuned['speedup'] == pytest.approx(tuned['numpy_ns_per_row'] / tuned['chain_ns_per_row'])
    assert row['chain_us_per_call'] > 0
    assert row['speedup'] == pytest.approx(row['sosfilt_us_per_call'] / row['chain_us_per_call'])
    assert row['kept_bytes_per_call'] < 1
    assert row['temporary_bytes_per_channel'] < 1
    assert all(0 < peak < 10_000 for peak in row['peak_bytes_per_call'].values())
    per_sample = channels['ns_per_channel_sample']
    assert list(per_sample) == list(channels['ratio']) == COUNTS
    assert all(ns > 0 for ns in per_sample.values())
    for n in COUNTS:
        assert channels['ratio'][n] == pytest.approx(per_sample[n] / per_sample['16'])
    assert channels['worst_ratio'] == max(channels['ratio'].values())


def test_the_rivals_decide_alike_on_data_with_both_decisions(result):
    assert min(result['blocks']['agreement'].values()) >= chain_speed.LEAST_AGREEMENT
    assert 0.1 < result['blocks']['slip_share'] < 0.9


def test_each_claim_stands_beside_what_is_wanted(result):
    assert set(result['wanted']) == set(WANTED)
    for name, entry in result['wanted'].items():
        section, figure = name.split('.')
        if result[section] is None:
            assert entry['value'] is None
            assert entry['met'] is None
        else:
            assert entry['value'] == result[section][figure]
            assert entry['met'] is None  # what is measured in short is not judged
        assert entry['bound'] == str(WANTED[name])


def test_the_table_names_each_figure_with_its_bound(result):
    text = benchmark.heading(result) + '\n' + chain_speed.table(result)
    for label, bound in (
        ('SciPy and NumPy', ''),
        ('one bare sosfilt', ''),
        ('speed-up', '>= 10'),
        ('speed-up', '>= 8'),
        ('kept', '< 1'),
        ('temporary arrays', '< 1'),
        ('worst ratio', '<= 1.5'),
        ('latency_ratio', '<= 1.5'),
        ('cpu_ratio', '<= 1.5'),
        ('equal decisions', ''),
        ('left out: --without-ros was given', ''),
    ):
        assert any(label in line and bound in line for line in text.splitlines()), label
    for fact in ('cores', 'Python', 'NumPy', 'SciPy', 'Numba'):
        assert fact in text
    assert max(len(line) for line in text.splitlines()) <= 120


def test_the_table_says_honestly_what_is_not_met(result):
    claims = {name: entry | {'met': False} for name, entry in result['wanted'].items()}
    assert chain_speed.table(result | {'wanted': claims}).count('NOT met') == 5
    claims = {name: entry | {'met': True} for name, entry in result['wanted'].items()}
    assert 'NOT met' not in chain_speed.table(result | {'wanted': claims})


@pytest.mark.parametrize(
    ('bound', 'met', 'not_met'),
    [(Bound('>=', 8), [8, 9], [7.9]), (Bound('<=', 8), [8, 7], [8.1]), (Bound('<', 1), [0], [1])],
)
def test_bounds(bound, met, not_met):
    assert all(bound.met(figure) for figure in met)
    assert not any(bound.met(figure) for figure in not_met)


def test_a_chain_that_decides_otherwise_is_not_timed(monkeypatch):
    class Deaf(NumpyChain):
        def update(self, rows):
            return tuple(np.zeros_like(part) for part in super().update(rows))

    monkeypatch.setattr(chain_speed, 'NumpyChain', Deaf)
    with pytest.raises(RuntimeError, match='decide differently'):
        chain_speed.blocks(QUICK_INTERPRETED)


@pytest.mark.parametrize('in_place', [False, True])
def test_the_numpy_rival_carries_its_state_from_block_to_block(in_place):
    rows = volts(600, 16)
    whole = NumpyChain(ChainConfig(), rows[0], in_place).update(rows)
    rival = NumpyChain(ChainConfig(), rows[0], in_place)
    parts = [rival.update(piece) for piece in np.split(rows, [1, 3, 10, 200])]
    wanted = SlipChain(ChainConfig()).update(rows)
    for i, name in enumerate(('slip', 'groups', 'channels')):
        assert np.array_equal(np.concatenate([part[i] for part in parts]), whole[i])
        assert np.array_equal(whole[i], getattr(wanted, name))


def test_the_sides_take_turns():
    order = []
    times_s = least_times_s([lambda: order.append('a'), lambda: order.append('b')], 3)
    assert order == ['a', 'b'] * 4
    assert len(times_s) == 2
    assert all(0 <= time_s < 1 for time_s in times_s)


def test_json_is_one_object_on_stdout():
    code, output, errors = run('chain', '--quick', '--without-ros', '--json')
    assert code == 0, errors
    parsed = json.loads(output)
    assert parsed['end_to_end'] is None
    assert parsed['end_to_end_left_out'] == '--without-ros was given'
    assert parsed['precision']['digits'] == 50


@pytest.mark.parametrize('words', [['--help'], ['chain', '--help']])
def test_help(words):
    code, output, _ = run(*words)
    assert code == 0
    assert 'chain' in output


def test_the_benchmark_itself_imports_no_ros():
    code = 'import sys, benchmarks.command; print("rclpy" in sys.modules)'
    output = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, cwd=ROOT, check=True
    ).stdout
    assert output.strip() == 'False'


def test_without_rclpy_the_reason_is_said(tmp_path):
    # A package that cannot be imported, found before any that can.
    (tmp_path / 'rclpy.py').write_text('raise ImportError("no such thing here")\n')
    code = 'from benchmarks.chain_speed import why_not_ros; print(why_not_ros())'
    environment = os.environ | {'PYTHONPATH': os.pathsep.join([str(tmp_path), str(ROOT)])}
    output = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, env=environment, check=True
    ).stdout
    assert 'rclpy cannot be imported' in output
    assert 'no such thing here' in output


@pytest.mark.parametrize('command', ['chain', 'scenes'])
@pytest.mark.parametrize(
    ('picture', 'said'),
    [('folder', 'folder: cannot be written'), ('picture.doc', 'has the ending .doc, allowed: .')],
)
def test_a_picture_that_cannot_be_written_is_said_before_the_measurement(
    command, picture, said, tmp_path, monkeypatch, capsys
):
    def measured(*_):
        raise AssertionError('it was measured')

    for part in (chain_speed, chain_precision, scenes):
        monkeypatch.setattr(part, 'measure', measured)
    (tmp_path / 'folder').mkdir()
    assert benchmark.main([command, '--quick', '--plot', str(tmp_path / picture)]) == 1
    error = capsys.readouterr().err
    assert error.startswith('slip_benchmark: ')
    assert said in error
    assert error.count('\n') == 1


def test_a_claim_that_was_not_measured_is_neither_met_nor_not():
    bounds = {'a': Bound('<', 1.0), 'b': Bound('>=', 2.0), 'c': Bound('<=', 3.0)}
    assert benchmark.verdicts(bounds, {'a': 1.0, 'b': 2.0, 'c': None}) == {
        'a': {'value': 1.0, 'bound': '< 1', 'met': False},
        'b': {'value': 2.0, 'bound': '>= 2', 'met': True},
        'c': {'value': None, 'bound': '<= 3', 'met': None},
    }


def test_a_measurement_that_was_too_short_is_not_judged():
    values = {'a': 2.0, 'b': None}
    bounds = {'a': Bound('<', 1.0), 'b': Bound('<', 1.0)}
    words = {
        judged: [
            benchmark.verdict_words(entry)
            for entry in benchmark.verdicts(bounds, values, judged).values()
        ]
        for judged in (True, False)
    }
    assert words == {True: ['NOT met', ''], False: ['not judged', '']}
