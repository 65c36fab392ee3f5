"""A search in this process: trial after trial of a study."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import SEARCHED, Problem
from slip_detector.tuning.space import SearchSpace

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study


def search(
    problem: Problem,
    study: 'Study',
    trials: int,
    stop: Callable[[], bool],
    progress: Callable[[int], None],
) -> None:
    """Try chains in this process until the study has so many trials.

    Parameters
    ----------
    problem
        What is searched.
    study
        To take part in.
    trials
        How many the study is to have, those of other workers and of earlier runs counted.
    stop
        Asked before each trial.
    progress
        Told how many there are after each.

    Raises
    ------
    ValueError
        When the storage fails; names it.
    """
    space = SearchSpace(problem.given)
    objective = Objective(problem.tracks, problem.evaluation, problem.config, problem.figures)
    starts = space.starts()
    count = study.follow()
    while not stop() and count < trials:
        trial = study.ask(starts[count] if count < len(starts) else None)
        try:
            found = objective.best(space.chain(trial.params))
        except ValueError:  # no such filter
            found = []
        study.tell(trial, found[0].cost_ms if found else None, {'found': list(map(_kept, found))})
        count = study.follow()
        progress(count)


def _kept(found: Candidate) -> dict[str, Any]:
    """Return what a study keeps of a chain, in the types of JSON."""
    whole = found.chain.to_parameters()
    # JSON has no infinity: what is not known is as large as can be.
    largest = sys.float_info.max
    figures = found.figures._asdict()
    return {
        'parameters': {name: whole[name] for name in SEARCHED},
        'cost_ms': found.cost_ms,
        'error_ms': min(found.error_ms, largest),
        'figures': {**figures, 'median_ms': min(figures['median_ms'], largest)},
    }
