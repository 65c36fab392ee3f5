"""What a search hands back: judged on held-out recordings, with its figures."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.evaluation.replay import ReplayOutcome, figures_of_merit
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.tracks import Track


class Verdict(NamedTuple):
    """The result of a search, and why it is this one.

    Attributes
    ----------
    chain : ChainConfig
    kept : str
        Why the given parameters are kept; empty where they are not.
    """

    chain: ChainConfig
    kept: str


def judge(problem: Problem, held: Sequence[Track], best: Candidate | None) -> Verdict:
    """Decide on the held-out recordings between the given chain and the best found.

    The latter is chosen where it costs less there and, unless ``trade`` is set, none of
    median latency, misses and false alarms is worse.
    """
    given = problem.given
    if best is None:
        return Verdict(given, 'no trial found a chain that tells slip')
    objective = Objective(held, problem.evaluation, problem.config)
    before, after = objective.as_it_is(given), objective.as_it_is(best.chain)
    if not after.cost_ms < before.cost_ms:
        return Verdict(
            given,
            f'on the held-out recordings the best found costs {after.cost_ms:.4g} ms against '
            f'{before.cost_ms:.4g} ms',
        )
    worse = [] if problem.config.trade else after.figures.worse_than(before.figures)
    if worse:
        return Verdict(
            given,
            f'on the held-out recordings the best found has {", ".join(worse)} (trade: true '
            f'in the section {problem.config.NODE} allows that where the cost falls)',
        )
    return Verdict(best.chain, '')


def pooled_figures(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the figures of recordings together.

    They are those of :func:`slip_detector.evaluation.replay.figures_of_merit` and
    ``latency_median_all_ms``: the
    median over all slips, a missed one being later than any; None where that is a missed one.
    """
    latencies_ms = [
        np.inf if slip.latency_s is None else slip.latency_s * 1e3
        for one in outcomes
        for slip in one.slips
    ]
    median_ms = float(np.median(latencies_ms)) if latencies_ms else np.inf
    all_ms = median_ms if np.isfinite(median_ms) else None
    return {**figures_of_merit(outcomes), 'latency_median_all_ms': all_ms}
