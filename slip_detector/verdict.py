"""What a search hands back: judged on held-out recordings, with its figures and its report."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slip_detector.config import ChainConfig, EvaluationConfig
from slip_detector.evaluator import events
from slip_detector.overview import MOST_CELLS, Overview
from slip_detector.replay import Outcome, Replay, figures
from slip_detector.search import Found, Objective
from slip_detector.tracks import Track
from slip_detector.workers import SEARCHED, Problem

if TYPE_CHECKING:
    from slip_detector.report_data import Trial

#: No recording of a report has less room than this share of it.
LEAST_SHARE = 1 / 32

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


def judge(problem: Problem, held: Sequence[Track], best: Found | None) -> Verdict:
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


class Replayed(NamedTuple):
    """A chain on all recordings."""

    chain: ChainConfig
    outcomes: list[Outcome]
    overviews: list[Any]


def replayed(
    chain: ChainConfig, tracks: Sequence[Track], evaluation: EvaluationConfig, shown: bool
) -> Replayed:
    """Replay recordings through a chain; with overviews for a report where it is to be shown."""
    replay = Replay(chain, evaluation)
    outcomes, overviews = [], []
    for track in tracks:
        overview = None
        if shown:
            cells = max(MOST_CELLS // len(tracks), round(LEAST_SHARE * MOST_CELLS))
            overview = Overview(
                track.name, chain, most_cells=cells, sample_rate_hz=track.sample_rate_hz
            )
        outcome = replay.run(track.rows(), track.sample_rate_hz, overview)
        outcomes.append(outcome)
        if overview is not None:
            overview.events = events(outcome)
            overviews.append(overview)
    return Replayed(chain, outcomes, overviews)


def pooled(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the figures of recordings together.

    They are those of :func:`slip_detector.replay.figures` and ``latency_median_all_ms``: the
    median over all slips, a missed one being later than any; None where that is a missed one.
    """
    latencies_s = [
        np.inf if slip.latency_s is None else slip.latency_s
        for one in outcomes
        for slip in one.slips
    ]
    median_s = float(np.median(latencies_s)) if latencies_s else np.inf
    median_ms = median_s * 1e3 if np.isfinite(median_s) else None
    return {**figures(outcomes), 'latency_median_all_ms': median_ms}


def table(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
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


def _trial(name: str, chain: ChainConfig, figures: dict[str, Any]) -> 'Trial':
    """Return a chain as a point of the trade-off."""
    from slip_detector.report_data import Trial

    latency_ms, recall = figures['latency_median_ms'], figures['recall']
    parameters = chain.to_parameters()
    return Trial(
        None,
        None if latency_ms is None else latency_ms / 1e3,
        figures['false_alarms_per_minute'],
        None if recall is None else 100.0 * (1.0 - recall),
        {parameter: parameters[parameter] for parameter in SEARCHED},
        name,
    )


def look_at(
    page: Path | None,
    folder: Path | None,
    notes: Sequence[str],
    given: Replayed,
    tuned: Replayed,
    held: Sequence[Track],
    both: dict[str, list[dict[str, Any]]],
    study: Any,
) -> list[Path]:
    """Write the report of a search, and its figures as pictures; return what was written."""
    from slip_detector import report
    from slip_detector.report_data import Trial, Variant

    variants = []
    for k, (name, one) in enumerate((('given', given), ('tuned', tuned))):
        rows = {f'all {what}': sides[k] for what, sides in both.items()}
        for i, (overview, outcome) in enumerate(zip(one.overviews, one.outcomes, strict=True)):
            what = 'held out' if i < len(held) else 'tuned on'
            rows[f'{overview.name} ({what})'] = outcome.figures()
        variants.append(Variant(name, one.chain, one.overviews, rows))
    trials = [
        Trial(
            trial.number,
            None if counts['latency_ms'] is None else counts['latency_ms'] / 1e3,
            counts['false_alarms_per_minute'],
            100.0 * counts['missed'],
            found['parameters'],
        )
        for trial in study.trials
        for found in trial.user_attrs['found'][:1]
        for counts in [found['figures']]
    ]
    shown = [given] if tuned.chain == given.chain else [given, tuned]
    trials += [
        _trial(variant.name, one.chain, figures)
        for variant, one, figures in zip(variants, shown, both['tuned on'], strict=False)
    ]
    # The table of the figures is in the report itself.
    few = [line for line in notes if not line.startswith(('  ', 'On what'))]
    written = []
    if page is not None:
        report.write(page, 'Tuning of the slip detector', variants, trials, few)
        written.append(page)
    if folder is not None:
        written += report.write_pictures(folder, variants, trials)
    return written
