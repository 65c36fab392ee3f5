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

"""What a chain costs, which answers of a search are taken, and how they are judged."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from slip_detector.chain.filters import settling_rows
from slip_detector.compiled import COMPILED
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig, TuneConfig
from slip_detector.recordings.labels import label_at
from slip_detector.tuning.problem import Candidate, Problem
from slip_detector.tuning.sweep import thresholds, vote_statistics
from slip_detector.tuning.tracks import track_of
from slip_detector.tuning.verdict import COMPARED, choose, judge, worse_than
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings
from support.tuning_cases import CHAIN, problem, slips, study_of, track, track_with

QUICK = dataclasses.replace(CHAIN, threshold=0.02)


@settings(max_examples=40 if COMPILED else 3, deadline=None)
@given(chains(), st.lists(recordings(), min_size=1, max_size=3), EVALUATIONS)
def test_the_tuner_gives_a_chain_the_figures_of_the_evaluation_to_the_bit(
    chain, several, evaluation
):
    kinds = zip(several, ('', 'press', 'rest'), strict=False)
    several = [[piece._replace(kind=kind) for piece in pieces] for pieces, kind in kinds]
    tracks = [track_of('a', pieces, RATE_HZ) for pieces in several]
    assume(any(track.slips for track in tracks))
    objective = Problem(tracks, evaluation=evaluation)
    for candidate in [objective.as_it_is(chain), *objective.best(chain)]:
        replay = Replay(candidate.chain, evaluation)
        outcomes = [replay.run(pieces, RATE_HZ) for pieces in several]
        expected = figures_of_merit(outcomes)
        against_motion = any(one.scores.counts[1].any() for one in outcomes)
        expected['auc'] = expected['auc_moving' if against_motion else 'auc_all']
        for name, figure in candidate.figures.items():
            assert figure == expected[name], name
        assert objective.as_it_is(candidate.chain).figures == candidate.figures


def test_costs_are_latency_and_what_misses_false_alarms_and_wrong_time_count_for():
    tracks = [track(1), track(2)]
    weights = TuneConfig(
        missed_costs_ms=300.0, false_alarm_costs_ms=7.0, false_time_costs_ms=3.0,
        missed_time_costs_ms=0.5, auc_costs_ms=0.0,
    )  # fmt: skip
    objective = Problem(tracks, config=weights)
    never = objective.as_it_is(dataclasses.replace(CHAIN, threshold=1e9))
    assert never.cost_ms == 350.0
    assert never.figures['sooner_than_chance'] == 0.0
    found = objective.as_it_is(dataclasses.replace(CHAIN, threshold=0.02))
    assert found.figures['sooner_than_chance'] > 0.9
    assert 10.0 < found.figures['latency_median_ms'] < 100.0
    figures = found.figures
    for weight, figure in (
        ('false_alarm_costs_ms', figures['false_alarms_per_minute']),
        ('false_time_costs_ms', figures['false_time_percent']),
        ('missed_time_costs_ms', 100.0 * (1.0 - figures['coverage'])),
    ):
        heavier = dataclasses.replace(weights, **{weight: getattr(weights, weight) + 1.0})
        more = Problem(tracks, config=heavier).as_it_is(found.chain)
        assert more.cost_ms - found.cost_ms == pytest.approx(figure, abs=1e-9)


def compared(*values):
    """Return figures of a chain, those of kinds undefined."""
    return dict.fromkeys(COMPARED) | dict(zip(COMPARED, values, strict=False))


def test_each_kind_of_recordings_counts_as_much_as_another_and_may_not_get_worse():
    often = dataclasses.replace(CHAIN, threshold=2e-4, vote=1)
    weights = TuneConfig(auc_costs_ms=0.0)
    slips_, still = track(1), track(2, slips=False, duration_s=6.0)
    press = track(2, 'press', duration_s=6.0)
    pooled, apart = (Problem([slips_, one], config=weights) for one in (still, press))
    figures = apart.as_it_is(often).figures
    rest_s = {'': 12.0 - 4 * 0.8 - 0.4, 'press': 6.0 - 0.4}
    share = rest_s['press'] / sum(rest_s.values())
    # Half of the cost is that of the press, whose time is about a third.
    on_percent, press_percent = figures['false_time_percent'], figures['press_on_percent']
    other_percent = (on_percent - share * press_percent) / (1.0 - share)
    less = TuneConfig(auc_costs_ms=0.0, false_time_costs_ms=0.0)
    for problem_, percent in (
        (pooled, on_percent), (apart, (press_percent + other_percent) / 2),
    ):  # fmt: skip
        free = dataclasses.replace(problem_, config=less).as_it_is(often)
        cost_ms = problem_.as_it_is(often).cost_ms - free.cost_ms
        assert cost_ms == pytest.approx(10.0 * percent, rel=0.02)
    surer = {**figures, 'press_on_percent': press_percent - 1.5}
    costs_ms = [
        Problem([slips_, press], figures=one).as_it_is(often).cost_ms for one in (figures, surer)
    ]
    assert costs_ms[1] - costs_ms[0] == pytest.approx(10.0 * 10.0 * (1.5 - 0.5))


def test_a_figure_that_gets_worse_than_given_counts_tenfold():
    tracks = [track(1)]
    alone = Problem(tracks).as_it_is(QUICK)
    latency_ms, auc = alone.figures['latency_median_all_ms'], alone.figures['auc']
    faster = {**alone.figures, 'latency_median_all_ms': latency_ms - 5}
    surer = {**alone.figures, 'auc': auc + 0.01}
    # It finds few slips: no median of all.
    few = compared(100.0, 1e6, None, 0.2, None, None)
    for given_figures, more_ms in ((faster, 50.0), (surer, 10.0), (alone.figures, 0.0), (few, 0)):
        cost_ms = Problem(tracks, figures=given_figures).as_it_is(QUICK).cost_ms
        assert cost_ms == pytest.approx(alone.cost_ms + more_ms)


def test_each_figure_that_is_worse_is_named_and_of_a_chain_as_good_as_chance_only_the_area():
    good = compared(0.5, 1.005, 20.0, 1.0, 0.9, 0.99) | {'press_on_percent': 3.0}
    bad = compared(1.5, 2.03, None, 0.5, 0.8, 0.9) | {'press_on_percent': 3.6}
    assert 'time ON in press 3.6 against 3 %' in worse_than(bad, good)
    good['press_on_percent'] = 3.2  # Not much more.
    assert worse_than(bad, good) == [
        'false time 1.5 against 0.5 %',
        'false alarms 2.03 against 1.005 in a minute of rest',
        'no median latency defined against 20 ms',
        'sooner than chance 0.5 against 1',
        'time of slips that is ON 0.8 against 0.9',
        'area under the ROC curve 0.9 against 0.99',
    ]
    assert worse_than(good, good) == worse_than(good, bad) == []
    for sooner_than_chance in (0.0, -0.2, None):
        by_chance = {**good, 'sooner_than_chance': sooner_than_chance}
        assert worse_than(bad, by_chance) == ['area under the ROC curve 0.9 against 0.99']
        assert worse_than(bad, {**by_chance, 'auc': 0.9}) == []


def test_what_was_on_for_half_of_the_rest_has_few_alarms_and_is_on_in_slips_by_chance():
    half = compared(50.0, 4.0, 20.0, 0.6, 0.99, 0.7)
    assert worse_than(compared(1.0, 6.0, 20.0, 0.9, 0.8, 0.99), half) == []
    # But of one that is ON as much alarms are compared, and coverage by more than the time ON.
    assert worse_than(compared(49.8, 6.0, 20.0, 0.6, 0.99, 0.7), half)
    assert worse_than(compared(1.0, 6.0, 20.0, 0.9, 0.4, 0.99), half) == [
        'time of slips that is ON 0.4 against 0.99'
    ]


@dataclasses.dataclass(frozen=True, eq=False)
class Known(Problem):
    """A problem in which the costs of a quick chain and of the given one are known."""

    costs: tuple = ()

    def as_it_is(self, chain):
        return self.costs[chain is QUICK]


def costs():
    """Draw what a chain costs, with figures any of which may not be known."""
    figure = st.sampled_from([0.0, 0.003, 0.01, 0.3, 0.9, 1.0, 20.0, 75.0, None])
    counts = dict.fromkeys(['matched', 'missed'], st.sampled_from([0, 3, 10]))
    figures = st.fixed_dictionaries(dict.fromkeys(COMPARED, figure) | counts)
    return st.builds(Candidate, st.just(QUICK), st.sampled_from([1.0, 2.0]), st.just(0.0), figures)


#: What is never ON, and what finds slips by chance.
BLIND, CHANCE = (
    Candidate(QUICK, cost_ms, 0.0, compared(*figures) | {'matched': found, 'missed': 10 - found})
    for cost_ms, found, figures in (
        (2.0, 0, (0.0, 0.0, None, 0.0, 0.0, 0.7)), (1.0, 4, (30.0, 99.0, None, -0.2, 0.9, 0.9)),
    )
)  # fmt: skip


@settings(max_examples=500)
@example(BLIND, CHANCE, False)
@given(costs(), costs(), st.booleans())
def test_nothing_is_taken_that_is_blind_or_chance_or_worse_or_in_nothing_better(
    before, after, trade
):
    asked = Known([], config=TuneConfig(trade=trade), costs=(before, after))
    verdict, (was, now) = judge(asked, [], after), (before.figures, after.figures)
    changes = {
        name: (now[name] - was[name]) * (1 if more_is_better else -1)
        for name, (_, _, more_is_better, *_) in COMPARED.items()
        if None not in (was[name], now[name])
    }
    excused = set()
    if changes.get('false_time_percent', 0.0) > 0.5:
        excused = {'false_alarms_per_minute', 'coverage'}
    worse = {name for name, change in changes.items() if change < -COMPARED[name][3]} - excused
    if (was['sooner_than_chance'] or 0.0) > 0.0:
        worse |= {name for name in COMPARED if was[name] is not None is now[name]}
    else:
        worse &= {'auc'}
    if verdict.kept:
        assert verdict.chain is asked.given
        return
    assert after.cost_ms < before.cost_ms
    assert now['matched'] > 0 < now['sooner_than_chance']
    assert len(worse) <= trade
    assert bool(verdict.traded) == bool(worse)
    assert not worse_than(now, was, trade=True)
    assert worse_than(was, now)


@pytest.mark.parametrize('given_', ['never', 'always', 'chance', 'good'])
def test_only_what_finds_slips_wins_whatever_was_given(given_):
    tracks = [track(1), track(2)]
    limits = {'never': 1e9, 'always': 1e-12, 'chance': 1e-4, 'good': 0.02}
    short = dataclasses.replace(CHAIN, decision_window_s=0.003, vote=1)
    chains_ = {name: dataclasses.replace(short, threshold=limits[name]) for name in limits}
    for name, chain in chains_.items():
        verdict = judge(problem(tracks, chains_[given_]), tracks, Problem(tracks).as_it_is(chain))
        assert bool(verdict.kept) == (name != 'good' or given_ == 'good'), (name, verdict)


def test_a_chain_does_not_gain_by_settling_for_longer():
    volts, truth = slips(1)
    # a slip after 0.2 s
    late = track_with(volts[500:], truth[500:])
    objective = Problem([late])
    for each in (QUICK, dataclasses.replace(QUICK, passband_hz=(0.5, 50.0))):
        candidate = objective.as_it_is(each)
        left_out = sum(slip.start < settling_rows(each) for slip in late.slips)
        assert candidate.cost_ms > left_out / len(late.slips) * TuneConfig().missed_costs_ms


def test_a_recording_that_ends_before_the_chain_has_settled_has_no_figures():
    volts, truth = slips(1)
    objective = Problem([track_with(volts[600:680], truth[600:680])])
    assert objective.as_it_is(CHAIN).cost_ms == math.inf
    assert not any(objective.as_it_is(CHAIN).figures[name] for name in [*COMPARED][:4])
    assert objective.best(CHAIN) == []


def test_a_threshold_next_to_no_evidence_is_not_taken():
    chain = dataclasses.replace(
        CHAIN, decision='evidence', noise_floor=(0.05,), exponent=1, evidence_offset_db=12.0
    )
    tracks = [track(1)]
    objective = Problem(tracks)
    for found in objective.best(chain):
        assert found.figures['sooner_than_chance'] > 0.9
        (statistic,) = vote_statistics(chain, [found.chain.vote], tracks).values()
        assert found.chain.threshold >= thresholds(chain, statistic, tracks)[3]
        # Three steps of 3 %, or 0.257 dB, for as long as a window.
        assert found.chain.threshold > 3 * 0.25 * chain.envelope_window_s


def test_of_one_slip_nothing_is_learnt_but_a_threshold():
    one = track(1, duration_s=3.0)
    assert len(one.slips) == 1
    asked = problem([one])
    trials = study_of(asked, 12).trials
    choice = choose(asked, trials)
    for name in (
        'passband_hz', 'stopbands_hz', 'exponent', 'envelope_window_s', 'common_mode', 'vote',
    ):  # fmt: skip
        assert getattr(choice.chain, name) == getattr(CHAIN, name), name


def test_few_slips_do_not_excuse_a_chain_that_tells_less_of_the_rows():
    asked = problem([track(1)])
    given = asked.space.point(CHAIN)
    found = {
        'parameters': {'threshold': 0.06, 'vote': CHAIN.vote},
        'cost_ms': 90.0,
        'error_ms': 500.0,
        'figures': asked.figures,
    }

    def trial(octaves, cost_ms, auc):
        one = {**found, 'cost_ms': cost_ms, 'figures': {**found['figures'], 'auc': auc}}
        point = {**given, 'passband_octaves': given['passband_octaves'] + octaves}
        return SimpleNamespace(params=point, user_attrs={'found': [one]})

    best = trial(2.0, 50.0, asked.figures['auc'] - 0.02)
    near, nearer = trial(1.0, 80.0, asked.figures['auc'] - 0.02), trial(0.5, 70.0, 0.6)
    assert choose(asked, [best, near, nearer]).cost_ms == 80.0
    nearest = trial(0.1, 500.0, asked.figures['auc'])
    assert choose(asked, [best, near, nearest]).cost_ms == 500.0


def test_another_problem_has_another_name():
    asked = problem([track(1)])
    others = [
        problem([track(2)]),
        dataclasses.replace(asked, given=dataclasses.replace(CHAIN, threshold=0.06)),
        dataclasses.replace(asked, figures=None),
        dataclasses.replace(asked, evaluation=EvaluationConfig(tail_s=0.2)),
        dataclasses.replace(asked, config=TuneConfig(auc_costs_ms=0.0)),
    ]
    assert asked.study_name() == problem([track(1)]).study_name()
    assert len({one.study_name() for one in (asked, *others)}) == 6


def test_with_trade_one_figure_may_get_worse_within_its_bound_and_that_is_said():
    given_ = compared(0.5, 1.0, 20.0, 0.8, 0.9, 0.99) | {'matched': 10, 'missed': 0}
    before = Candidate(CHAIN, 2.0, 0.0, given_)
    for changes, said in (
        ({'false_time_percent': 5.0}, 'false time 5 against 0.5 %'),
        ({'false_time_percent': 75.0}, None),
        ({'false_time_percent': 5.0, 'auc': 0.98}, None),
        ({'matched': 9, 'missed': 1}, None),
    ):
        now = {**given_, 'latency_median_all_ms': 10.0, **changes}
        asked = Known([], config=TuneConfig(trade=True), costs=(before, before._replace(
            cost_ms=1.0, figures=now
        )))  # fmt: skip
        verdict = judge(asked, [], before._replace(chain=QUICK))
        assert (verdict.kept, verdict.traded) == ('', said) if said else verdict.kept
        assert judge(dataclasses.replace(asked, config=TuneConfig()), [], verdict).kept


def test_slips_are_counted_that_begin_when_both_chains_have_settled():
    tracks = [track_with(*(rows[round(0.9 * RATE_HZ) :] for rows in slips(1)))]
    slow = dataclasses.replace(CHAIN, threshold=1e3, envelope_window_s=1.0)
    kept = judge(problem(tracks), tracks, Problem(tracks).as_it_is(slow)).kept
    assert 'worse: misses 3 of 3 slips, ' in kept


def test_a_chain_that_remembers_for_longer_costs_more_where_labels_hide_it():
    rows = track(1).samples
    edges_ns = rows.stamps_ns[np.flatnonzero(np.diff(rows.truth)) + 1]
    by_hand = rows._replace(accuracy_s=0.2, **label_at(rows.stamps_ns, edges_ns, 0.2))
    tracks = [track_of('a', [by_hand], RATE_HZ)]
    objective = Problem(tracks)
    short, long = (
        objective.as_it_is(dataclasses.replace(QUICK, decision_window_s=window_s))
        for window_s in (0.05, 0.15)
    )
    assert long.figures == short.figures
    assert long.cost_ms > short.cost_ms + 10.0
    # But it is taken only if a figure is better.
    assert judge(Problem(tracks, long.chain), tracks, short).kept.endswith(' is no better')
