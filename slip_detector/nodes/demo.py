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

"""``slip_demo``: driver and detector as two processes, and what a grasp controller would get.

Also what all demonstrations share: nodes as processes, and exit codes.
"""

import argparse
import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from slip_detector.commands import command_line
from slip_detector.nodes.run import run

#: Time, in seconds, for which messages are still received after a node has ended.
DRAIN_S = 0.5


class NodeProcesses:
    """Runs nodes, each in a process of its own; on leaving the context all of them are ended.

    ``receive`` is called during waits: it receives messages and returns soon.
    """

    def __init__(self, namespace: str, receive: Callable[[], None]) -> None:
        self._namespace, self._receive = namespace, receive
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> 'NodeProcesses':
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._processes.values()):  # A node before what it listens to.
            process.terminate()
        for process in self._processes.values():
            process.wait()

    def start(self, executable: str, config: Path, *arguments: str, **parameters: object) -> None:
        """Start a node by its executable (see :mod:`slip_detector.nodes.run`)."""
        command = ['setpriv', '--pdeathsig', 'TERM']  # It ends if this process is killed.
        command += [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += ['-r', f'__ns:=/{self._namespace}', '--params-file', str(config)]
        for name, value in parameters.items():
            command += ['-p', f'{name}:={value}']
        # Ctrl-C reaches only this process, which ends them.
        process = subprocess.Popen([*command, '--', *arguments], start_new_session=True)
        self._processes[executable] = process

    def check(self) -> None:
        """Raise a ValueError if a node has failed."""
        for executable, process in self._processes.items():
            if process.poll():
                raise ValueError(f'{executable} ended with the exit code {process.returncode}')

    def wait_until(self, happened: Callable[[], bool]) -> None:
        """Receive messages until a condition holds; a ValueError if a node fails before.

        The first start compiles the chain, which takes minutes on a small or busy machine. What a
        node waits for is in its log.
        """
        while not happened():
            self.check()
            self._receive()

    def wait_for_end(self, executable: str) -> None:
        """Receive messages until a node has ended without an error, and those still under way."""
        node = self._processes[executable]
        self.wait_until(lambda: node.poll() == 0)
        deadline_s = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline_s:
            self._receive()


def run_demonstration(parser: argparse.ArgumentParser) -> None:
    """Run the demonstration of a command, and end the process if it fails or is interrupted.

    It is the function of the command's name in :mod:`slip_detector.nodes.demonstrations`, which
    takes long to load. That gets the arguments and the path of its picture; it returns its
    figures, which are written, and their table, which is printed. A ValueError or OSError is one
    line on stderr, with exit code 1; an interruption by a signal is another, with exit code 0.
    """
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    arguments = parser.parse_args()
    file = arguments.out / f'{parser.prog.removeprefix("slip_")}.json'
    picture = file.with_suffix('.png')
    # All processes are on this machine.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

    def work() -> str:
        from slip_detector.parameters.files import whole_file, writable_folder

        writable_folder(arguments.out)
        demonstrations = importlib.import_module('slip_detector.nodes.demonstrations')
        result, table = getattr(demonstrations, parser.prog)(arguments, picture)
        with whole_file(file) as new:
            new.write_text(json.dumps(result, indent=2) + '\n')
        return f'{table}\nWritten: {file}, {picture}'

    words = f'{parser.prog}: interrupted before it was done'
    run(parser.prog, lambda _: command_line.run(parser.prog, work), words)


def main() -> None:
    """Entry point of ``slip_demo``."""
    parser = argparse.ArgumentParser(prog='slip_demo', description=__doc__)
    parser.add_argument('--scene', default='plate_400um', help='name or path of the scene')
    parser.add_argument('--seed', type=int, default=0, help='seed of the scene')
    parser.add_argument(
        '--record', metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )  # fmt: skip
    run_demonstration(parser)


if __name__ == '__main__':
    main()
