"""What a search hands back: judged on held-out recordings, with its figures."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.evaluation.replay import ReplayOutcome, figures_of_merit
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.tracks import Track

#: The figures that the file and the printed table have, what they are called, and their format.
TABLE = {
    'slips': ('slips', 'd'),
    'recall': ('recall', '.3f'),
    'precision': ('precision', '.3f'),
    'false_alarms_per_minute': ('false alarms per minute', '.3g'),
    'latency_median_ms': ('latency, median of those detected [ms]', '.1f'),
    'latency_median_all_ms': ('latency, median of all, missed ones last [ms]', '.1f'),
    'latency_p90_ms': ('latency, 90th percentile [ms]', '.1f'),
    'latency_worst_ms': ('latency, worst [ms]', '.1f'),
    'auc_all': ('AUC, all rows', '.3f'),
    'auc_moving': ('AUC, rows of motion', '.3f'),
}


class Verdict(NamedTuple):
    """What is handed back, and why.

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

    The latter is handed back where it costs less there and, unless ``trade`` is set, none of
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
    latencies_s = [
        np.inf if slip.latency_s is None else slip.latency_s
        for one in outcomes
        for slip in one.slips
    ]
    median_s = float(np.median(latencies_s)) if latencies_s else np.inf
    median_ms = median_s * 1e3 if np.isfinite(median_s) else None
    return {**figures_of_merit(outcomes), 'latency_median_all_ms': median_ms}


def comparison_table(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Lay the figures of the given and of the tuned chain out beside each other."""
    rows = [('', 'given', 'tuned')]
    for name, (title, form) in TABLE.items():
        if name == 'auc_moving' and before[name] is None:
            continue
        cells = [
            '-' if value is None else format(value, form) for value in (before[name], after[name])
        ]
        rows.append((title, cells[0], cells[1]))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        f'  {title.ljust(widths[0])}  {given.rjust(widths[1])}  {tuned.rjust(widths[2])}'.rstrip()
        for title, given, tuned in rows
    ]
