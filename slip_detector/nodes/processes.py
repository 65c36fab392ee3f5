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

"""Nodes as processes, for the page and the demonstrations, and a record of what they publish."""

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile

from slip_detector.chain.samples import Floats
from slip_detector.nodes.ending import END_SIGNAL
from slip_detector.nodes.messages import stamp_ns
from slip_detector.nodes.rclpy_internals import PolledTopics

#: Topics with their types and qualities of service.
Topics = dict[str, tuple[Any, QoSProfile]]

#: Period, in seconds, at which messages are received.
POLL_S = 0.05

#: Time, in seconds, for which messages are still received after a node has ended.
DRAIN_S = 0.5


class NodeProcesses(contextlib.ExitStack):
    """Runs nodes, each in a process of its own; on leaving the context all of them are ended.

    Nodes that are not ``verbose`` log only warnings and errors.
    """

    def __init__(self, namespace: str, verbose: bool = False) -> None:
        super().__init__()
        log_level = 'info' if verbose else 'warn'
        self._options = ['-r', f'__ns:=/{namespace}', '--log-level', log_level]
        self._executables: dict[subprocess.Popen[bytes], str] = {}

    def start(
        self, executable: str, config: Path, *arguments: str, **parameters: object
    ) -> subprocess.Popen[bytes]:
        """Start a node by its executable (see :mod:`slip_detector.nodes.run`)."""
        command = ['setpriv', '--pdeathsig', 'TERM']  # The node ends if this process is killed.
        command += [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += [*self._options, '--params-file', str(config)]
        for name, value in parameters.items():
            command += ['-p', f'{name}:={value}']
        # Ctrl-C reaches only this process, which ends the nodes.
        process = subprocess.Popen([*command, '--', *arguments], start_new_session=True)
        self._executables[process] = executable
        # On leaving, a node ends before those that were started before it.
        self.enter_context(process)
        self.callback(process.terminate)
        return process

    def check(self) -> None:
        """Raise a ValueError if a node has failed."""
        for process, executable in self._executables.items():
            if process.poll():
                raise ValueError(f'{executable} ended with the exit code {process.returncode}')


class RecordedNodes(NodeProcesses):
    """Runs nodes, and records all messages of some topics with their times of arrival.

    The middleware of this process notes these times, so that the work of this process does not
    count as latency of the nodes.
    """

    def __init__(self, namespace: str, topics: Topics, verbose: bool) -> None:
        super().__init__(namespace, verbose)
        node = Node('recorder', namespace=namespace)
        self.callback(node.destroy_node)
        self._topics = PolledTopics(node)
        #: By topic, the times of arrival in nanoseconds and the messages.
        self.messages: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in topics}
        for topic, (message_type, qos) in topics.items():
            self._topics.add(message_type, topic, qos)

    def wait_until(self, happened: Callable[[], bool]) -> None:
        """Receive messages until a condition holds; a ValueError if a node fails before."""
        while not happened():
            self.check()
            self._receive()

    def wait_for_end(self, process: subprocess.Popen[bytes]) -> None:
        """Receive messages until a node has ended without an error, and those still under way."""
        self.wait_until(lambda: process.poll() == 0)
        deadline_s = time.monotonic() + DRAIN_S
        self.wait_until(lambda: time.monotonic() > deadline_s)

    def _receive(self) -> None:
        """Wait for a moment, and receive messages; an ExternalShutdownException after a signal."""
        if END_SIGNAL.wait(POLL_S):
            raise ExternalShutdownException
        for topic, messages in self.messages.items():
            for message, info in self._topics.take(topic):
                messages.append((info['received_timestamp'], message))

    def received_s(self, topic: str) -> Floats:
        """Return when the messages of a topic arrived."""
        return np.array([at_ns for at_ns, _ in self.messages[topic]]) * 1e-9

    def stamps_s(self, topic: str) -> Floats:
        """Return the stamps of the messages of a topic, which have headers or are headers."""
        headers = (getattr(message, 'header', message) for _, message in self.messages[topic])
        return np.array([stamp_ns(header.stamp) for header in headers]) * 1e-9

    def values(self, topic: str, field: str) -> NDArray[Any]:
        """Return a field of the messages of a topic."""
        return np.array([getattr(message, field) for _, message in self.messages[topic]])
