"""What ``slip_benchmark tune`` measures is what it says."""

import numpy as np
import pytest

from benchmarks import families, search_speed, tune
from benchmarks.command import main
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective


@pytest.mark.parametrize('exponent', [1, 3])
@pytest.mark.parametrize('common_mode', ['none', 'median'])
def test_the_rival_finds_what_the_search_finds(exponent, common_mode):
    track = search_speed.slips_and_noise(0.3)
    chain = ChainConfig(exponent=exponent, common_mode=common_mode)
    sides = [
        kind([track], EvaluationConfig(), TuneConfig()).best(chain)
        for kind in (Objective, search_speed.NumpyObjective)
    ]
    assert len(sides[0]) == 5
    for mine, its in zip(*sides, strict=True):
        assert mine.chain.vote == its.chain.vote
        assert mine.cost_ms == pytest.approx(its.cost_ms, abs=search_speed.SAME_COST_MS)


def test_both_searches_try_the_same():
    result = search_speed.measure(trials=3, minutes=0.2)
    assert result['agreement'] == 1.0
    assert result['speedup'] == result['numpy_s'] / result['search_s']


def test_the_families_are_what_their_names_say():
    scenes = families.scenes()
    assert list(scenes) == [
        'plates', 'plates, tremor and hum', 'taps and rolling between slips',
    ]  # fmt: skip
    periods = [
        [scene['texture']['spatial_period_m'] for scene in family] for family in scenes.values()
    ]
    assert periods == [[400e-6, 440e-6, 480e-6]] * 3
    assert all('tremor' in scene and 'hum' in scene for scene in list(scenes.values())[1])
    (track,) = families.play(list(scenes.values())[2][:1], [0])
    between = np.flatnonzero(track.kind == SLIP)
    for tap_s in (*families.TAPS_S, families.ROLLING_S):
        assert not between[0] <= tap_s * 380.0 <= between[-1]


def test_what_is_reported_is_not_what_is_tuned_on():
    assert not set(families.TUNED_ON) & set(families.REPORTED_ON)


def test_unknown_parts_and_real_without_recordings_are_refused(capsys):
    assert main(['tune', '--part', 'nix']) == 1
    assert main(['tune', '--part', 'real']) == 1
    assert capsys.readouterr().err == (
        "slip_benchmark: --part is 'nix', allowed: evaluate, read, search, report, families, "
        'real\nslip_benchmark: real recordings need --recordings and --config\n'
    )


def test_quick_figures_are_shown_and_not_judged():
    result = tune.measure(quick=True, parts=['search'])
    text = tune.table(result)
    wanted = result['wanted']
    assert wanted['search.speedup']['value'] == result['search']['speedup']
    assert wanted['search.speedup']['met'] is None
    assert wanted['evaluate.ratio'] == {'value': None, 'bound': '<= 4', 'met': None}
    assert [line.split()[-2:] for line in text.splitlines()].count(['not', 'judged']) == 1
    assert 'met' not in text
