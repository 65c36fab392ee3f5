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

"""A search, one batch of trials after another, and the study that keeps them.

A search asks the study for a batch of trials and stores their results when all are done, in the
order in which it asked for them. So the result of a search depends neither on the number of
processes that work on a batch nor on the order in which they finish.

A worker asks a copy of the study in memory for its next trial, and writes the finished trial to
one of Optuna's storages in one piece. That is about ten times faster than writing each parameter,
and a worker that is killed leaves no unfinished trial. Workers read each other's trials before the
next one.
"""

import contextlib
import dataclasses
import fcntl
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.parameters import check_plain
from slip_detector.tuning.problem import Candidate, Problem, searched_parameters
from slip_detector.tuning.space import SearchSpace

#: Number of trials in a batch, which is the largest number of processes that are useful.
BATCH = 8

#: How often each stage is tried on the best chain so far.
ROUNDS = 2

#: Errors of a journal that is damaged. A plain ValueError refuses something in words.
DAMAGE = ValueError, LookupError, TypeError, AttributeError, AssertionError, RecursionError

Point = dict[str, Any]

#: Calls a function with each of some points, maybe in other processes; yields the index of each
#: point and the candidate there, in any order.
Calls = Callable[..., Iterator[tuple[int, Candidate | None]]]


class Trial(NamedTuple):
    """A point that was tried, and the cheapest chain there."""

    point: Point
    candidate: Candidate


def search(
    study: 'Study',
    trials: int,
    stop: Callable[[], bool] = lambda: False,
    progress: Callable[[int], None] = lambda count: None,
    results: Calls | None = None,
) -> None:
    """Try chains until the study has a number of trials.

    Parameters
    ----------
    study
        The study that the trials belong to.
    trials
        Number of trials that the study is to reach, including other searches and earlier runs.
    stop
        Returns whether to stop; called after each trial.
    progress
        Called with the number of trials so far, after each trial and each batch.
    results
        Yields the index of each of some points and the candidate there, see
        :func:`candidate_at`, in any order. None: this process finds them.

    Raises
    ------
    ValueError
        When the storage fails; names it.
    """
    results = results or (lambda points: enumerate(map(study.candidate_at, points)))

    def attempt(points: Sequence[Point]) -> bool:
        """Try points that were not tried yet; return whether the search goes on."""
        fresh = [point for k, point in enumerate(points) if point not in points[:k]]
        fresh = [point for point in fresh if not study.has(point)]
        for first in range(0, len(fresh), BATCH):
            count = study.follow()
            batch, found = fresh[first : first + BATCH][: max(trials - count, 0)], {}
            for place, candidate in results(batch) if batch and not stop() else ():
                found[place] = candidate
                progress(count + len(found))
                if stop():
                    break
            for place, candidate in sorted(found.items()):
                study.tell(batch[place], candidate)
        count = study.follow()
        progress(count)
        return count < trials and not stop()

    starts = study.space.starts()
    going = attempt(starts)
    best = min(starts, key=study.cost_ms)
    bands, *stages = study.space.stages() if going else [[]]
    # The bands on the given chain; on the best of these each stage alone; then one after another,
    # each on the best so far, more than once, as one stage changes what another can do.
    points = [best, *({**starts[1], **change} for change in bands)]
    going = going and attempt(points)
    best = min(points, key=study.cost_ms)
    for stage in stages:
        going = going and attempt([{**best, **change} for change in stage])
    for stage in ROUNDS * [*stages, bands]:
        points = [best, *({**best, **change} for change in stage)]
        going = going and attempt(points)
        best = min(points, key=study.cost_ms)
    while going:
        going = attempt([study.ask() for _ in range(min(BATCH, trials - study.follow()))])


def candidate_at(problem: Problem, space: SearchSpace, point: Point) -> Candidate | None:
    """Return the cheapest chain at a point of the space, if there is any."""
    try:
        return problem.best(space.chain(point))
    except ValueError:  # no such filter, or no noise
        return None


class Study:
    """Trials that several workers share.

    Parameters
    ----------
    problem
        The problem of the search; each has a study of its own in a storage.
    seed
        Seed of the sampler, different for each worker of a study.
    storage
        The URL of a database (``sqlite:///study.db``, ``postgresql://user@host/study``), or the
        path of a journal, which is made if it does not exist. None: the memory of this process.

    Attributes
    ----------
    trials : list of Trial
        All trials that found a chain, as far as this worker has read them.
    space : SearchSpace
        The space that is searched.
    candidate_at : callable
        Returns the candidate at a point, see :func:`candidate_at`. It may be pickled.

    Raises
    ------
    ValueError
        When the storage cannot be opened, or the last line of a journal is cut off; names it.
    """

    def __init__(self, problem: Problem, seed: int, storage: str | None = None) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self.problem, self._where = problem, storage
        self.space = SearchSpace(problem.origin, problem.tracks)
        self.candidate_at = functools.partial(candidate_at, problem, self.space)
        # Points of a batch keep away from each other; parameters are drawn together.
        sampler = optuna.samplers.TPESampler(
            seed=seed, n_startup_trials=0, constant_liar=True, multivariate=True
        )
        self._copy = optuna.create_study(sampler=sampler)
        self._asked, self._read, self.trials = list[Any](), 0, list[Trial]()
        self._costs_ms: dict[frozenset[Any], float] = {}
        with self._errors_in_one_line():
            name, opened = problem.study_name(), storage and _open_storage(storage)
            self._shared = optuna.create_study(
                storage=opened, study_name=name, load_if_exists=True
            )
        self.follow()

    @contextlib.contextmanager
    def _errors_in_one_line(self) -> Iterator[None]:
        """Turn the errors of all kinds of storages into one line that names the storage."""
        try:
            yield
        # Drivers have errors of their own; a journal may hold anything.
        except Exception as error:
            cause = error.__cause__ or error
            text = str(getattr(cause, 'strerror', None) or cause).strip().split('\n')[0]
            if isinstance(cause, DAMAGE) and type(cause) is not ValueError:
                text = f'is damaged ({type(cause).__name__}: {text})'
            raise ValueError(f'storage {self._where}: {text or type(cause).__name__}') from None

    def follow(self) -> int:
        """Read the new trials of all workers; return the number of all trials."""
        from optuna.trial import TrialState

        with self._errors_in_one_line():
            fresh = self._shared.get_trials(deepcopy=False)[self._read :]
            self._copy.add_trials(fresh)
            for trial in fresh:
                cost_ms = math.inf if trial.value is None else trial.value
                self._costs_ms.setdefault(frozenset(trial.params.items()), cost_ms)
                if trial.value is not None:
                    kept = trial.user_attrs
                    chain = dataclasses.replace(self.problem.origin, **kept['parameters'])
                    candidate = Candidate(chain, trial.value, kept['figures'])
                    self.trials.append(Trial(trial.params, candidate))
        # What was asked for is among them; until now the sampler kept away from these points.
        while self._asked:
            self._copy.tell(self._asked.pop(), state=TrialState.FAIL)
        self._read += len(fresh)
        return self._read

    def has(self, point: Point) -> bool:
        """Return whether a point was tried."""
        return frozenset(point.items()) in self._costs_ms

    def cost_ms(self, point: Point) -> float:
        """Return what the chain at a point costs; infinite where there is none or none tried."""
        return self._costs_ms.get(frozenset(point.items()), math.inf)

    def ask(self) -> Point:
        """Return the next point to try."""
        self._asked.append(self._copy.ask(self.space.distributions))
        return dict(self._asked[-1].params)

    def tell(self, point: Point, found: Candidate | None) -> None:
        """Store the candidate at a point, if there is one."""
        from optuna.trial import TrialState, create_trial

        kept = found and {'parameters': searched_parameters(found.chain), 'figures': found.figures}
        trial = create_trial(
            state=TrialState.COMPLETE if found else TrialState.FAIL,
            value=found and found.cost_ms,
            params=point,
            distributions=self.space.distributions,
            user_attrs=kept,
        )
        with self._errors_in_one_line():
            self._shared.add_trial(trial)

    @property
    def cheapest(self) -> Candidate | None:
        """The chain that costs least, if there is any."""
        candidates = [trial.candidate for trial in self.trials]
        return min(candidates, key=lambda candidate: candidate.cost_ms, default=None)


def _open_storage(storage: str) -> Any:
    """Open one of Optuna's storages; refuse a journal that ends with half a line.

    A full disk or a killed process leaves that. Optuna would append the next entry to it, and
    could then not read the file any more.
    """
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    check_plain(storage.removeprefix('sqlite:///'))
    if '://' in storage:  # the URL of a database
        return storage
    lock: Any = _JournalLock(storage)
    journal = JournalStorage(JournalFileBackend(storage, lock))
    lines = Path(storage).read_bytes().splitlines(keepends=True)
    if lines and not lines[-1].endswith(b'\n'):
        raise ValueError(f'line {len(lines)} is cut off, allowed: whole lines, as those before it')
    return journal


class _JournalLock:
    """Held while an entry is written; the system releases it when its process ends or is killed.

    Optuna's own lock is a file that a killed process leaves. The next one then waits for half a
    minute, or for ever where the path is relative, without a word.
    """

    def __init__(self, path: str) -> None:
        self._path = path

    def acquire(self) -> bool:
        """Wait until no other process holds it."""
        self._file = open(self._path, 'ab')  # noqa: SIM115, release closes it
        fcntl.flock(self._file, fcntl.LOCK_EX)
        return True

    def release(self) -> None:
        """Let other processes write."""
        self._file.close()
