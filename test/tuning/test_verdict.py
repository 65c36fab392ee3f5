"""What a search hands back is judged on recordings that it has not seen."""

import dataclasses

from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.verdict import judge, pooled_figures
from support.tuning_cases import CHAIN, RATE_HZ, problem, track


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


def test_a_missed_slip_is_later_than_any_in_the_median_over_all():
    chain = dataclasses.replace(CHAIN, threshold=0.02)
    found = Replay(chain).run(track(1).rows(), RATE_HZ)
    deaf = Replay(dataclasses.replace(CHAIN, threshold=1e9)).run(track(1).rows(), RATE_HZ)
    figures = pooled_figures([found])
    assert figures['latency_median_all_ms'] == figures['latency_median_ms']
    both = pooled_figures([found, dataclasses.replace(deaf, slips=deaf.slips[:3])])
    assert both['recall'] == 4 / 7
    assert both['latency_median_all_ms'] == both['latency_worst_ms']
    assert pooled_figures([found, deaf, deaf])['latency_median_all_ms'] is None
    assert pooled_figures([])['latency_median_all_ms'] is None


def test_where_no_trial_found_a_chain_the_given_one_is_kept():
    verdict = judge(problem([track(1)]), [track(2)], None)
    assert verdict.chain == CHAIN
    assert verdict.kept == 'no trial found a chain that tells slip'
