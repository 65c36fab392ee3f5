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

from slip_detector.chain.filters import settling_rows
from slip_detector.parameters.evaluation import EvaluationConfig, TuneConfig
from slip_detector.recordings.labels import label_times
from slip_detector.tuning.problem import COMPARED, Candidate, Problem, worse_figures
from slip_detector.tuning.search import Trial
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.sweep import vote_statistics
from slip_detector.tuning.tracks import track_of
from slip_detector.tuning.verdict import choose, judge
from support.tuning_cases import CHAIN, RATE_HZ, problem, slips, study_of, track, track_with

QUICK = dataclasses.replace(CHAIN, threshold=0.02)


def test_costs_are_latency_and_what_misses_false_alarms_and_wrong_time_count_for():
    tracks = [track(1), track(2)]
    weights = TuneConfig(
        missed_costs_ms=300.0, false_alarm_costs_ms=7.0, false_time_costs_ms=3.0,
        missed_time_costs_ms=0.5, auc_costs_ms=0.0,
    )  # fmt: skip
    objective = Problem(tracks, config=weights)
    never = objective.evaluate(dataclasses.replace(CHAIN, threshold=1e9))
    assert never.cost_ms == 350.0
    assert never.figures['sooner_than_chance'] == 0.0
    found = objective.evaluate(dataclasses.replace(CHAIN, threshold=0.02))
    assert found.figures['sooner_than_chance'] > 0.9
    assert 10.0 < found.figures['latency_median_ms'] < 100.0
    figures = found.figures
    for weight, figure in (
        ('false_alarm_costs_ms', figures['false_alarms_per_minute']),
        ('false_time_costs_ms', figures['false_time_percent']),
        ('missed_time_costs_ms', 100.0 * (1.0 - figures['coverage'])),
    ):
        heavier = dataclasses.replace(weights, **{weight: getattr(weights, weight) + 1.0})
        more = Problem(tracks, config=heavier).evaluate(found.chain)
        assert more.cost_ms - found.cost_ms == pytest.approx(figure, abs=1e-9)


def compared(*values, **more):
    """Return figures of a chain: of slips, of rest, both; of kinds only what is said."""
    names = [*[*COMPARED][:5], 'auc', 'sooner_than_chance']
    return dict.fromkeys(COMPARED) | dict(zip(names, values, strict=True)) | more


def test_time_on_counts_beside_rest_by_the_mean_of_kinds_however_long_each_was_recorded():
    often = dataclasses.replace(CHAIN, threshold=2e-4, vote=1)
    tracks = [track(1), track(2, 'press', noise_v=0.07), track(3, 'idle', 6.0, noise_v=0.06)]
    figures = Problem(tracks).evaluate(often).figures
    alone_percent = Problem(tracks[:1]).evaluate(often).figures['false_time_percent']
    of_kinds = [figures['press_on_percent'], figures['idle_on_percent']]
    assert of_kinds[0] > of_kinds[1] > 0.0
    free = TuneConfig(auc_costs_ms=0.0, false_time_costs_ms=0.0)
    for many, more_percent in ((1, 0.0), (2, of_kinds[0]), (3, np.mean(of_kinds))):
        cost_ms, free_ms = (
            Problem(tracks[:many], config=config).evaluate(often).cost_ms
            for config in (dataclasses.replace(free, false_time_costs_ms=10.0), free)
        )
        assert cost_ms - free_ms == pytest.approx(10.0 * (alone_percent + more_percent))


def test_a_figure_that_gets_worse_than_given_counts_tenfold():
    tracks = [track(1), track(2, 'press')]
    alone = Problem(tracks).evaluate(QUICK)
    # One that finds few slips has no median of all.
    few = compared(None, None, None, 1e6, 100.0, None, 0.2)
    for name, less, more_ms in (
        ('latency_median_all_ms', 10.0, 10 * 10.0), ('auc', -0.01, 10 * 1.0),
        ('press_on_percent', 1.5, 10 * 10.0 * (1.5 - 0.5)), ('recall', 0.0, 0.0), (None, 0, 0.0),
    ):  # fmt: skip
        before = {**alone.figures, name: alone.figures[name] - less} if name else few
        cost_ms = Problem(tracks, figures=before).evaluate(QUICK).cost_ms
        assert cost_ms == pytest.approx(alone.cost_ms + more_ms)


def test_each_figure_that_is_worse_is_named():
    good = compared(1.0, 0.9, 20.0, 1.005, 0.5, 0.99, 1.0, press_on_percent=3.0)
    bad = compared(0.9, 0.8, None, 2.03, 1.5, 0.9, 0.5, press_on_percent=3.6)
    assert worse_figures(bad, good) == [*[*COMPARED][:5], 'press_on_percent', 'auc']


@dataclasses.dataclass(frozen=True, eq=False)
class Known(Problem):
    """A problem in which costs are known: as it is, of a quick chain; left out, by threshold."""

    costs: tuple = ()

    def evaluate(self, chain):
        return self.costs[chain is QUICK]

    def cross_validate(self, chain):
        of_each = np.array(self.costs[round(chain.threshold)])
        return of_each.mean(), (of_each.sum() - of_each) / (of_each.size - 1)


#: A chain that is good, one that is ON for half of the rest, and what is never ON.
GOOD = compared(0.9, 0.9, 20.0, 1.0, 0.3, 0.9, 0.9) | {'matched': 9, 'missed': 1}
HALF = compared(0.9, 0.99, 20.0, 4.0, 50.0, 0.7, 0.6) | {'matched': 9, 'missed': 1}
BLIND = compared(0.0, 0.0, None, 0.0, 0.0, 0.7, 0.0) | {'matched': 0, 'missed': 10}


@pytest.mark.parametrize(
    ('was', 'changes', 'kept'),
    [
        (GOOD, {}, 'is no better'),
        (GOOD, {'recall': 1.0}, ''),
        (GOOD, {'auc': 0.902}, ''),
        (GOOD, {'auc': 0.9005}, 'is no better'),
        (GOOD, {'recall': 1.0, 'latency_median_all_ms': 21.0}, 'is worse'),
        (GOOD, {'recall': 1.0, 'latency_median_all_ms': None}, 'is worse'),
        # What is ON for less of the rest may have more alarms, and be ON less in slips.
        (GOOD, {'recall': 1.0, 'false_time_percent': 3.0, 'coverage': 0.82}, 'is worse'),
        (HALF, {'false_time_percent': 1.0, 'coverage': 0.51}, ''),
        (HALF, {'false_time_percent': 1.0, 'coverage': 0.49}, 'is worse'),
        (HALF, {'false_time_percent': 1.0, 'false_alarms_per_minute': 6.0}, ''),
        (GOOD, BLIND, 'is worse'),
        (BLIND, {'auc': 0.9}, 'finds none of 10 slips'),
        (BLIND, {'auc': 0.9, 'matched': 1}, 'is no better than guessing'),
        # In no figure can one be worse than what is no better than chance.
        (BLIND, {**GOOD, 'auc': 0.6}, ''),
    ],
)
def test_the_best_is_taken_where_it_finds_slips_and_is_better_and_in_nothing_worse(
    was, changes, kept
):
    before, after = (Candidate(QUICK, 1.0, figures) for figures in (was, {**was, **changes}))
    asked = Known([], costs=(before, after))
    verdict = judge(asked, CHAIN, [], after)
    assert verdict.chain is (CHAIN if kept else QUICK)
    assert verdict.kept == (
        f'on what was held out, the best that was tried {kept}' if kept else ''
    )
    assert judge(asked, CHAIN, [], None).kept == 'nothing that was tried finds slips'


def test_a_chain_does_not_gain_by_settling_for_longer():
    volts, truth = slips(1)
    # a slip after 0.2 s
    late = track_with(volts[500:], truth[500:])
    objective = Problem([late])
    for each in (QUICK, dataclasses.replace(QUICK, passband_hz=(0.5, 50.0))):
        candidate = objective.evaluate(each)
        left_out = sum(slip.start < settling_rows(each) for slip in late.slips)
        assert candidate.cost_ms > left_out / len(late.slips) * TuneConfig().missed_costs_ms


def test_a_recording_that_ends_before_the_chain_has_settled_has_no_figures():
    volts, truth = slips(1)
    objective = Problem([track_with(volts[600:680], truth[600:680])])
    assert objective.evaluate(CHAIN).cost_ms == math.inf
    assert not any(objective.evaluate(CHAIN).figures[name] for name in [*COMPARED][:4])
    assert objective.best(CHAIN) is None


def test_a_threshold_next_to_no_evidence_is_not_taken():
    chain = dataclasses.replace(
        CHAIN, decision='evidence', noise_floor=(0.05,), exponent=1, evidence_offset_db=12.0
    )
    tracks = [track(1)]
    found = Problem(tracks).best(chain)
    assert found.figures['sooner_than_chance'] > 0.9
    (statistics,) = vote_statistics(chain, [found.chain.vote], tracks)
    assert found.chain.threshold >= statistics.thresholds()[3]
    # Three steps of 3 %, or 0.257 dB, for as long as a window.
    assert found.chain.threshold > 3 * 0.25 * chain.envelope_window_s


def test_the_threshold_for_a_recording_comes_from_the_others():
    def left_out(gain):
        """Return the costs where the first recording is louder than the others."""
        volts, truth = slips(1)
        tracks = [track_with(4.3 + gain * (volts - 4.3), truth), track(2), track(3), track(4)]
        return Problem(tracks).cross_validate(CHAIN)

    cost_ms, _ = left_out(1.0)
    # Louder noise costs time ON where the threshold is not its own; without it nothing changes.
    more_ms, without_ms = left_out(4.0)
    assert more_ms > cost_ms + 100.0
    assert without_ms[0] < without_ms[1:].min()


SPACE = SearchSpace(CHAIN)


def trial_of(k, octaves, auc=0.9):
    """Return the trial of a chain with a threshold at a distance from the given one."""
    point = SPACE.point(CHAIN)
    point['passband_octaves'] += octaves
    chain = dataclasses.replace(CHAIN, threshold=float(k))
    return Trial(point, Candidate(chain, k, {'auc': auc}))


def test_the_nearest_of_those_within_a_standard_error_of_the_best_is_chosen():
    for far_ms, near_ms, nearer in (
        # Worse by the same in each recording: surely. Worse in some: maybe.
        ([90, 110, 100, 95, 105], [95, 115, 105, 100, 110], False),
        ([20, 180, 100, 40, 160], [120, 90, 110, 130, 85], True),
    ):
        asked = Known([], CHAIN, costs=((), far_ms, near_ms, [1e4] * 5))
        study = SimpleNamespace(problem=asked, space=SPACE)
        study.trials = [trial_of(1, 2.0), trial_of(2, 1.0), trial_of(3, 0.5)]
        assert choose(study).chain.threshold == 1.0 + nearer
        # Few slips do not excuse one that tells less of the many rows.
        study.problem = dataclasses.replace(asked, figures={'auc': 0.9})
        study.trials = [study.trials[0], trial_of(2, 1.0, auc=0.8)]
        assert choose(study).chain.threshold == 1.0


def test_with_scored_slips_in_one_recording_the_nearest_of_the_cheapest_is_chosen():
    volts, truth = slips(1)
    early = track_with(volts[600:900], truth[600:900])  # While the chain settles.
    for other in (early, track(2, 'rest')):
        asked = problem([track(1), other])
        chosen = choose(study_of(asked, 12)).chain
        assert (chosen.passband_hz, chosen.exponent) == (CHAIN.passband_hz, CHAIN.exponent)


def test_another_problem_has_another_name():
    asked = problem([track(1)])
    others = [
        problem([track(2)]),
        dataclasses.replace(asked, origin=dataclasses.replace(CHAIN, threshold=0.06)),
        dataclasses.replace(asked, figures=None),
        dataclasses.replace(asked, evaluation=EvaluationConfig(tail_s=0.2)),
        dataclasses.replace(asked, config=TuneConfig(auc_costs_ms=0.0)),
    ]
    assert asked.study_name() == problem([track(1)]).study_name()
    assert len({one.study_name() for one in (asked, *others)}) == 6


def test_slips_are_counted_that_begin_when_both_chains_have_settled():
    tracks = [track_with(*(rows[round(0.9 * RATE_HZ) :] for rows in slips(1)))]
    slow = dataclasses.replace(CHAIN, threshold=1e3, envelope_window_s=1.0)
    kept = judge(problem(tracks), CHAIN, tracks, Problem(tracks).evaluate(slow)).kept
    assert kept.endswith(' is worse')


def test_a_chain_that_remembers_for_longer_costs_more_where_labels_hide_it():
    rows = track(1).samples
    edges_ns = rows.stamps_ns[np.flatnonzero(np.diff(rows.truth)) + 1]
    by_hand = rows._replace(accuracy_s=0.2, **label_times(rows.stamps_ns, edges_ns, 0.2))
    tracks = [track_of('a', [by_hand], RATE_HZ)]
    objective = Problem(tracks)
    short, long = (
        objective.evaluate(dataclasses.replace(QUICK, decision_window_s=window_s))
        for window_s in (0.05, 0.15)
    )
    assert long.figures == short.figures
    assert long.cost_ms > short.cost_ms + 10.0
    # But it is taken only if a figure is better.
    assert judge(Problem(tracks), long.chain, tracks, short).kept.endswith(' is no better')
