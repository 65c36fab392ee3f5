"""What is searched, what it costs, and which of many is handed back."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import CandidateFigures, Objective
from slip_detector.tuning.problem import SEARCHED
from slip_detector.tuning.search import search
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import held_out
from support.tuning_cases import CHAIN, problem, track

XELA = ChainConfig.from_yaml(Path(__file__).resolve().parents[2] / 'config' / 'xela_uskin.yaml')
BANDS = ('passband_hz', 'stopbands_hz', 'exponent', 'envelope_window_s', 'common_mode')


@pytest.mark.parametrize('chain', [CHAIN, XELA, ChainConfig()], ids=['small', 'xela', 'paper'])
def test_the_given_chain_is_a_point_of_its_space(chain):
    space = SearchSpace(chain)
    assert space.chain(space.point(chain)) == chain
    assert space.starts()[0] == space.point(chain)


def test_the_paper_s_chain_is_where_every_search_begins():
    space = SearchSpace(dataclasses.replace(CHAIN, passband_hz=(20.0, 90.0), stopbands_hz=()))
    start = space.chain(space.starts()[1])
    paper = ChainConfig()
    for name in BANDS:
        assert getattr(start, name) == getattr(paper, name), name


@given(
    rate_hz=st.sampled_from([30.0, 60.0, 380.0, 2000.0]),
    shares=st.lists(st.floats(0.0, 1.0), min_size=8, max_size=8),
)
def test_every_point_of_the_space_is_a_chain(rate_hz, shares):
    chain = ChainConfig(
        sample_rate_hz=rate_hz, channels=4, passband_hz=(rate_hz / 10, 0.0), stopbands_hz=()
    )
    space = SearchSpace(chain)
    point = {}
    for (name, kind), share in zip(space.distributions().items(), shares, strict=True):
        if hasattr(kind, 'choices'):
            point[name] = kind.choices[round(share * (len(kind.choices) - 1))]
        elif name == 'exponent':
            point[name] = round(kind.low + share * (kind.high - kind.low))
        else:
            point[name] = kind.low + share * (kind.high - kind.low)
    found = space.chain(point)
    assert found.exponent == point['exponent']
    assert found.groups == chain.groups
    for low_hz, high_hz in found.stopbands_hz:
        assert 0.0 < low_hz < high_hz < rate_hz / 2


def test_a_point_is_nowhere_from_itself_and_a_choice_is_one_away():
    space = SearchSpace(CHAIN)
    point = space.point(CHAIN)
    assert space.distance(point, point) == 0.0
    assert space.distance({**point, 'common_mode': 'median'}, point) == 1.0


def test_costs_are_latency_and_what_misses_and_false_alarms_count_for():
    tracks = [track(1), track(2)]
    weights = TuneConfig(missed_costs_ms=300.0, false_alarm_costs_ms=7.0, auc_costs_ms=0.0)
    objective = Objective(tracks, EvaluationConfig(), weights)
    never = objective.as_it_is(dataclasses.replace(CHAIN, threshold=1e9))
    assert never.cost_ms == 300.0
    assert never.figures.missed == 1.0
    assert never.figures.latency_ms is None
    assert math.isinf(never.figures.median_ms)
    found = objective.as_it_is(dataclasses.replace(CHAIN, threshold=0.02))
    assert found.figures.missed == 0.0
    assert 10.0 < found.figures.latency_ms < 100.0
    more = Objective(
        tracks, EvaluationConfig(), dataclasses.replace(weights, false_alarm_costs_ms=8.0)
    ).as_it_is(found.chain)
    assert more.cost_ms - found.cost_ms == pytest.approx(found.figures.false_alarms_per_minute)


def test_what_gets_worse_than_given_counts_tenfold():
    tracks = [track(1)]
    free = Objective(tracks, EvaluationConfig(), TuneConfig())
    chain = dataclasses.replace(CHAIN, threshold=0.02)
    alone = free.as_it_is(chain)
    better = alone.figures._replace(median_ms=alone.figures.median_ms - 5.0)
    held = Objective(tracks, EvaluationConfig(), TuneConfig(), better).as_it_is(chain)
    assert held.cost_ms == pytest.approx(alone.cost_ms + 50.0)
    same = Objective(tracks, EvaluationConfig(), TuneConfig(), alone.figures).as_it_is(chain)
    assert same.cost_ms == pytest.approx(alone.cost_ms)


def test_worse_is_said_of_each_figure():
    good = CandidateFigures(20.0, 0.0, 1.0, 0.99, 20.0)
    assert good.worse_than(good) == []
    bad = CandidateFigures(math.inf, 0.5, 2.0, 0.9, 15.0)
    assert [line.split()[0] for line in bad.worse_than(good)] == [
        'median', 'missed', 'false', 'area',
    ]  # fmt: skip
    assert good.worse_than(bad) == []


def test_the_best_threshold_is_found_for_each_vote():
    tracks = [track(1), track(2)]
    objective = Objective(tracks, EvaluationConfig(), TuneConfig())
    found = objective.best(CHAIN)
    assert [one.chain.vote for one in found[:1]] != []
    assert {one.chain.vote for one in found} == {'all', 'mean', 1}
    assert [one.cost_ms for one in found] == sorted(one.cost_ms for one in found)
    best = found[0]
    assert best.cost_ms < objective.as_it_is(CHAIN).cost_ms
    again = objective.as_it_is(best.chain)
    assert again.figures.missed == best.figures.missed == 0.0


def test_a_chain_that_never_moves_has_no_threshold():
    flat = track(1)._replace(volts=np.full((100, 4), 4.3), kinds=np.zeros(100, np.int8))
    flat = flat._replace(pieces=(flat.pieces[0]._replace(end=100),))
    assert Objective([flat], EvaluationConfig(), TuneConfig()).best(CHAIN) == []


def test_a_search_finds_what_costs_less_and_keeps_the_rest_of_the_chain():
    given_chain = dataclasses.replace(CHAIN, passband_hz=(60.0, 120.0), stopbands_hz=())
    asked = problem([track(1), track(2)], given_chain)
    study = asked.study(None, 'a', seed=1)
    counts = []
    search(asked, study, 25, lambda: False, counts.append)
    assert counts == list(range(1, 26))
    best = asked.best(study)
    free = Objective(asked.tracks, asked.evaluation, asked.config)
    assert best.cost_ms < free.as_it_is(given_chain).cost_ms - 20.0
    for field in dataclasses.fields(CHAIN):
        if field.name not in SEARCHED:
            assert getattr(best.chain, field.name) == getattr(given_chain, field.name)
    choice = asked.choice(study)
    assert choice.cost_ms <= best.cost_ms + best.error_ms


def test_of_one_slip_nothing_is_learnt_but_a_threshold():
    one = track(1, duration_s=3.0)
    assert len(one.slips) == 1
    asked = problem([one])
    study = asked.study(None, 'a', seed=1)
    search(asked, study, 12, lambda: False, lambda count: None)
    choice = asked.choice(study)
    for name in BANDS:
        assert getattr(choice.chain, name) == getattr(CHAIN, name), name
    assert choice.chain.vote == CHAIN.vote


def test_recordings_are_parted_with_slips_on_both_sides():
    tracks = [track(k) for k in range(5)] + [track(k, slips=False) for k in range(5, 8)]
    training, held = held_out(tracks, 1 / 3)
    assert sorted(one.name for one in training + held) == sorted(one.name for one in tracks)
    assert [len([t for t in part if t.slips]) for part in (training, held)] == [3, 2]
    assert [len([t for t in part if not t.slips]) for part in (training, held)] == [2, 1]


@pytest.mark.parametrize('share', [0.1, 1 / 3, 0.5, 0.9])
def test_one_recording_is_cut_between_two_slips(share):
    whole = track(3, duration_s=30.0)
    (training,), (held,) = held_out([whole], share)
    assert len(training.slips) + len(held.slips) == len(whole.slips) == 10
    assert training.slips
    assert held.slips
    left_out_s = whole.duration_s - training.duration_s - held.duration_s
    assert 0.9 < left_out_s < 1.1
    wanted_s = (1 - share) * whole.duration_s
    assert abs(training.duration_s - wanted_s) < 3.0
    np.testing.assert_array_equal(held.volts, whole.volts[-len(held.volts) :])


def test_without_slips_enough_there_is_nothing_to_hold_out():
    with pytest.raises(ValueError, match='seed 1, seed 2: has no slip'):
        held_out([track(1, slips=False), track(2, slips=False)], 1 / 3)
    with pytest.raises(ValueError, match='seed 1: has one slip, allowed: two or more'):
        held_out([track(1, duration_s=3.0), track(2, slips=False)], 1 / 3)
