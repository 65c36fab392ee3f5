"""Searches in one process or in several, to which a first Ctrl-C is a wish to stop."""

import contextlib
import dataclasses
import math
import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.search import Candidate, CandidateFigures, Objective, Space
from slip_detector.tuning.tracks import Track

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: How often the progress is looked at while other processes search.
LOOK_S = 0.2

#: What of a chain a trial may change, and keeps.
SEARCHED = (
    'common_mode', 'passband_hz', 'stopbands_hz', 'exponent', 'envelope_window_s',
    'decision_window_s', 'threshold', 'vote',
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Problem:
    """What is searched.

    Attributes
    ----------
    tracks : list of Track
        To tune on.
    given : ChainConfig
        What is tuned.
    figures : CandidateFigures or None
        What must not get worse.
    evaluation : EvaluationConfig
        What counts as detected.
    config : TuneConfig
        The weights.
    """

    tracks: list[Track]
    given: ChainConfig
    figures: CandidateFigures | None
    evaluation: EvaluationConfig
    config: TuneConfig

    def study(self, where: str | None, name: str, seed: int) -> 'Study':
        """Open the study of this problem; see :class:`slip_detector.tuning.study.Study`."""
        from slip_detector.tuning.study import Study

        return Study(where, name, Space(self.given).distributions(), seed)

    def found(self, trial: Any) -> list[Candidate]:
        """Return what a finished trial of the study found, a vote each, the cheapest first."""
        return [
            Candidate(
                dataclasses.replace(self.given, **noted['parameters']),
                noted['cost_ms'],
                noted['error_ms'],
                CandidateFigures(**noted['figures']),
            )
            for noted in trial.user_attrs['found']
        ]

    def best(self, study: 'Study') -> Candidate | None:
        """Return the cheapest of all; None where no trial found any."""
        found = [self.found(trial)[0] for trial in study.trials]
        return min(found, key=lambda one: one.cost_ms, default=None)

    def choice(self, study: 'Study') -> Candidate | None:
        """Return what to hand back: of what is as good as the best, the nearest to the given.

        As good is what costs no more than the best and its error: the fewer slips there are, the
        less a search among many chains can tell the good from the lucky, and the closer it stays
        to what was given.
        """
        best = self.best(study)
        if best is None:
            return None
        space = Space(self.given)
        given = space.point(self.given)
        nearest, choice = math.inf, best
        for trial in study.trials:
            away = space.distance(trial.params, given)
            for found in self.found(trial):
                if found.cost_ms > best.cost_ms + best.error_ms or self._worse(found, best):
                    continue
                distance = math.hypot(away, found.chain.vote != self.given.vote)
                if distance < nearest:
                    nearest, choice = distance, found
        return choice

    def _worse(self, found: Candidate, best: Candidate) -> bool:
        """Return whether a chain is worse than the given one in what the best is not."""
        if self.figures is None:
            return False
        return len(found.figures.worse_than(self.figures)) > len(
            best.figures.worse_than(self.figures)
        )


class Stopper:
    """Notes a first SIGINT, and lets a second one through."""

    def __init__(self) -> None:
        self.stopped = False

    def __call__(self) -> bool:
        """Return whether to stop."""
        return self.stopped

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Take SIGINT as a wish to stop."""
        before = signal.signal(signal.SIGINT, self._noted)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _noted(self, number: int, frame: Any) -> None:
        if self.stopped:
            raise KeyboardInterrupt
        self.stopped = True
        sys.stderr.write('\nstopping; what was found is kept (once more: end at once)\n')


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
    space = Space(problem.given)
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


def search_in_processes(
    problem: Problem,
    where: str,
    name: str,
    trials: int,
    jobs: int,
    seed: int,
    study: 'Study',
    stop: Callable[[], bool],
    progress: Callable[[int], None],
) -> None:
    """Let several processes take part in a study, until it has so many trials.

    Parameters
    ----------
    problem, trials, study, stop, progress
        As :func:`search` has them; this process only looks on.
    where, name
        The study's.
    jobs
        How many processes.
    seed
        Of the first one's sampler; the next have the next.

    Raises
    ------
    ValueError
        When the storage fails or a process ends early.
    """
    context = multiprocessing.get_context('spawn')
    stopping, errors = context.Event(), context.SimpleQueue()
    # Ctrl-C goes to all processes of a terminal. This one alone is to hear it: what is blocked as
    # the others start stays so for them, and comes here later.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    processes = [
        context.Process(
            target=_take_part, args=(problem, where, name, trials, seed + k, stopping, errors),
            daemon=True,
        )
        for k in range(jobs)
    ]  # fmt: skip
    try:
        for process in processes:
            process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        while any(process.is_alive() for process in processes):
            if stop():
                stopping.set()
            for process in processes:
                process.join(LOOK_S / jobs)
            progress(study.follow())
    finally:
        for process in processes:
            process.terminate()
    if not errors.empty():
        raise ValueError(errors.get())
    for process in processes:
        if process.exitcode:
            raise ValueError(
                f'a worker process ended with exit code {process.exitcode}; what was found is '
                'kept, and the same command goes on from there'
            )


def _take_part(
    problem: Problem, where: str, name: str, trials: int, seed: int, stopping: Any, errors: Any
) -> None:
    """Search in a process of its own; what goes wrong is said by the one that started it."""
    parent = multiprocessing.parent_process()

    def stop() -> bool:
        return bool(stopping.is_set()) or not (parent is None or parent.is_alive())

    try:
        study = problem.study(where, name, seed)
        search(problem, study, trials, stop, lambda count: None)
    except ValueError as error:
        errors.put(str(error))
