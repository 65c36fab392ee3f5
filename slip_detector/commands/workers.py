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
import itertools
import logging
import multiprocessing
import os
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent import futures
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from tqdm import tqdm

from slip_detector.commands.command_line import whole_number
from slip_detector.parameters import RecordingConfig, file_errors_of, find_parameter_file
from slip_detector.recordings import ENDINGS, is_recording

LOG = logging.getLogger(__name__)

#: The parameters of :class:`RecordingConfig` that are options, without ``recording_``.
RECORDING_OPTIONS = ('topic', 'field', 'labels', 'resample')

#: The function that this process, one of several, calls.
_FUNCTION: list[Callable[[Any], Any]] = []

#: Calls a function with each of several arguments; yields the index of each argument with the
#: result of its call, as the calls end.
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
    parser.add_argument('--verbose', action='store_true', help='print more figures')
    text = f'processes that {work} (default: 1)'
    parser.add_argument('--jobs', type=whole_number(1), metavar='N', help=text)
    group = parser.add_argument_group('what to read of a recording')
    for field in dataclasses.fields(RecordingConfig):
        name = field.name.removeprefix('recording_')
        if name in RECORDING_OPTIONS:
            action = 'store_true' if field.default is False else 'store'
            meaning = field.metadata['meaning'].replace('%', '%%')
            group.add_argument(f'--{name}', action=action, default=None, help=meaning)


def apply_options(options: argparse.Namespace, sets: Any) -> Any:
    """Return a named tuple of parameter sets with the values of ``--config`` and other options.

    ``options.config`` becomes the path of the file. A ValueError names a file that is not there.
    """
    if options.labels:
        with file_errors_of(f'--labels {options.labels}', 'read'):
            os.stat(options.labels)
    if options.config:
        options.config = str(find_parameter_file(options.config))
        sets = sets._make(type(one).from_yaml(options.config) for one in sets)
        for words in itertools.chain.from_iterable(one.remarks() for one in sets):
            LOG.warning('%s: %s', options.config, words)
    values = {f'recording_{name}': getattr(options, name) for name in RECORDING_OPTIONS}
    changes = {name: value for name, value in values.items() if value is not None}
    return sets._make(
        dataclasses.replace(config, **changes) if isinstance(config, RecordingConfig) else config
        for config in sets
    )


def check_writable(path: Path) -> None:
    """Refuse a file that cannot be written, so that long work is not done in vain.

    Examples
    --------
    >>> check_writable(Path('no such folder') / 'tuned.yaml')
    Traceback (most recent call last):
    ValueError: no such folder/tuned.yaml: cannot be written (No such file or directory)
    """
    with file_errors_of(path):
        # A folder or a protected file would be replaced.
        if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
            raise OSError(0, 'is write-protected' if path.is_file() else 'is no file')
        # whole_file needs to write beside it.
        with tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(path))):
            pass


def check_apart(outputs: Mapping[str, Path | None], *read: str | Path | None) -> None:
    """Refuse a file to write that is a recording, is read or written too, or cannot be written.

    Parameters
    ----------
    outputs
        Files to write, by the option that names each; None: the option is not given.
    read
        Files that are read beside recordings, or None.

    Examples
    --------
    >>> check_apart({'--out': Path('tuned.yaml'), '--report': Path('./tuned.yaml')})
    Traceback (most recent call last):
    ValueError: --report tuned.yaml: is written by --out too, allowed: a file of its own
    """
    uses = {Path(path).resolve(): 'is read too' for path in read if path}
    for option, path in outputs.items():
        if path is not None:
            file, own = path.resolve(), f'is written by {option} too'
            use = 'is a recording' if is_recording(file) else uses.setdefault(file, own)
            if use != own:
                raise ValueError(f'{option} {path}: {use}, allowed: a file of its own')
            check_writable(path)


def progress_bar(total: int | None, unit: str) -> 'tqdm[Any]':
    """Return a progress bar on stderr; it is disabled where stderr is not a terminal."""
    return tqdm(total=total, unit=unit, disable=None, dynamic_ncols=True, mininterval=0.0)


@contextlib.contextmanager
def processes(jobs: int | None = None) -> Iterator[Calls | None]:
    """Within this context, let several processes make calls.

    Function, arguments and results must be picklable. Calls that still run at the end of the
    context are given up.

    Parameters
    ----------
    jobs
        Number of processes; with one there are no calls, as this process can do the work.

    Raises
    ------
    ValueError
        When a call refuses its argument, or a process dies.

    Examples
    --------
    >>> with processes(jobs=2) as calls:
    ...     sorted(calls(abs, [3, -4]))
    [(0, 3), (1, 4)]
    """
    if jobs is None or jobs == 1:
        yield None
        return
    executors = dict[Any, futures.ProcessPoolExecutor]()
    try:
        yield functools.partial(_make_calls, executors, jobs)
    finally:
        for process in multiprocessing.active_children():
            process.kill()
        for executor in executors.values():
            executor.shutdown()


def _make_calls(
    executors: dict[Any, futures.ProcessPoolExecutor],
    jobs: int,
    function: Callable[[Any], Any],
    arguments: Sequence[Any],
) -> Iterator[tuple[int, Any]]:
    """Let processes call a function; see :data:`Calls`."""
    if function not in executors:
        # Each process gets the function once, as it may hold much data.
        context = multiprocessing.get_context('spawn')
        executors[function] = futures.ProcessPoolExecutor(jobs, context, _begin, (function,))
    # Ctrl-C goes to all processes of a terminal, but only this one is to react. A signal that is
    # blocked while another process starts stays blocked in it. Starting the resource tracker,
    # which the first process would do, ends the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        executor = executors[function]
        places = {executor.submit(_call, each): place for place, each in enumerate(arguments)}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        for done in futures.as_completed(places):
            yield places[done], done.result()
    except futures.BrokenExecutor as error:
        died = f'allowed: fewer --jobs than {jobs} where memory is short'
        raise ValueError(f'a worker process died, {died} ({error})') from None


def _begin(function: Callable[[Any], Any]) -> None:
    """Note the function that this process calls, and end with the process that started it."""
    _FUNCTION.append(function)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _call(argument: Any) -> Any:
    return _FUNCTION[0](argument)


def _end_with_parent() -> None:
    parent: Any = multiprocessing.parent_process()
    parent.join()
    os._exit(1)
