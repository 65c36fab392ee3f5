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


"""Tunes a detector on the recordings of the live page, as ``slip_tune`` does."""

import asyncio
import json
import signal
import subprocess
import sys
from pathlib import Path
from subprocess import PIPE, STDOUT
from typing import IO, Any, cast

from slip_detector.parameters import NODE_PARAMETERS, DetectorConfig, writable_folder, write_yaml
from slip_detector.view.detectors import Values
from slip_detector.view.recordings import RecordedFolder

#: Starts ``slip_tune`` as the console script does, wherever that is, and gives way to the nodes.
SLIP_TUNE = 'import sys; from slip_detector.commands.command_line import tune; sys.exit(tune())'
COMMAND = 'nice', '-n', '10', sys.executable, '-c', SLIP_TUNE, '--json'

#: What a run has said before its command has printed anything.
NOTHING_SAID = {'step': '', 'share': 0.0, 'lines': [], 'answer': [], 'table': [], 'kept': ''}


def was_interrupted(recorded: Path, config: DetectorConfig) -> bool:
    """Return whether a search for a detector ended without a result, so that it can go on."""
    folder = recorded / 'tuning'
    try:
        # The trials are written before the result.
        newest = max(folder.glob('tuned.yaml*'), key=lambda path: path.stat().st_mtime_ns)
        running = DetectorConfig.from_yaml(folder / 'running.yaml')
        return newest.suffix == '.journal' and running == config
    except (OSError, ValueError):  # There was none, or it cannot be read.
        return False


class TuneRun:
    """One run of ``slip_tune`` on the recordings of a finger, to be better than what runs.

    Parameters
    ----------
    recorded
        The recordings; parameter files are written in the folder ``tuning`` beside them.
    finger, config
        Name and parameters of the detector.
    """

    def __init__(self, recorded: RecordedFolder, finger: str, config: DetectorConfig) -> None:
        self.finger, self._config, self._recorded = finger, config, recorded
        self._folder = recorded.folder
        self._process: subprocess.Popen[bytes] | None = None
        #: Whether the search goes on, and whether a page has stopped it.
        self.running, self.stopping = True, False
        #: What the command has printed: the present ``step``, the ``share`` of the search that is
        #: done, ``lines`` on what was noticed, and at the end the ``answer``, a ``table`` of the
        #: running and the tuned detector, and why what was found should not be applied, ``kept``.
        self.said: dict[str, Any] = dict(NOTHING_SAID)
        #: Why the run failed.
        self.failed = ''
        #: The tuned parameters, once they were compared.
        self.found: DetectorConfig | None = None

    async def run(self) -> None:
        """Note what the command prints until it ends; an error is noted in ``failed``."""
        try:
            running = writable_folder(self._folder / 'tuning') / 'running.yaml'
            write_yaml(running, self._config.to_document(), ['Written by slip_view: what runs.'])
            files = self._folder, '--config', running, '--out', running.with_name('tuned.yaml')
            # Ctrl-C in the terminal is for slip_view.
            with subprocess.Popen(
                [*COMMAND, *map(str, files)], stdout=PIPE, stderr=STDOUT, start_new_session=True
            ) as self._process:
                if self.stopping:
                    self._process.send_signal(signal.SIGINT)
                await self._follow(self._process)
        except ValueError as error:
            self.failed = str(error)
        finally:
            self.running, self.said['step'] = False, ''

    async def _follow(self, process: subprocess.Popen[bytes]) -> None:
        output, complaint = cast(IO[bytes], process.stdout), 'the search ended before it was done'
        try:
            while line := await asyncio.to_thread(output.readline):
                if not line.startswith(b'{'):
                    complaint = line.decode(errors='replace').strip()
                    continue
                self.said |= json.loads(line)
                self._recorded.note_doubts(self.said['lines'])
                if 'changes' in self.said:
                    self.found = self._config.with_values(self.said['changes'])
            code = await asyncio.to_thread(process.wait)
        finally:
            process.kill()
        # A command that is stopped while Python starts ends with an error of Python's.
        if self.found is None and self.stopping and (code != 1 or not self.said['step']):
            self.failed = 'stopped before anything was found'
        elif self.found is None:
            self.failed = complaint.removeprefix('slip_tune: ')

    def to_apply(self, config: DetectorConfig) -> Values:
        """Return the parameters to set so that a detector decides as the tuned one.

        Parameters
        ----------
        config
            The detector's present parameters, which may have changed since the run began.

        Raises
        ------
        ValueError
            When it has other channels, or another rate, than when it was taught.
        """
        if self.found is None:
            return {}
        if (config.names, config.sample_rate_hz) != (self.found.names, self.found.sample_rate_hz):
            raise ValueError('the detector has other channels or another rate now: tune it again')
        return config.changes_to(self.found, NODE_PARAMETERS)

    def stop(self) -> None:
        """Stop the search; the best chain so far is judged and kept."""
        if self.running and not self.stopping:
            self.stopping = True
            if self._process:
                self._process.send_signal(signal.SIGINT)

    def describe(self) -> dict[str, Any]:
        """Return the state of the run, for the page."""
        return {
            **self.said,
            'finger': self.finger,
            'running': self.running,
            'stopping': self.stopping and self.running,
            'failed': '' if self.running else self.failed,
            'changes': len(self.to_apply(self._config)),
        }
