"""A search: trial after trial of a study.

Trials are asked for in batches, and a batch is told to the study when all of it is done, in the
order in which it was asked for. So what a search finds does not depend on how many processes
work on a batch, nor on which of them is first.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from slip_detector.tuning.objective import Candidate
from slip_detector.tuning.problem import SEARCHED, Problem
from slip_detector.tuning.space import SearchSpace

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: Trials that are asked for at once: as many processes have something to do.
BATCH = 8

Point = dict[str, Any]


def search(
    problem: Problem,
    study: 'Study',
    trials: int,
    stop: Callable[[], bool],
    progress: Callable[[int], None],
    results: Callable[[Sequence[Point]], Iterator[tuple[int, list[Candidate]]]] | None = None,
) -> None:
    """Try chains until the study has so many trials.

    Parameters
    ----------
    problem
        What is searched.
    study
        To take part in.
    trials
        How many the study is to have, those of other searches and of earlier runs counted.
    stop
        Asked after each trial.
    progress
        Told how many there are after each, and after each batch.
    results
        Yields the candidates at each of some points, see :meth:`.problem.Problem.candidates_at`,
        with the place of the point, in any order. If not given, they are found in this process.

    Raises
    ------
    ValueError
        When the storage fails; names it.
    """
    space = SearchSpace(problem.given)
    if results is None:
        objective = problem.objective()

        def results(points: Sequence[Point]) -> Iterator[tuple[int, list[Candidate]]]:
            for place, point in enumerate(points):
                yield place, problem.candidates_at(objective, point)

    starts = space.starts()
    count = study.follow()
    while not stop() and count < trials:
        batch = [
            study.ask(starts[k] if k < len(starts) else None)
            for k in range(count, min(count + BATCH, trials))
        ]
        found = {}
        for place, candidates in results([trial.params for trial in batch]):
            found[place] = candidates
            progress(count + len(found))
            if stop():
                break
        for place, candidates in sorted(found.items()):
            cost_ms = candidates[0].cost_ms if candidates else None
            study.tell(batch[place], cost_ms, {'found': list(map(_kept, candidates))})
        count = study.follow()
        progress(count)


def _kept(found: Candidate) -> dict[str, Any]:
    """Return what a study stores of a chain, in types of JSON."""
    whole = found.chain.to_parameters()
    # JSON has no infinity; the largest float takes its place.
    largest = sys.float_info.max
    figures = found.figures._asdict()
    return {
        'parameters': {name: whole[name] for name in SEARCHED},
        'cost_ms': found.cost_ms,
        'error_ms': min(found.error_ms, largest),
        'figures': {**figures, 'median_ms': min(figures['median_ms'], largest)},
    }
