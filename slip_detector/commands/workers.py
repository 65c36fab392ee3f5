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

"""What the commands share that read recordings: options, files, the bar, several processes."""

import argparse
import contextlib
import dataclasses
import functools
import multiprocessing
import os
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor, as_completed
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tqdm import tqdm

from slip_detector.commands.command_line import whole_number
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.files import file_errors_of, find_parameter_file
from slip_detector.recordings import ENDINGS, is_recording

#: The parameters of :class:`RecordingConfig` that are options, without ``recording_``.
READING = ('topic', 'field', 'labels', 'resample')

#: Calls a function with many arguments; yields the index of each, and the result of its call, as
#: the calls end.
Calls = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[int, Any]]]


def add_options(parser: argparse.ArgumentParser, work: str, recordings: str = '*') -> None:
    """Add the recordings, and the options that ``slip_evaluate`` and ``slip_tune`` share.

    Parameters
    ----------
    parser
        The parser of the command.
    work
        What its processes do.
    recordings
        How many recordings have to be given: ``*`` or ``+``, as argparse has it.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_options(parser, 'search')
    >>> parser.parse_args(['--jobs', '4', '--topic', '/left/voltages']).jobs
    4
    """
    text = f'a recording ({", ".join(ENDINGS)} or the folder of a bag) or a folder of them'
    parser.add_argument('recordings', nargs=recordings, metavar='RECORDING', help=text)
    parser.add_argument(
        '--config', metavar='FILE', help='a ROS parameter file (its path, or its name in the '
        'package, as sensors/imu.yaml) with the sections slip_detector, '
        'slip_driver (where in a recording the samples and labels are), slip_evaluate (what '
        'counts as detected) and slip_tune (weights of a search); default: the default parameters',
    )  # fmt: skip
    text = 'write an HTML page with timelines that can be zoomed, and all figures'
    parser.add_argument('--report', type=Path, metavar='FILE.html', help=text)
    parser.add_argument('--verbose', action='store_true', help='print all figures')
    text = f'processes that {work} (default: 1)'
    parser.add_argument('--jobs', type=whole_number(1), metavar='N', help=text)
    group = parser.add_argument_group('what to read of a recording')
    for field in dataclasses.fields(RecordingConfig):
        name = field.name.removeprefix('recording_')
        if name in READING:
            action = 'store_true' if field.default is False else 'store'
            meaning = field.metadata['meaning'].replace('%', '%%')
            group.add_argument(f'--{name}', action=action, default=None, help=meaning)


def with_options(options: argparse.Namespace, sets: Any) -> Any:
    """Return a named tuple of sets of parameters, from ``--config`` and the other options.

    Raises
    ------
    ValueError
        When the file cannot be read or has a value that is not allowed; names it.

    Examples
    --------
    >>> from slip_detector.evaluation.evaluator import RecordingLoader
    >>> options = argparse.Namespace(
    ...     config=None, topic='/a', field=None, labels=None, resample=None)
    >>> with_options(options, RecordingLoader()).recording_config.recording_topic
    '/a'
    """
    given = {name: getattr(options, name) for name in READING}
    changes = {f'recording_{name}': value for name, value in given.items() if value is not None}
    if options.config:  # From here on it is the path.
        options.config = str(find_parameter_file(options.config))
        sets = sets._make(type(one).from_yaml(options.config) for one in sets)
    return sets._make(
        dataclasses.replace(one, **changes) if isinstance(one, RecordingConfig) else one
        for one in sets
    )


def check_writable(path: Path) -> None:
    """Raise an error if a file cannot be written, so that long work is not done in vain.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.

    Examples
    --------
    >>> check_writable(Path('no such folder') / 'tuned.yaml')
    Traceback (most recent call last):
    ValueError: no such folder/tuned.yaml: cannot be written (No such file or directory)
    """
    with file_errors_of(path):
        # Either would be replaced by a file.
        if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
            raise OSError(0, 'is write-protected' if path.is_file() else 'is no file')
        # whole_file needs to write beside it.
        with tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(path))):
            pass


def check_apart(written: Mapping[str, Path | None], *read: str | Path | None) -> None:
    """Raise an error if a file to write is also read or written, or cannot be written.

    No recording is overwritten.

    Parameters
    ----------
    written
        Files to write, by the option that names each; None: the option is not given.
    read
        Files that are read beside recordings, or None.

    Raises
    ------
    ValueError
        When two of these files are the same, or one cannot be written; names the file.

    Examples
    --------
    >>> check_apart({'--out': Path('tuned.yaml'), '--report': Path('./tuned.yaml')})
    Traceback (most recent call last):
    ValueError: --report tuned.yaml: is written by --out too, allowed: a file of its own
    """
    uses = {Path(path).resolve(): 'is read too' for path in read if path}
    for option, path in written.items():
        if path is not None:
            file, own = path.resolve(), f'is written by {option} too'
            use = 'is a recording' if is_recording(file) else uses.setdefault(file, own)
            if use != own:
                raise ValueError(f'{option} {path}: {use}, allowed: a file of its own')
            check_writable(path)


def progress_bar(total: int | None, unit: str) -> 'tqdm[Any]':
    """Return a progress bar on stderr; it is disabled where stderr is not a terminal.

    Examples
    --------
    >>> with progress_bar(total=200, unit='trial') as bar:
    ...     bar.total
    200
    """
    return tqdm(total=total, unit=unit, disable=None, dynamic_ncols=True, mininterval=0.0)


@contextlib.contextmanager
def processes(jobs: int | None = None) -> Iterator[Calls | None]:
    """Within this context, let several processes make calls.

    Function, arguments and results must be picklable. At the end calls that still run are given
    up.

    Parameters
    ----------
    jobs
        Number of processes; with one there are no calls, as this process can do the work.

    Raises
    ------
    ValueError
        When a process dies.

    Examples
    --------
    >>> with processes(jobs=2) as calls:
    ...     sorted(calls(abs, [3, -4]))
    [(0, 3), (1, 4)]
    """
    if jobs is None or jobs == 1:
        yield None
        return
    of_thread, started = threading.local(), list[Any]()
    start: Any = functools.partial(_start_process, of_thread, started)
    # The first process would start it, which takes its protection from signals away.
    resource_tracker.ensure_running()
    with ThreadPoolExecutor(jobs, initializer=start) as threads:

        def results(function: Callable[[Any], Any], every: Sequence[Any]) -> Iterator[Any]:
            call = functools.partial(_call, of_thread, function)
            calls = {threads.submit(call, one): k for k, one in enumerate(every)}
            try:
                for done in as_completed(calls):
                    yield calls[done], done.result()
            except (EOFError, OSError, BrokenExecutor) as error:
                died = f'allowed: fewer --jobs than {jobs} where memory is short'
                why = str(error) or type(error).__name__
                raise ValueError(f'a worker process died, {died} ({why})') from None

        try:
            yield results
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in started:
                process.kill()
                process.join()


def _start_process(of_thread: threading.local, started: list[Any]) -> None:
    """Start the process of this thread, which makes its calls."""
    # Ctrl-C goes to all processes of a terminal, but only the main thread of this one is to react.
    # A signal that is blocked while another process starts stays blocked in it.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    context = multiprocessing.get_context('spawn')
    of_thread.connection, there = context.Pipe()
    process = context.Process(target=_make_calls, args=(there,), daemon=True)
    process.start()
    started.append(process)
    there.close()


def _call(of_thread: threading.local, function: Callable[[Any], Any], argument: Any) -> Any:
    """Let the process of this thread call a function."""
    of_thread.connection.send((function, argument))
    refused, result = of_thread.connection.recv()
    if refused:
        raise refused
    return result


def _make_calls(connection: Connection) -> None:
    """Make calls, as the only thing of this process; it ends with the one that started it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError):  # Nobody calls any more.
        while True:
            function, argument = connection.recv()
            try:
                done: Any = None, function(argument)
            except (ValueError, OSError) as error:
                # Of others it is not known whether they can be sent.
                done = error if hasattr(error, 'advice') else ValueError(str(error)), None
            connection.send(done)


def _end_with_parent() -> None:
    parent: Any = multiprocessing.parent_process()
    parent.join()
    os._exit(1)
