"""What a chain costs, and that the tuner thinks of a chain what an evaluation says of it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import COMPILED
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import CandidateFigures, Objective
from slip_detector.tuning.tracks import track_of
from slip_detector.tuning.verdict import pooled_figures
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings
from support.tuning_cases import CHAIN, track


def evaluated(chain, evaluation, several):
    """Return the figures that the evaluation gives of recordings, as the tuner names them."""
    replay = Replay(chain, evaluation)
    outcomes = [replay.run(pieces, RATE_HZ) for pieces in several]
    figures = pooled_figures(outcomes)
    against_motion = any(one.scores.counts[1].any() for one in outcomes)
    return {
        'missed': figures['missed'] / figures['slips'],
        'false_alarms_per_minute': figures['false_alarms_per_minute'],
        'auc': figures['auc_moving' if against_motion else 'auc_all'],
        'latency_ms': figures['latency_median_ms'],
        'median_ms': figures['latency_median_all_ms'],
    }


def thought(candidate):
    figures = candidate.figures._asdict()
    if figures['median_ms'] == float('inf'):
        figures['median_ms'] = None
    return figures


@settings(max_examples=40 if COMPILED else 3, deadline=None)
@given(chains(), st.lists(recordings(), min_size=1, max_size=3), EVALUATIONS)
def test_the_tuner_thinks_of_a_chain_what_the_evaluation_says_of_it_to_the_bit(
    chain, several, evaluation
):
    tracks = [track_of('a', pieces, RATE_HZ) for pieces in several]
    assume(any(track.slips for track in tracks) and any(track.quiet_s for track in tracks))
    objective = Objective(tracks, evaluation, TuneConfig())
    assert thought(objective.as_it_is(chain)) == evaluated(chain, evaluation, several)
    for candidate in objective.best(chain):
        assert thought(candidate) == evaluated(candidate.chain, evaluation, several)
        assert objective.as_it_is(candidate.chain).figures == candidate.figures


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
