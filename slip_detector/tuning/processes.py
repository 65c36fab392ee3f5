"""A search in several processes, to which a first Ctrl-C is a wish to stop."""

import contextlib
import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from slip_detector.tuning.problem import Problem
from slip_detector.tuning.search import search

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: How often the progress is looked at while other processes search.
LOOK_S = 0.2


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
        As :func:`search` has them; this process only waits.
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
