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

"""Starts, watches and ends nodes, and reads the processor time and memory that they take."""

import contextlib
import os
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

#: Time, in seconds, that a process is given to end, with nodes of its own, before it is killed.
END_TIMEOUT_S = 15.0


@contextlib.contextmanager
def nodes_running(
    commands: Mapping[str, Sequence[str]],
) -> 'Iterator[dict[str, subprocess.Popen[bytes]]]':
    """Start nodes as processes, by name, and rclpy; end all at the end of the block.

    They find only nodes of this machine. Ctrl-C reaches only this process, which ends them. Their
    stdout is discarded: figures are printed there.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    processes: dict[str, subprocess.Popen[bytes]] = {}
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        for name, command in commands.items():
            processes[name] = subprocess.Popen(
                command, stdout=subprocess.DEVNULL, start_new_session=True
            )
        yield processes
    finally:
        for process in processes.values():
            process.terminate()
        for process in processes.values():
            try:
                process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        rclpy.try_shutdown()


def spin_until(
    node: Any,
    processes: 'Mapping[str, subprocess.Popen[bytes]]',
    holds: Callable[[], bool],
    deadline_s: float,
    awaited: str,
) -> None:
    """Spin a node until a condition holds, at the latest at a time of ``time.monotonic``.

    Raises
    ------
    RuntimeError
        When a process ends or the time is over.
    """
    import rclpy

    while not holds():
        for name, process in processes.items():
            if process.poll() is not None:
                raise RuntimeError(f'{name} ended with the exit code {process.returncode}')
        if time.monotonic() > deadline_s:
            raise RuntimeError(f'waited in vain for {awaited}')
        rclpy.spin_once(node, timeout_sec=0.1)


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
