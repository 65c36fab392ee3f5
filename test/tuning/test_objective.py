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

"""What a chain costs, and that the tuner thinks of a chain what an evaluation says of it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.settling import settling_rows
from slip_detector.chain.slip_chain import COMPILED
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import CandidateFigures, Objective
from slip_detector.tuning.sweep import thresholds
from slip_detector.tuning.tracks import track_of
from support.guesses import guessed
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings
from support.tuning_cases import CHAIN, slips, track


def evaluated(chain, evaluation, several):
    """Return the figures that the evaluation gives of recordings, as the tuner compares them."""
    replay = Replay(chain, evaluation)
    outcomes = [replay.run(pieces, RATE_HZ) for pieces in several]
    figures = figures_of_merit(outcomes)
    against_motion = any(one.scores.counts[1].any() for one in outcomes)
    figures['auc'] = figures['auc_moving' if against_motion else 'auc_all']
    return CandidateFigures(**{name: figures[name] for name in CandidateFigures._fields})


@settings(max_examples=40 if COMPILED else 3, deadline=None)
@given(chains(), st.lists(recordings(), min_size=1, max_size=3), EVALUATIONS)
def test_the_tuner_thinks_of_a_chain_what_the_evaluation_says_of_it_to_the_bit(
    chain, several, evaluation
):
    tracks = [track_of('a', pieces, RATE_HZ) for pieces in several]
    assume(any(track.slips for track in tracks))
    objective = Objective(tracks, evaluation, TuneConfig())
    assert objective.as_it_is(chain).figures == evaluated(chain, evaluation, several)
    for candidate in objective.best(chain):
        assert candidate.figures == evaluated(candidate.chain, evaluation, several)
        assert objective.as_it_is(candidate.chain).figures == candidate.figures


def test_costs_are_latency_and_what_misses_false_alarms_and_false_time_count_for():
    tracks = [track(1), track(2)]
    weights = TuneConfig(
        missed_costs_ms=300.0, false_alarm_costs_ms=7.0, false_time_costs_ms=3.0, auc_costs_ms=0.0
    )
    objective = Objective(tracks, EvaluationConfig(), weights)
    never = objective.as_it_is(dataclasses.replace(CHAIN, threshold=1e9))
    assert never.cost_ms == 300.0
    assert never.figures.sooner_than_chance == 0.0
    assert never.figures.latency_median_ms is None
    assert never.figures.latency_median_all_ms is None
    found = objective.as_it_is(dataclasses.replace(CHAIN, threshold=0.02))
    assert found.figures.sooner_than_chance > 0.9
    assert 10.0 < found.figures.latency_median_ms < 100.0
    for weight, figure in (
        ('false_alarm_costs_ms', found.figures.false_alarms_per_minute),
        ('false_time_costs_ms', found.figures.false_time_percent),
    ):
        heavier = dataclasses.replace(weights, **{weight: getattr(weights, weight) + 1.0})
        more = Objective(tracks, EvaluationConfig(), heavier).as_it_is(found.chain)
        assert more.cost_ms - found.cost_ms == pytest.approx(figure, abs=1e-9)


def test_what_gets_worse_than_given_counts_tenfold():
    tracks = [track(1)]
    free = Objective(tracks, EvaluationConfig(), TuneConfig())
    chain = dataclasses.replace(CHAIN, threshold=0.02)
    alone = free.as_it_is(chain)
    faster = alone.figures.latency_median_all_ms - 5.0
    better = alone.figures._replace(latency_median_all_ms=faster)
    held = Objective(tracks, EvaluationConfig(), TuneConfig(), better).as_it_is(chain)
    assert held.cost_ms == pytest.approx(alone.cost_ms + 50.0)
    surer = alone.figures._replace(auc=alone.figures.auc + 0.01)
    held = Objective(tracks, EvaluationConfig(), TuneConfig(auc_costs_ms=200.0), surer)
    weighed = Objective(tracks, EvaluationConfig(), TuneConfig(auc_costs_ms=200.0))
    more_ms = held.as_it_is(chain).cost_ms - weighed.as_it_is(chain).cost_ms
    assert more_ms == pytest.approx(20.0)
    same = Objective(tracks, EvaluationConfig(), TuneConfig(), alone.figures).as_it_is(chain)
    assert same.cost_ms == pytest.approx(alone.cost_ms)


def test_a_given_figure_that_is_not_defined_holds_nothing_back():
    tracks = [track(1)]
    chain = dataclasses.replace(CHAIN, threshold=0.02)
    alone = Objective(tracks, EvaluationConfig(), TuneConfig()).as_it_is(chain)
    # It finds few slips and is never OFF: no median of all, no alarms in a minute of OFF.
    few = CandidateFigures(None, 30.0, 0.2, 0.0, 100.0, None)
    assert few.false_alarms_per_minute_off is None
    held = Objective(tracks, EvaluationConfig(), TuneConfig(), few).as_it_is(chain)
    assert held.cost_ms == pytest.approx(alone.cost_ms)


GOOD = CandidateFigures(20.0, 20.0, 1.0, 1.0, 0.5, 0.99)


def test_worse_is_said_of_each_figure():
    assert GOOD.worse_than(GOOD) == []
    bad = CandidateFigures(None, 15.0, 0.5, 2.0, 1.5, 0.9)
    assert bad.worse_than(GOOD) == [
        'no median latency defined against 20 ms',
        'false alarms 2.03 against 1.005 in a minute of OFF',
        'false time 1.5 against 0.5 %',
        'sooner than chance 0.5 against 1',
        'area under the ROC curve 0.9 against 0.99',
    ]
    assert GOOD.worse_than(bad) == []


def test_nothing_is_worse_than_what_is_no_better_than_chance():
    for sooner_than_chance in (0.0, -0.2, None):
        useless = GOOD._replace(sooner_than_chance=sooner_than_chance)
        assert GOOD._replace(false_time_percent=50.0).worse_than(useless) == []


def test_alarms_that_hardly_end_are_not_few():
    """ON for 99 % of the time with one alarm a minute is no standard for another chain."""
    mostly_on = GOOD._replace(false_time_percent=99.0, sooner_than_chance=0.1)
    assert GOOD._replace(false_alarms_per_minute=20.0).worse_than(mostly_on) == []
    always_on = GOOD._replace(false_time_percent=100.0, sooner_than_chance=0.1)
    assert always_on.false_alarms_per_minute_off is None
    assert GOOD.worse_than(always_on) == []


class Guesses(Objective):
    """The objective with decisions that know nothing of slip in place of a chain's."""

    def __init__(self, tracks, on):
        super().__init__(tracks, EvaluationConfig(), TuneConfig())
        self._on = on

    def statistics(self, chain, votes):
        return {vote: [self._on] for vote in votes}


@settings(max_examples=20)
@given(
    st.integers(0, 2**32 - 1),
    *[st.floats(0.0, math.log(4000.0)).map(math.exp)] * 2,
)
def test_no_guess_costs_less_than_never_being_on(seed, mean_on, mean_off):
    random = np.random.default_rng(seed)
    slips, n = 100, 100 * 600
    truth = np.zeros(n, bool)
    for start in np.arange(slips) * 600 + random.integers(0, 250, slips):
        truth[start : start + random.integers(50, 300)] = True
    quiet = track_of('a', [Samples.evenly(np.zeros((n, 1)), RATE_HZ, truth)], RATE_HZ)
    guess = Guesses([quiet], guessed(random, n, mean_on, mean_off).astype(float))
    sides = [guess.as_it_is(dataclasses.replace(CHAIN, threshold=at)) for at in (0.5, 2.0)]
    assert sides[1].figures.false_time_percent == 0.0
    rest = float(np.count_nonzero(~truth))
    alarms = sides[0].figures.false_alarms_per_minute * rest / RATE_HZ / 60.0
    # Of the share of slips that is found, and of that which chance is said to find.
    deviation = math.hypot(0.5 / math.sqrt(slips), 200.0 / rest * math.sqrt(alarms))
    assert sides[0].cost_ms > sides[1].cost_ms - 5.0 * deviation * TuneConfig().missed_costs_ms


def test_always_on_costs_what_misses_cost_and_all_of_the_time():
    truth = np.arange(6000) % 1000 >= 800
    quiet = track_of('a', [Samples.evenly(np.zeros((6000, 1)), RATE_HZ, truth)], RATE_HZ)
    guess = Guesses([quiet], np.ones(6000))
    always, never = (guess.as_it_is(dataclasses.replace(CHAIN, threshold=at)) for at in (0.5, 2.0))
    config = TuneConfig()
    assert always.cost_ms == never.cost_ms + 100.0 * config.false_time_costs_ms
    assert never.cost_ms == config.missed_costs_ms + 0.5 * config.auc_costs_ms


def test_a_chain_does_not_gain_by_settling_for_longer():
    """The slip that it leaves out is no slip that it need not find."""
    volts, truth = slips(1)
    late = track_of(
        'a', [Samples.evenly(volts[500:], RATE_HZ, truth[500:])], RATE_HZ
    )  # a slip after 0.2 s
    objective = Objective([late], EvaluationConfig(), TuneConfig())
    chain = dataclasses.replace(CHAIN, threshold=0.02)
    slow = dataclasses.replace(chain, passband_hz=(0.5, 50.0))
    for each in (chain, slow):
        candidate = objective.as_it_is(each)
        statistic = objective.statistics(each, [each.vote])[each.vote]
        sweep = objective.sweep(each, statistic, np.array([each.threshold]))
        left_out = int((~sweep.scored).sum())
        assert candidate.cost_ms > left_out / len(sweep.scored) * TuneConfig().missed_costs_ms
        assert left_out == sum(slip.start < settling_rows(each) for slip in late.slips)


def test_of_a_recording_that_ends_before_the_chain_has_settled_nothing_is_known():
    volts, truth = slips(1)
    short = track_of('a', [Samples.evenly(volts[600:680], RATE_HZ, truth[600:680])], RATE_HZ)
    objective = Objective([short], EvaluationConfig(), TuneConfig())
    assert objective.as_it_is(CHAIN).cost_ms == math.inf
    assert objective.as_it_is(CHAIN).figures[:5] == (None,) * 5
    assert objective.best(CHAIN) == []


def test_the_best_threshold_is_found_for_each_vote():
    tracks = [track(1), track(2)]
    objective = Objective(tracks, EvaluationConfig(), TuneConfig())
    found = objective.best(CHAIN)
    assert {one.chain.vote for one in found} == {'all', 'mean', 1}
    assert [one.cost_ms for one in found] == sorted(one.cost_ms for one in found)
    best = found[0]
    assert best.cost_ms < objective.as_it_is(CHAIN).cost_ms
    again = objective.as_it_is(best.chain)
    assert again.figures == best.figures
    assert best.figures.sooner_than_chance == 1.0


def test_a_threshold_next_to_no_evidence_is_not_taken():
    """It has no room for noise that is a tenth louder on another day."""
    chain = dataclasses.replace(
        CHAIN, decision='evidence', noise_floor=(0.05,), exponent=1, evidence_offset_db=12.0
    )
    tracks = [track(1)]
    objective = Objective(tracks, EvaluationConfig(), TuneConfig())
    candidates = objective.best(chain)
    assert candidates
    for found in candidates:
        assert found.figures.sooner_than_chance > 0.9
        statistic = objective.statistics(chain, [found.chain.vote])[found.chain.vote]
        assert found.chain.threshold >= thresholds(chain, statistic, tracks)[3]
        # Three steps of 3 %, or 0.257 dB, for as long as a window.
        assert found.chain.threshold > 3 * 0.25 * chain.envelope_window_s


def test_a_chain_that_never_moves_has_no_threshold():
    flat = track_of('a', [Samples.evenly(np.full((100, 4), 4.3), RATE_HZ, np.zeros(100))], RATE_HZ)
    assert Objective([flat], EvaluationConfig(), TuneConfig()).best(CHAIN) == []
