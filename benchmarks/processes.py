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

"""Starts, watches and ends processes, and reads the processor time and memory that they take."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

#: The folder from which the modules of the benchmarks are found.
CHECKOUT = Path(__file__).resolve().parents[1]

#: Environment for processes whose nodes are all on this machine, and need no network.
ON_THIS_MACHINE = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}

#: Time, in seconds, that a process is given to end, with nodes of its own, before it is killed.
END_TIMEOUT_S = 15.0


def figures_of_process(
    module: str,
    words: Sequence[str],
    timeout_s: float,
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Run a module of the benchmarks as a process; return the JSON object that it prints.

    The process has a session of its own. So Ctrl-C reaches only the caller, which ends the
    process, and the process ends its nodes. At last its whole session is killed.

    Raises
    ------
    RuntimeError
        When the process fails or does not end in time.
    """
    process = subprocess.Popen(
        [sys.executable, '-m', module, *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=CHECKOUT,
        env=ON_THIS_MACHINE | dict(os.environ) | dict(environment or {}), start_new_session=True,
    )  # fmt: skip
    try:
        output, errors = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f'{module} did not end within {timeout_s:.0f} s') from None
    finally:
        _end([process])
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    if process.returncode:
        raise RuntimeError(f'{module} failed: {"".join(errors.strip().splitlines()[-1:])}')
    figures: dict[str, Any] = json.loads(output)
    return figures


def _end(processes: 'Iterable[subprocess.Popen[Any]]') -> None:
    """Ask processes to end, and kill those that do not."""
    for process in processes:
        process.terminate()
    for process in processes:
        try:
            process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def print_figures(measure: Callable[[], dict[str, Any]]) -> int:
    """Measure and print one JSON object, for :func:`figures_of_process`; return the exit code."""
    try:
        with exit_on_termination(signal.SIGINT, signal.SIGTERM):
            print(json.dumps(measure()))
    except (RuntimeError, ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


@contextlib.contextmanager
def exit_on_termination(*signals: signal.Signals) -> Iterator[None]:
    """Turn signals (default: SIGTERM) into SystemExit, so that started processes are ended."""
    before = {number: signal.signal(number, _exit) for number in signals or (signal.SIGTERM,)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _exit(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)


@contextlib.contextmanager
def nodes_running(
    commands: Mapping[str, Sequence[str]],
) -> 'Iterator[dict[str, subprocess.Popen[bytes]]]':
    """Start processes, by name, and end them at the end of the block.

    Their stdout is discarded: only the measuring process may print there.
    """
    processes: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, command in commands.items():
            processes[name] = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        yield processes
    finally:
        _end(processes.values())


def raise_if_ended(processes: 'Mapping[str, subprocess.Popen[bytes]]') -> None:
    """Check that all processes still run.

    Raises
    ------
    RuntimeError
        When one has ended; names it and its exit code.
    """
    for name, process in processes.items():
        if process.poll() is not None:
            raise RuntimeError(f'{name} ended with the exit code {process.returncode}')


def processor_time_s(pid: int) -> float:
    """Return the processor time, user and system, that a process has used so far.

    Examples
    --------
    >>> import os
    >>> processor_time_s(os.getpid()) > 0.0
    True
    """
    # The name in parentheses may hold anything; after it, utime is field 12 and stime field 13.
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def memory_kib(pid: int) -> int:
    """Return how much memory a process holds (its resident set).

    Examples
    --------
    >>> import os
    >>> memory_kib(os.getpid()) > 1000
    True
    """
    fields = Path(f'/proc/{pid}/statm').read_text().split()
    return int(fields[1]) * os.sysconf('SC_PAGE_SIZE') // 1024
