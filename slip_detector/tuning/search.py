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

"""A search, one batch of trials after another.

A search asks the study for a batch of trials and tells it their results when all are done, in the
order in which it asked for them. So the result of a search depends neither on the number of
processes that work on a batch nor on the order in which they finish.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from slip_detector.tuning.objective import Candidate
from slip_detector.tuning.problem import Problem, searched

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: Number of trials in a batch, which is the largest number of processes that are useful.
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
    """Try chains until the study has a number of trials.

    Parameters
    ----------
    problem
        The problem of the search.
    study
        The study that the trials belong to.
    trials
        Number of trials that the study is to reach, including other searches and earlier runs.
    stop
        Returns whether to stop; called after each trial.
    progress
        Called with the number of trials so far, after each trial and each batch.
    results
        Yields the index of each of some points and the candidates there, see
        :meth:`.problem.Problem.candidates_at`, in any order. None: this process finds them.

    Raises
    ------
    ValueError
        When the storage fails; names it.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.parameters import ChainConfig, EvaluationConfig, TuneConfig
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> volts += 0.01 * np.random.default_rng(0).standard_normal(760)
    >>> rows = LabelledRows(np.tile(volts, (16, 1)).T, truth=slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> problem = Problem([track], ChainConfig(), None, EvaluationConfig(), TuneConfig())
    >>> study = problem.study(None, problem.study_name(), seed=0)
    >>> search(problem, study, trials=2, stop=lambda: False, progress=lambda count: None)
    >>> study.follow(), problem.choice(study) is not None
    (2, True)
    """
    if results is None:
        objective = problem.objective()

        def results(points: Sequence[Point]) -> Iterator[tuple[int, list[Candidate]]]:
            for place, point in enumerate(points):
                yield place, problem.candidates_at(objective, point)

    starts = problem.space.starts()
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
    """Return the entry of a chain in a study, in types of JSON."""
    return {
        'parameters': searched(found.chain),
        'cost_ms': found.cost_ms,
        # JSON has no infinity; the largest float takes its place.
        'error_ms': min(found.error_ms, sys.float_info.max),
        'figures': found.figures._asdict(),
    }
