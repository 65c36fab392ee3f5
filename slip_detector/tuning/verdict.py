"""The verdict of a search: the best chain found or the given one, by held-out recordings."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.evaluation.replay import ReplayOutcome, figures_of_merit
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.tracks import Track


class Verdict(NamedTuple):
    """The chain that a search returns.

    Attributes
    ----------
    chain : ChainConfig
        The best chain found, or the given one.
    kept : str
        Why the given chain is kept; empty where it is not.
    """

    chain: ChainConfig
    kept: str


def judge(problem: Problem, held: Sequence[Track], best: Candidate | None) -> Verdict:
    """Choose between the given chain and the best one found, by the held-out recordings.

    The best one is chosen where it costs less on them and where, unless ``trade`` is set, none of
    median latency, misses, false alarms and area under the ROC curve is worse.

    Parameters
    ----------
    problem
        The problem of the search.
    held
        The held-out recordings.
    best
        The best chain found; None where none was found.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.parameters import EvaluationConfig, TuneConfig
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = LabelledRows(np.tile(volts, (16, 1)).T, truth=slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> problem = Problem([track], ChainConfig(), None, EvaluationConfig(), TuneConfig())
    >>> judge(problem, [track], best=None).kept
    'no trial found a chain that tells slip'
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
    """Return the figures of recordings taken together.

    Returns
    -------
    dict
        The figures of :func:`slip_detector.evaluation.replay.figures_of_merit`, and
        ``latency_median_all_ms``: the median latency of all slips, where a missed slip counts as
        infinitely late; None where the median is infinite.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.evaluation.replay import Replay
    >>> quiet = LabelledRows(np.full((380, 16), 4.3), truth=np.arange(380) >= 190)
    >>> figures = pooled_figures([Replay(ChainConfig()).run([quiet])])
    >>> figures['missed'], figures['latency_median_all_ms']
    (1, None)
    """
    latencies_ms = [
        np.inf if slip.latency_s is None else slip.latency_s * 1e3
        for one in outcomes
        for slip in one.slips
    ]
    median_ms = float(np.median(latencies_ms)) if latencies_ms else np.inf
    all_ms = median_ms if np.isfinite(median_ms) else None
    return {**figures_of_merit(outcomes), 'latency_median_all_ms': all_ms}
