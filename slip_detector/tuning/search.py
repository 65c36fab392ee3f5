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

"""A search, one batch of trials after another, and its verdict: what command and live page call.

A search asks the study for a batch of trials and tells it their results when all are done, in the
order in which it asked for them. So the result of a search depends neither on the number of
processes that work on a batch nor on the order in which they finish.
"""

import contextlib
import dataclasses
import importlib.util
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem, Verdict, judge, searched
from slip_detector.tuning.tracks import Track, TrainingFiles

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: Number of trials in a batch, which is the largest number of processes that are useful.
BATCH = 8

NEEDS_OPTUNA = "needs optuna, which is not installed: pip install 'slip_detector[tune]'"

Point = dict[str, Any]

#: Yields the index of each of some points and the candidates there, in any order.
Results = Callable[[Sequence[Point]], Iterator[tuple[int, list[Candidate]]]]

#: Calls a function with each of some points, maybe in other processes; yields as ``Results`` does.
Calls = Callable[
    [Callable[[Point], list[Candidate]], Sequence[Point]], Iterator[tuple[int, list[Candidate]]]
]


class TuningParameters(NamedTuple):
    """The sets of parameters that tuning needs.

    Examples
    --------
    >>> TuningParameters().chain.threshold
    0.5
    """

    chain: ChainConfig = ChainConfig()
    recording: RecordingConfig = RecordingConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    tune: TuneConfig = TuneConfig()

    @property
    def loader(self) -> RecordingLoader:
        """Opens recordings for the chain."""
        return RecordingLoader(self.chain, self.recording, self.evaluation)


def tuning_parameters_of(file: str | None) -> TuningParameters:
    """Read the sets of parameters from a file; without a file return the defaults.

    Raises
    ------
    ValueError
        When the file cannot be read or has a value that is not allowed; names it.

    Examples
    --------
    >>> tuning_parameters_of(None).tune.missed_costs_ms
    500.0
    """
    if file is None:
        return TuningParameters()
    return TuningParameters(
        ChainConfig.from_yaml(file),
        RecordingConfig.from_yaml(file),
        EvaluationConfig.from_yaml(file),
        TuneConfig.from_yaml(file),
    )


class TuningResult(NamedTuple):
    """What a search has found.

    Attributes
    ----------
    problem : Problem
        With the recordings that were tuned on.
    held : list of Track
        The held-out recordings.
    study : Study
        With all trials.
    verdict : Verdict
        The best chain found, or the given one.
    notes : list of str
        A line for each recording with faults, and one where Ctrl-C ended the search.
    """

    problem: Problem
    held: list[Track]
    study: Any
    verdict: Verdict
    notes: list[str]


def tune(
    files: TrainingFiles,
    parameters: TuningParameters,
    trials: int,
    *,
    seed: int = 0,
    storage: str | None = None,
    progress: Callable[[int, Candidate | None], None] = lambda count, best: None,
    calls: Calls | None = None,
) -> TuningResult:
    """Search for a better chain, and judge the best one on the held-out recordings.

    Once the recordings are read, the first Ctrl-C ends the search with the result so far.

    Parameters
    ----------
    files
        The recordings to tune on and to hold out.
    parameters
        The chain that is tuned, and how.
    trials
        Number of trials that the study is to reach, including other searches and earlier runs.
    seed
        Seed of the search.
    storage
        The storage of the study, see :class:`.study.Study`; None: in memory.
    progress
        Called with the number of trials so far and the best chain of them, before the first trial,
        and after each trial and each batch.
    calls
        Makes the calls for the points of a batch. None: they are made in this process.

    Raises
    ------
    ValueError
        When a recording cannot be read, there are too few slips, a held-out recording is also
        tuned on, or the storage fails; names what is wrong.
    """
    if importlib.util.find_spec('optuna') is None:
        raise ValueError(NEEDS_OPTUNA)
    training, held, notes = files.load_and_check()
    with _first_interrupt_noted() as stop:
        problem = Problem(training, parameters.chain, None, parameters.evaluation, parameters.tune)
        if not parameters.tune.trade:
            before = problem.objective().as_it_is(problem.given)
            problem = dataclasses.replace(problem, figures=before.figures)
        study = problem.study(storage, problem.study_name(), seed)
        results = calls and partial(calls, FileObjective(files, problem).candidates)

        def show(count: int) -> None:
            progress(count, problem.best(study))

        show(study.follow())
        search(problem, study, trials, stop.is_set, show, results)
    if stop.is_set():
        notes.append('Stopped early.')
    return TuningResult(problem, held, study, judge(problem, held, problem.choice(study)), notes)


@contextlib.contextmanager
def _first_interrupt_noted() -> Iterator[threading.Event]:
    """Within this context the first SIGINT only sets an event; the second one interrupts."""
    stop = threading.Event()

    def note(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        sys.stderr.write('\nstopping; results so far are kept (Ctrl-C again: end at once)\n')

    before = signal.signal(signal.SIGINT, note)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def search(
    problem: Problem,
    study: 'Study',
    trials: int,
    stop: Callable[[], bool],
    progress: Callable[[int], None],
    results: Results | None = None,
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
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> volts += 0.01 * np.random.default_rng(0).standard_normal(760)
    >>> rows = Samples.evenly(np.tile(volts, (16, 1)).T, 380.0, slip)
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


#: The last objective of this process and the name of its problem, for the next trial.
_last: tuple[str, tuple[Problem, Objective] | None] = ('', None)

#: A worker of a cluster may call from several threads; an objective works for one at a time.
_one_at_a_time = threading.Lock()


class FileObjective:
    """The objective of a problem whose recordings are read by the process that needs them.

    It has a few kilobytes when it is sent to another process, as it contains no rows.

    Parameters
    ----------
    files
        The recordings, whose paths must be the same for every process.
    problem
        The problem, with the tracks that were read from these files.
    """

    def __init__(self, files: TrainingFiles, problem: Problem) -> None:
        self._files, self._name = files, problem.study_name()
        self._problem = dataclasses.replace(problem, tracks=[])

    def candidates(self, point: dict[str, Any]) -> list[Candidate]:
        """Return the candidates at a point; see :meth:`.problem.Problem.candidates_at`.

        Raises
        ------
        ValueError
            When the recordings cannot be read or are not those of the problem.
        """
        with _one_at_a_time:
            problem, objective = self._loaded()
            return problem.candidates_at(objective, point)

    def _loaded(self) -> tuple[Problem, Objective]:
        global _last  # noqa: PLW0603
        name, loaded = _last
        if loaded is None or name != self._name:
            _last = ('', None)  # there may not be enough memory for two
            problem = dataclasses.replace(self._problem, tracks=self._files.load()[0])
            if problem.study_name() != self._name:
                raise ValueError(
                    f'{", ".join(self._files.paths)}: a worker finds other recordings there, '
                    'allowed: paths that are the same for all workers'
                )
            loaded = problem, problem.objective()
            _last = (self._name, loaded)
        return loaded
