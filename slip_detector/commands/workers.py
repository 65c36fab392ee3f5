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

"""What the commands share that read recordings: their options, the bar, and several processes."""

import argparse
import dataclasses
import logging
import multiprocessing
import os
import signal
import sys
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
from pathlib import Path
from typing import Any, TypeVar

from tqdm import tqdm

from slip_detector.commands.command_line import whole_number
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import recording_sets

#: Longest time in which a scheduler may answer.
CONNECT_TIMEOUT_S = 10.0

#: Logs of Dask, which put a traceback there for a call that is cancelled or a connection that
#: closes. This process says what went wrong itself.
LOGS = ('distributed', 'distributed.client', 'tornado.application')

NEEDS_DISTRIBUTED = (
    "--cluster needs distributed, which is not installed: pip install 'slip_detector[cluster]'"
)

#: The parameters of :class:`RecordingConfig` that are options, without ``recording_``.
READING = ('topic', 'field', 'labels', 'resample')

Argument = TypeVar('Argument')
Result = TypeVar('Result')


def add_options(parser: argparse.ArgumentParser, work: str) -> None:
    """Add the options on processes, which do some work, and on what is read of recordings.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_options(parser, 'search')
    >>> parser.parse_args(['--jobs', '4', '--topic', '/left/voltages']).jobs
    4
    """
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        '--jobs', type=whole_number(1), metavar='N', help=f'processes that {work} (default: 1)'
    )
    where.add_argument(
        '--cluster', metavar='ADDRESS',
        help=f'scheduler of a Dask cluster whose workers {work}, such as tcp://HOST:8786; they '
        'must see the recordings under the same paths',
    )  # fmt: skip
    group = parser.add_argument_group('what to read of a recording')
    for field in dataclasses.fields(RecordingConfig):
        name = field.name.removeprefix('recording_')
        if name in READING:
            action = 'store_true' if field.default is False else 'store'
            meaning = field.metadata['meaning'].replace('%', '%%')
            group.add_argument(f'--{name}', action=action, default=None, help=meaning)


def recording_config(config: RecordingConfig, options: argparse.Namespace) -> RecordingConfig:
    """Return the configuration with the values of the options, and paths that workers can open.

    Raises
    ------
    ValueError
        When a value is not allowed.

    Examples
    --------
    >>> options = argparse.Namespace(topic='/a', field=None, labels=None, resample=None)
    >>> options.cluster = None
    >>> recording_config(RecordingConfig(), options).recording_topic
    '/a'
    """
    given = {f'recording_{name}': getattr(options, name) for name in READING}
    changes = {name: value for name, value in given.items() if value is not None}
    config = dataclasses.replace(config, **changes)
    if not config.recording_labels:
        return config
    (labels,) = paths_for_workers(options, [config.recording_labels])
    return dataclasses.replace(config, recording_labels=labels)


def paths_for_workers(options: argparse.Namespace, paths: Sequence[str]) -> list[str]:
    """Return paths for the workers: absolute for a cluster, whose workers run in other folders.

    Examples
    --------
    >>> paths_for_workers(argparse.Namespace(cluster=None), ['trial.npz'])
    ['trial.npz']
    """
    return [os.path.abspath(path) for path in paths] if options.cluster else list(paths)


def paths_read(options: argparse.Namespace) -> list[Path]:
    """Return the recordings, and the file of labels, that a command reads.

    Raises
    ------
    ValueError
        For a folder without recordings.

    Examples
    --------
    >>> options = argparse.Namespace(recordings=['a.npz'], quiet='rest.npz', labels=None)
    >>> [path.name for path in paths_read(options)]
    ['a.npz', 'rest.npz']
    """
    given = [getattr(options, name, None) or [] for name in ('recordings', 'held_out')]
    given += [[path] for name in ('quiet', 'taps') if (path := getattr(options, name, None))]
    sets = [files for paths in given for files in recording_sets(paths).values()]
    labels = [Path(options.labels)] if options.labels else []
    return [*(file for files in sets for file in files), *labels]


def progress_bar(total: int, unit: str, done: int = 0) -> 'tqdm[Any]':
    """Return a progress bar on stderr; it is disabled where stderr is not a terminal.

    Examples
    --------
    >>> with progress_bar(total=200, unit='trial', done=50) as bar:
    ...     bar.n
    50
    """
    shown: Any = {'dynamic_ncols': True, 'mininterval': 0.0, 'file': sys.stderr}
    return tqdm(total=total, initial=done, unit=unit, disable=not sys.stderr.isatty(), **shown)


class Workers:
    """Calls a function with many arguments: here, in several processes or on a Dask cluster.

    It is a context manager: processes or connection are opened when the context is entered and
    closed when it is left; calls that still run then are given up.

    Parameters
    ----------
    jobs
        Number of processes on this machine; with one, the calls are made in this process.
    cluster
        Address of the scheduler of a Dask cluster, which is used instead of such processes. There
        another worker repeats the calls of one that dies.

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

    def __init__(self, jobs: int | None = None, cluster: str | None = None) -> None:
        self._jobs, self._cluster = jobs or 1, cluster
        self._executor: Executor | None = None

    @property
    def here(self) -> bool:
        """Whether the calls are made in this process."""
        return self._jobs == 1 and self._cluster is None

    def __enter__(self) -> 'Workers':
        if self._cluster is not None:
            self._client = _client_of(self._cluster)
            self._executor = self._client.get_executor(pure=False)
        elif not self.here:
            spawn = multiprocessing.get_context('spawn')
            self._executor = ProcessPoolExecutor(self._jobs, spawn, _end_with_parent)
        return self

    def __exit__(self, *error: object) -> None:
        if isinstance(self._executor, ProcessPoolExecutor):
            results: Any = self._executor._result_queue  # type: ignore[attr-defined]
            processes = list((self._executor._processes or {}).values())
            self._executor.shutdown(wait=False, cancel_futures=True)
            # A process that is ended while it writes its result leaves a part of it in the pipe;
            # the executor waits for the rest until nobody has the pipe open for writing.
            results._writer.close()
            for process in processes:
                process.kill()
                process.join()
        elif self._executor is not None:
            self._executor.shutdown(wait=False)
            self._client.close()

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
            When the function raises one, a process dies or the cluster is lost.
        """
        if self._executor is None:
            yield from enumerate(map(function, arguments))
            return
        try:
            calls = self._submit(function, arguments)
            for call in as_completed(calls):
                yield calls[call], call.result()
        except BrokenExecutor:
            raise ValueError(
                f'a worker process died, allowed: fewer --jobs than {self._jobs} where memory is '
                'short'
            ) from None
        except CancelledError:
            raise ValueError(f'cluster {self._cluster}: was lost') from None
        except Exception as error:
            # Dask's own: the call killed its workers, or a worker lacks this package.
            if self._cluster is None or isinstance(error, ValueError):
                raise
            raise ValueError(f'cluster {self._cluster}: {error}') from None

    def _submit(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> dict['Future[Result]', int]:
        assert self._executor is not None
        # Ctrl-C goes to all processes of a terminal, but only this one is to react. A signal that
        # is blocked while the others start stays blocked in them; here it is only delayed.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return {self._executor.submit(function, one): k for k, one in enumerate(arguments)}
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _client_of(address: str) -> Any:
    """Return a client of a Dask cluster."""
    try:
        from distributed import Client
    except ImportError:
        raise ValueError(NEEDS_DISTRIBUTED) from None
    for name in LOGS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise ValueError(f'cluster {address}: cannot be reached ({error})') from None


def _end_with_parent() -> None:
    """End this process as soon as the one that started it has ended for any reason."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
