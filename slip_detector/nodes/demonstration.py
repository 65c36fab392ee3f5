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

"""What the demonstrations share: node processes, and the exit code after errors."""

import os
import subprocess
import sys
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException

#: Time, in seconds, that a node is given to end before it is killed.
END_TIMEOUT_S = 10.0

#: Time, in seconds, that nodes are given to start: the first start compiles the chain, which takes
#: minutes on a small or busy machine.
START_TIMEOUT_S = 600.0

#: Time, in seconds, for which messages are still received after a node has ended.
DRAIN_S = 0.5


class NodeProcesses:
    """Runs nodes, each in a process of its own.

    A context manager: on leaving it, all processes are ended.

    Parameters
    ----------
    namespace
        Namespace of all nodes, so that their topics do not mix with those of a robot.
    receive
        Receives messages, and returns within some hundredths of a second; called during waits.
    """

    def __init__(self, namespace: str, receive: Callable[[], None]) -> None:
        self._namespace, self._receive = namespace, receive
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> 'NodeProcesses':
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            if process.poll() is None:
                process.terminate()
        for process in self._processes.values():
            try:
                process.wait(timeout=END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(self, executable: str, *arguments: str) -> None:
        """Start a node.

        Parameters
        ----------
        executable
            Name of the node's executable, see :mod:`slip_detector.nodes.run`.
        arguments
            ROS arguments, such as ``-p`` and ``seed:=1``.
        """
        command = [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += ['-r', f'__ns:=/{self._namespace}', *arguments]
        self._processes[executable] = subprocess.Popen(command)

    def check(self) -> None:
        """Raise a RuntimeError if a node has ended."""
        for executable, process in self._processes.items():
            if process.poll() is not None:
                raise RuntimeError(_ended(executable, process.returncode))

    def wait_until(self, happened: Callable[[], bool], what: str, timeout_s: float) -> None:
        """Receive messages until a condition holds.

        Parameters
        ----------
        happened
            Returns whether the condition holds.
        what
            What is awaited, for the error message.
        timeout_s
            Longest time to wait.

        Raises
        ------
        RuntimeError
            When a node ends, or the time is over.
        """
        deadline_s = time.monotonic() + timeout_s
        while not happened():
            self.check()
            if time.monotonic() > deadline_s:
                raise RuntimeError(f'waited in vain for {what}')
            self._receive()

    def wait_for_end(self, executable: str, what: str, timeout_s: float) -> None:
        """Receive messages until a node has ended, and then those that still arrive.

        Parameters
        ----------
        executable
            The node.
        what, timeout_s
            As for :meth:`wait_until`.

        Raises
        ------
        RuntimeError
            When the node fails, another one ends, or the time is over.
        """
        node = self._processes.pop(executable)
        try:
            self.wait_until(lambda: node.poll() is not None, what, timeout_s)
        finally:
            self._processes[executable] = node
        if node.returncode:
            raise RuntimeError(_ended(executable, node.returncode))
        deadline_s = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline_s:
            self._receive()


def _ended(executable: str, code: int) -> str:
    return f'{executable} ended with the exit code {code}'


def run_demonstration(name: str, demonstrate: Callable[[], None]) -> None:
    """Run a demonstration; if it fails, end the process.

    The exit code is 1 after an error, which is printed as one line on stderr, and 130 after a
    signal.

    Parameters
    ----------
    name
        Name of the command.
    demonstrate
        Raises a ValueError, RuntimeError or OSError when it cannot go on.
    """
    # All processes are on this machine.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    try:
        demonstrate()
    except (KeyboardInterrupt, ExternalShutdownException):
        sys.exit(130)
    except Exception as error:
        context = rclpy.get_default_context()
        if context.handle is not None and not context.ok():
            sys.exit(130)  # The error comes from a signal, which has shut rclpy down.
        if not isinstance(error, ValueError | RuntimeError | OSError):
            raise
        print(f'{name}: {error}', file=sys.stderr)
        sys.exit(1)
    finally:
        rclpy.try_shutdown()
