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

"""What a search hands back is judged on recordings that it has not seen."""

import dataclasses

from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.verdict import judge
from support.tuning_cases import CHAIN, problem, track


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
