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

"""Calls one function with many arguments: in this process, in several or on a Dask cluster."""

import gc
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
)
from types import TracebackType
from typing import Any, TypeVar

#: The calls are given up when worker processes have died this number of times in a row without a
#: result. Dask has a limit of its own for each call, ``allowed-failures``, which is 3 as well.
MOST_DEATHS = 3

#: Longest time in which a scheduler may answer.
CONNECT_TIMEOUT_S = 10.0

#: Loggers on which Dask puts a traceback when a call is cancelled or the connection closes while
#: something is on its way.
LOGS_OF_LEAVING = ('tornado.application', 'distributed.batched', 'distributed.client')

NEEDS_DISTRIBUTED = (
    "--cluster needs distributed, which is not installed: pip install 'slip_detector[cluster]'"
)

Argument = TypeVar('Argument')
Result = TypeVar('Result')


class Workers:
    """Calls a function with many arguments.

    It is a context manager: processes or connection are opened when the context is entered and
    closed when it is left; calls that still run then are given up. Another worker repeats the
    calls of a worker that dies.

    Parameters
    ----------
    jobs
        Number of processes on this machine; with one, the calls are made in this process.
    cluster
        Address of the scheduler of a Dask cluster, which is used instead of such processes.

    Raises
    ------
    ValueError
        On entering the context, when the cluster cannot be reached; names it.

    Examples
    --------
    >>> with Workers(jobs=1) as workers:
    ...     dict(workers.results(abs, [3, -4]))
    {0: 3, 1: 4}
    """

    def __init__(self, jobs: int = 1, cluster: str | None = None) -> None:
        self._jobs, self._cluster = jobs, cluster
        self._executor: Executor | None = None
        self._given_up: tuple[type[BaseException], ...] = ()
        self._children_before = multiprocessing.active_children()

    @property
    def here(self) -> bool:
        """Whether the calls are made in this process."""
        return self._jobs == 1 and self._cluster is None

    def __enter__(self) -> 'Workers':
        if self._cluster is not None:
            self._connect(self._cluster)
        elif self._jobs > 1:
            self._executor = _processes(self._jobs)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._executor is None:
            return
        if self._cluster is not None:
            self._executor.shutdown(wait=False)
            self._client.close()
            return
        results: Any = self._executor._result_queue  # type: ignore[attr-defined]
        self._executor.shutdown(wait=False, cancel_futures=True)
        # A process that is terminated while it writes its result leaves a part of it in the pipe.
        # The executor's thread, which the interpreter joins at exit, waits for the rest until no
        # process has the pipe open for writing: therefore this process closes its end.
        results._writer.close()
        children = multiprocessing.active_children()
        own = [child for child in children if child not in self._children_before]
        for process in own:
            process.terminate()
        for process in own:
            process.join()

    def results(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> Iterator[tuple[int, Result]]:
        """Yield the index of each argument and the result of its call, as the calls end.

        Parameters
        ----------
        function
            The function to call. It, its arguments and its results must be picklable unless the
            calls are made in this process.
        arguments
            One for each call.

        Raises
        ------
        ValueError
            When the function raises one, processes keep dying or the cluster is lost.
        """
        if self._executor is None:
            for place, argument in enumerate(arguments):
                yield place, function(argument)
            return
        left, deaths = dict(enumerate(arguments)), 0
        while left:
            calls = self._submit(function, left)
            for call in as_completed(calls):
                try:
                    result = call.result()
                except BrokenExecutor:  # a process has died, and these calls with it
                    continue
                except CancelledError:
                    raise ValueError(f'cluster {self._cluster}: was lost') from None
                except self._given_up as error:
                    raise ValueError(f'cluster {self._cluster}: {error}') from None
                deaths = 0
                del left[calls[call]]
                yield calls[call], result
            if left:
                deaths += 1
                if deaths == MOST_DEATHS:
                    raise ValueError(
                        f'worker processes died {deaths} times before any had a result, allowed: '
                        f'fewer --jobs than {self._jobs} where memory is short'
                    )
                self._executor = _processes(self._jobs)

    def _submit(
        self, function: Callable[[Argument], Result], left: dict[int, Argument]
    ) -> dict['Future[Result]', int]:
        assert self._executor is not None
        calls = {}
        # Ctrl-C goes to all processes of a terminal, but only this one is to react. A signal that
        # is blocked while the others start stays blocked in them; here it is only delayed.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for place, argument in left.items():
                calls[self._executor.submit(_call, function, argument)] = place
        except BrokenExecutor:  # the remaining arguments are left for the next processes
            pass
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        return calls

    def _connect(self, address: str) -> None:
        try:
            from distributed import Client
            from distributed.scheduler import KilledWorker
        except ImportError:
            raise ValueError(NEEDS_DISTRIBUTED) from None
        try:
            self._client: Any = Client(address, timeout=CONNECT_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise ValueError(f'cluster {address}: cannot be reached ({error})') from None
        # After Ctrl-C both are expected, and a lost cluster is reported as an error.
        for name in LOGS_OF_LEAVING:
            logging.getLogger(name).addFilter(_is_unexpected)
        self._executor = self._client.get_executor(pure=False)
        # The call killed its workers, or a worker lacks this package.
        self._given_up = (KilledWorker, ImportError)


def _is_unexpected(record: logging.LogRecord) -> bool:
    import asyncio  # Dask has loaded it; where there is no Dask, starting is faster without it

    expected = (CancelledError, asyncio.CancelledError, OSError)
    return not (record.exc_info and isinstance(record.exc_info[1], expected))


def _processes(jobs: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(jobs, multiprocessing.get_context('spawn'), initializer=_begin)


def _begin() -> None:
    # Garbage collection while the first call loads its modules would take a third of the
    # start-up time.
    gc.disable()
    _end_with_parent()


def _call(function: Callable[[Argument], Result], argument: Argument) -> Result:
    try:
        return function(argument)
    finally:
        gc.enable()


def _end_with_parent() -> None:
    """End this process as soon as the one that started it has ended for any reason."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
