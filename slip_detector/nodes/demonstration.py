"""What the demonstrations share: nodes in processes of their own, and how a demonstration ends."""

import os
import subprocess
import sys
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException

#: Time from the request to end to the kill.
END_TIMEOUT_S = 10.0

#: How long messages are still taken after the last node has ended.
DRAIN_S = 0.5


class NodeProcesses:
    """Nodes, each in a process of its own.

    It is a context manager, which ends all processes when the context is left.

    Parameters
    ----------
    namespace
        Of all nodes: a demonstration must not mix with the topics of a robot beside it.
    receive
        Takes messages, for some hundredths of a second at most; called while a wait lasts.
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
            Its name, see :mod:`slip_detector.nodes.run`.
        arguments
            Arguments of ROS, such as ``-p`` and ``seed:=1``.
        """
        command = [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += ['-r', f'__ns:=/{self._namespace}', *arguments]
        self._processes[executable] = subprocess.Popen(command)

    def wait_until(self, happened: Callable[[], bool], what: str, timeout_s: float) -> None:
        """Receive messages until something has happened.

        Parameters
        ----------
        happened
            Returns whether it has.
        what
            What is waited for, in messages.
        timeout_s
            Longest time to wait.

        Raises
        ------
        RuntimeError
            When a node has ended, or the time is over.
        """
        deadline_s = time.monotonic() + timeout_s
        while not happened():
            for executable, process in self._processes.items():
                if process.poll() is not None:
                    raise RuntimeError(_ended(executable, process.returncode))
            if time.monotonic() > deadline_s:
                raise RuntimeError(f'waited in vain for {what}')
            self._receive()

    def wait_for_end(self, executable: str, what: str, timeout_s: float) -> None:
        """Receive messages until a node has ended, and those that are still on their way.

        Parameters
        ----------
        executable
            The node.
        what, timeout_s
            As :meth:`wait_until` takes them.

        Raises
        ------
        RuntimeError
            When the node fails, another one has ended, or the time is over.
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
    """Run a demonstration and end the process where it does not succeed.

    The exit code is 1 after an error, which is one line on stderr, and 130 after Ctrl-C.

    Parameters
    ----------
    name
        Of the command.
    demonstrate
        Raises a ValueError, RuntimeError or OSError where it cannot go on.
    """
    # Processes on one machine need no network.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    try:
        demonstrate()
    except (KeyboardInterrupt, ExternalShutdownException):
        sys.exit(130)
    except (ValueError, RuntimeError, OSError) as error:
        print(f'{name}: {error}', file=sys.stderr)
        sys.exit(1)
    except Exception:
        if rclpy.ok():
            raise
        sys.exit(130)  # A signal has shut the context down during a call.
    finally:
        rclpy.try_shutdown()
