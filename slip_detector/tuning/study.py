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

"""The study of a search: the trials of all its workers, in one of Optuna's storages.

A worker asks a copy of the study in memory for its next trial, and writes the finished trial to
the storage in one piece. That is about ten times faster than writing each parameter, and a worker
that is killed leaves no unfinished trial. Workers read each other's trials before the next one.
"""

import contextlib
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import optuna
from optuna.storages.journal import JournalFileSymlinkLock
from optuna.trial import FrozenTrial, TrialState

#: Number of trials at random points before the sampler learns from results.
STARTUP_TRIALS = 12

#: File endings of journals. A storage with ``://`` is the URL of a database.
JOURNALS = ('.journal', '.log', '.jsonl')


def open_storage(where: str) -> Any:
    """Open one of Optuna's storages.

    Parameters
    ----------
    where
        The URL of a database (``sqlite:///study.db``, ``postgresql://user@host/study``), or the
        path of a journal, which is made if it does not exist.

    Raises
    ------
    ValueError
        When it is neither or cannot be opened, or the last line of a journal is incomplete;
        names it.

    Examples
    --------
    >>> open_storage('study.txt')
    Traceback (most recent call last):
    ValueError: storage study.txt: is not known, allowed: a path that ends in .journal, ...
    """
    from optuna.storages import JournalStorage, RDBStorage
    from optuna.storages.journal import JournalFileBackend

    if '://' not in where and Path(where).suffix not in JOURNALS:
        raise ValueError(
            f'storage {where}: is not known, allowed: a path that ends in {", ".join(JOURNALS)}, '
            'or a URL such as sqlite:///study.db or postgresql://user@host/study'
        )
    with _in_one_line(where):
        if '://' in where:
            return RDBStorage(where)
        storage = JournalStorage(JournalFileBackend(where))
        _check_last_line(Path(where))
        return storage


def _check_last_line(journal: Path) -> None:
    """Refuse a journal that a full disk or a killed process has left with half a line.

    Optuna would append the next entry to it, and could then not read the file any more.
    """
    # Optuna takes this lock to append: a line that is being written is no half line.
    lock = JournalFileSymlinkLock(str(journal))
    lock.acquire()
    try:
        lines = journal.read_bytes().splitlines(keepends=True)
    finally:
        lock.release()
    if lines and not lines[-1].endswith(b'\n'):
        raise ValueError(
            f'line {len(lines)} was cut off after {len(lines[-1])} bytes, allowed: whole lines '
            '(without this line it has the trials before it)'
        )


@contextlib.contextmanager
def _in_one_line(where: str) -> Iterator[None]:
    """Turn the errors of all kinds of storages into one line that names the storage."""
    try:
        yield
    except Exception as error:  # Drivers have errors of their own; a journal may hold anything.
        raise ValueError(f'storage {where}: {_first_line(error)}') from None


def _first_line(error: BaseException) -> str:
    cause = error.__cause__ if error.__cause__ is not None else error
    text = getattr(cause, 'strerror', None) or str(cause)
    return str(text).strip().split('\n')[0] or type(cause).__name__


class Study:
    """Trials that several workers share.

    Parameters
    ----------
    where
        The storage; see :func:`open_storage`. None: in the memory of this process only.
    name
        Name of the study in its storage; each problem needs a name of its own.
    distributions
        The distributions of the search space, by name.
    seed
        Seed of the sampler, different for each worker of a study.

    Raises
    ------
    ValueError
        When the storage cannot be opened; names it.

    Examples
    --------
    >>> x = optuna.distributions.FloatDistribution(0.0, 1.0)
    >>> study = Study(None, 'example', {'x': x}, seed=0)
    >>> study.tell(study.ask({'x': 0.5}), cost=3.0, found={})
    >>> [(trial.params, trial.value) for trial in study.trials]
    [({'x': 0.5}, 3.0)]
    """

    def __init__(
        self, where: str | None, name: str, distributions: dict[str, Any], seed: int
    ) -> None:
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._distributions, self._where = distributions, where or 'memory'
        self._worker = uuid.uuid4().hex
        sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=STARTUP_TRIALS)
        self._mine = optuna.create_study(sampler=sampler)
        self._shared, self._followed = None, 0
        if where is not None:
            storage = open_storage(where)
            with _in_one_line(where):
                self._shared = optuna.create_study(
                    storage=storage, study_name=name, load_if_exists=True
                )
        self.follow()

    def follow(self) -> int:
        """Read the trials of other workers; return the number of all trials."""
        if self._shared is None:
            return sum(trial.state.is_finished() for trial in self._mine.get_trials(False))
        with _in_one_line(self._where):
            trials = self._shared.get_trials(deepcopy=False)
            for trial in trials[self._followed :]:
                if trial.user_attrs.get('worker') != self._worker:
                    self._mine.add_trial(trial)
        self._followed = len(trials)
        return self._followed

    def ask(self, point: dict[str, Any] | None = None) -> 'optuna.Trial':
        """Return the next trial, or one at a given point of the space."""
        if point is not None:
            self._mine.enqueue_trial(point)
        return self._mine.ask(self._distributions)

    def tell(self, trial: 'optuna.Trial', cost: float | None, found: dict[str, Any]) -> None:
        """Store the result of a trial; its cost is None where the point has no chain."""
        for key, value in {**found, 'worker': self._worker}.items():
            trial.set_user_attr(key, value)
        if cost is None:
            finished = self._mine.tell(trial, state=TrialState.FAIL)
        else:
            finished = self._mine.tell(trial, cost)
        if self._shared is not None:
            with _in_one_line(self._where):
                self._shared.add_trial(finished)

    @property
    def trials(self) -> list[FrozenTrial]:
        """All trials with a cost that this worker has read."""
        return self._mine.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
