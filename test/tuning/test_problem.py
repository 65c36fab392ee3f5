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

"""What a search is asked, which of the answers is taken, and how it is judged."""

import dataclasses
from types import SimpleNamespace

from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.problem import judge
from slip_detector.tuning.search import search
from support.tuning_cases import CHAIN, problem, track

BANDS = ('passband_hz', 'stopbands_hz', 'exponent', 'envelope_window_s', 'common_mode')


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


def test_few_slips_do_not_excuse_a_chain_that_tells_less_of_the_rows():
    asked = problem([track(1)])
    given = asked.space.point(CHAIN)
    found = {
        'parameters': {'threshold': 0.06, 'vote': CHAIN.vote},
        'cost_ms': 90.0,
        'error_ms': 500.0,
        'figures': asked.figures._asdict(),
    }

    def trial(octaves, cost_ms, auc):
        one = {**found, 'cost_ms': cost_ms, 'figures': {**found['figures'], 'auc': auc}}
        point = {**given, 'passband_octaves': given['passband_octaves'] + octaves}
        return SimpleNamespace(params=point, user_attrs={'found': [one]})

    best = trial(2.0, 50.0, asked.figures.auc - 0.02)
    near, nearer = trial(1.0, 80.0, asked.figures.auc - 0.02), trial(0.5, 70.0, 0.6)
    choice = asked.choice(SimpleNamespace(trials=[best, near, nearer]))
    assert choice.cost_ms == 80.0
    nearest = trial(0.1, 500.0, asked.figures.auc)
    assert asked.choice(SimpleNamespace(trials=[best, near, nearest])).cost_ms == 500.0


def test_another_question_has_another_name():
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


def test_a_study_gives_back_what_its_trials_found():
    asked = problem([track(1)])
    study = asked.study(None, 'a', seed=1)
    assert asked.best(study) is asked.choice(study) is None
    search(asked, study, 2, lambda: False, lambda count: None)
    objective = Objective(asked.tracks, asked.evaluation, asked.config, asked.figures)
    for trial in study.trials:
        candidates = asked.candidates(trial)
        assert candidates == objective.best(candidates[0].chain)
    assert asked.best(study).cost_ms == min(trial.value for trial in study.trials)


@settings(max_examples=6)
@given(seed=st.integers(0, 1000), held_hz=st.sampled_from([4.0, 18.0, 70.0, 150.0]))
def test_what_is_handed_back_is_never_worse_on_what_was_held_out(seed, held_hz):
    """Also where the held-out slips are of another kind than those tuned on."""
    from slip_detector.tuning.search import search

    asked = problem([track(seed, slip_hz=18.0), track(seed + 1, slip_hz=18.0)])
    held = [track(seed + 2, slip_hz=held_hz)]
    study = asked.study(None, 'a', seed=seed)
    search(asked, study, 10, lambda: False, lambda count: None)
    verdict = judge(asked, held, asked.choice(study))
    objective = Objective(held, EvaluationConfig(), TuneConfig())
    before, after = objective.as_it_is(asked.given), objective.as_it_is(verdict.chain)
    assert after.figures.worse_than(before.figures) == []
    assert after.cost_ms <= before.cost_ms
    if verdict.kept:
        assert verdict.chain is asked.given


def test_with_trade_one_figure_may_get_worse():
    tracks = [track(1), track(2)]
    asked = problem(tracks)
    free = dataclasses.replace(asked, config=TuneConfig(trade=True), figures=None)
    objective = Objective(tracks, EvaluationConfig(), TuneConfig())
    found = objective.as_it_is(dataclasses.replace(CHAIN, threshold=0.03))
    given_too_careful = dataclasses.replace(CHAIN, threshold=0.5)
    free = dataclasses.replace(free, given=given_too_careful)
    asked = dataclasses.replace(asked, given=given_too_careful)
    before = objective.as_it_is(given_too_careful)
    assert found.cost_ms < before.cost_ms
    worse = found.figures.worse_than(before.figures)
    assert judge(free, tracks, found).kept == ''
    assert bool(judge(asked, tracks, found).kept) == bool(worse)


def test_a_given_chain_that_is_nearly_always_on_is_not_kept():
    """Its recall was 1 and its latency short, before alarms had to begin with the slip."""
    tracks = [track(1), track(2)]
    too_low = dataclasses.replace(CHAIN, threshold=1e-6)
    asked = problem(tracks, too_low)
    assert asked.figures.false_time_percent > 99.0
    assert asked.figures.sooner_than_chance < 0.1
    found = Objective(tracks, EvaluationConfig(), TuneConfig()).as_it_is(
        dataclasses.replace(CHAIN, threshold=0.02)
    )
    assert judge(asked, [track(3)], found) == (found.chain, '')


def test_where_no_trial_found_a_chain_the_given_one_is_kept():
    verdict = judge(problem([track(1)]), [track(2)], None)
    assert verdict.chain == CHAIN
    assert verdict.kept == 'no trial found a chain that detects slip'
