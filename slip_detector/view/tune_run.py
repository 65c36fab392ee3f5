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


"""Tunes a detector on the recordings of the live page: runs one command after another."""

import asyncio
import contextlib
import dataclasses
import json
import os
import re
import shutil
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.files import writable_folder, write_yaml
from slip_detector.report.tables import MAIN_FIGURES, figure_text, heading
from slip_detector.tuning.learning import LEAST_S
from slip_detector.view.recorded_folder import RecordedFolder

#: Number of chains that the search tries.
TRIALS = 200

#: A user presses the key so many seconds after a slip begins: an alarm in between is not false.
EARLY_S = 0.2

#: Figures of which larger is better; of all others, smaller is better.
LARGER_IS_BETTER = ('recall', 'sooner_than_chance', 'precision', 'auc_all', 'auc_moving')

#: Where the search for an unknown sensor begins: see docs/your_sensor.md.
NEW_SENSOR: dict[str, Any] = {
    'decision': 'evidence',
    'threshold': 0.5,
    'noise_floor': [1e-9],
    'noise_floor_learnt': ChainConfig.noise_floor_learnt,
    'passband_degree': 2,
    'stopbands_hz': [],
    'gain': 1.0,
    'exponent': 1,
    'vote': 2,
}
LOW_HZ, LOW_SHARE = 20.0, 0.2

#: Parameters of the decision; a detector's other parameters are left as they are.
OF_THE_CHAIN = {field.name for field in dataclasses.fields(ChainConfig)}

#: Starts a command as its console script does, which need not be on the path.
START = 'import sys; from slip_detector.commands.command_line import {name}; sys.exit({name}())'

_TRIAL = re.compile(r'^(\d+) of (\d+) trials, (.*)')


class Comparison(NamedTuple):
    """A figure of the running and of the tuned detector, on the held-out recordings.

    Examples
    --------
    >>> Comparison('missed slips', '3 of 20', '1 of 20', 'better').after
    '1 of 20'
    """

    title: str
    before: str
    after: str
    #: 'better', 'worse' or ''.
    change: str


class TuneRun:
    """One run of ``slip_tune`` on the recordings of a finger.

    Noise is learnt from rest and impacts from taps; a search begins with what was learnt. Then the
    running and the tuned detector are evaluated on the held-out recordings. Each step is a process
    of its own, with low priority.

    Parameters
    ----------
    recorded
        The recordings.
    config
        The detector's parameters.

    Attributes
    ----------
    lines : list of str
        What was learnt, and which steps did not work.
    step : str
        The present step, '' before and after the run.
    share : float
        Share of the search that is done, 0 to 1.
    failed : str
        Why the run failed, in one line; '' if it did not.
    table : list of Comparison
        Empty until the run has ended.
    found : DetectorConfig or None
        The tuned parameters, once they were compared.
    changes : int
        Number of parameters in which they differ from ``config``.

    Raises
    ------
    ValueError
        When there are too few recordings.
    """

    def __init__(
        self,
        recorded: RecordedFolder,
        config: DetectorConfig,
    ) -> None:
        slips = recorded.of_kind('slip')
        if len(slips) < 2:
            raise ValueError(
                f'there are {len(slips)} recordings of slips, allowed: two or more, to tune on '
                'and to hold out'
            )
        self._recorded, self._config = recorded, config
        self.held_out = recorded.held_out()
        self._slips = [name for name in slips if name not in self.held_out]
        self.folder = recorded.folder / 'tuning'
        self._process: asyncio.subprocess.Process | None = None
        self._stopped = self._killed = self._compares = False
        self.lines: list[str] = []
        self.step = self.failed = ''
        self.share = 0.0
        self.table: list[Comparison] = []
        self.found: DetectorConfig | None = None
        self.changes = 0
        self.running = False

    async def run(self) -> None:
        """Run to the end; an error is reported in ``failed``."""
        self.running = True
        try:
            await self._run()
        except ValueError as error:
            self.failed = str(error)
        except OSError as error:  # There is no room for another process, for example.
            self.failed = f'slip_tune cannot be run ({error.strerror or error})'
        finally:
            self.running, self.step = False, ''

    async def _run(self) -> None:
        writable_folder(self.folder)
        given = self._write('running.yaml', self._config)
        begin = self._write('begin.yaml', self._beginning())
        begin = await self._learn(begin)
        self.step = 'searching'
        tuned = self.folder / 'tuned.yaml'
        names = [*self._slips, *self._not_held_out('rest'), *self._not_held_out('taps')]
        held_out = [f'--held-out={self._path(name)}' for name in self.held_out]
        await self._command(
            'tune',
            *map(self._path, names), *held_out, '--config', str(begin), '--out', str(tuned),
            '--trials', str(TRIALS),
        )  # fmt: skip
        self._compares = True
        self.step = 'comparing on what was held out'
        before, after = [await self._figures(file) for file in (given, tuned)]
        self.found = DetectorConfig.from_yaml(tuned)
        self.changes = len(self.to_apply(self._config))
        self.table = compared(before, after)

    def to_apply(self, config: DetectorConfig) -> dict[str, Any]:
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
            raise ValueError(
                f'{self.found.channels} channels at {self.found.sample_rate_hz:g} Hz were taught, '
                f'and the detector has {config.channels} at {config.sample_rate_hz:g} Hz now, or '
                'others: tune again on recordings of these'
            )
        now, found = config.to_parameters(), self.found.to_parameters()
        return {
            name: found.get(name)
            for name in {**now, **found}
            if name.partition('.')[0] in OF_THE_CHAIN and now.get(name) != found.get(name)
        }

    def stop(self) -> None:
        """Stop the search; the best chain so far is judged and kept."""
        if not self._stopped and not self._compares:
            self._stopped = True
            self._signal(signal.SIGINT)

    def kill(self) -> None:
        """End the running command at once; the run then fails."""
        self._killed = True
        self._signal(signal.SIGKILL)

    @property
    def _ended(self) -> str:
        """Why no further command may run; '' if one may."""
        if self._killed:
            return 'slip_view has ended'
        stopped = self._stopped and not self._compares
        return 'stopped before anything was found' if stopped else ''

    def described(self) -> dict[str, Any]:
        """Return the state of the run, for the page."""
        return {
            'running': self.running,
            'stopping': self._stopped and self.running and not self._compares,
            'step': self.step,
            'share': self.share,
            'lines': self.lines,
            'failed': self.failed,
            'held_out': self.held_out,
            'table': [list(row) for row in self.table],
            'changes': self.changes,
        }

    def _beginning(self) -> DetectorConfig:
        """Return where learning begins: the present parameters, or those for a new sensor."""
        config = self._config
        if config.decision == 'evidence':
            return config
        low_hz = min(LOW_HZ, LOW_SHARE * config.sample_rate_hz)
        smallest = min(map(len, config.groups.values()))
        new = {'passband_hz': [low_hz, 0.0], **NEW_SENSOR, 'vote': min(2, smallest)}
        return DetectorConfig.from_parameters({**config.to_parameters(), **new})

    async def _learn(self, begin: Path) -> Path:
        """Learn noise and impacts if there are recordings of them; return the parameter file."""
        quiet, impacts = self.folder / 'quiet.yaml', self.folder / 'impacts.yaml'
        rest = self._longest('rest')
        if rest and self._recorded.recordings[rest].duration_s >= LEAST_S:
            self.step = f'learning the noise of {rest}'
            said = await self._command(
                'tune',
                '--quiet', self._path(rest), '--config', str(begin), '--out', str(quiet),
            )  # fmt: skip
            self.lines += said[:-1]
            begin = quiet
        else:
            self.lines.append(f'No noise is learnt: that needs {LEAST_S:g} s of rest')
        taps = self._longest('taps')
        if not taps:
            self.lines.append('No impact is learnt: nothing was tapped')
            return begin
        self.step = f'learning the impacts of {taps}'
        try:
            said = await self._command(
                'tune', *map(self._path, self._slips),
                '--taps', self._path(taps), '--config', str(begin), '--out', str(impacts),
            )  # fmt: skip
        except ValueError as error:  # Taps may look like slips: what was learnt before is kept.
            self.lines.append(str(error))
            return begin
        self.lines += said[:-1]
        return impacts

    async def _figures(self, file: Path) -> Mapping[str, Any]:
        said = await self._command(
            'evaluate',
            *map(self._path, self.held_out), '--config', str(file), '--json',
        )  # fmt: skip
        figures: dict[str, Any] = json.loads('\n'.join(said))['all']
        return figures

    def _write(self, name: str, config: DetectorConfig) -> Path:
        file = self.folder / name
        document = yaml.safe_load(config.to_yaml())
        document[f'/**/{EvaluationConfig.NODE}'] = {'ros__parameters': {'early_s': EARLY_S}}
        write_yaml(file, document, ['Written by slip_view, to tune with.'])
        return file

    def _path(self, name: str) -> str:
        return str(self._recorded.folder / name)

    def _not_held_out(self, kind: str) -> list[str]:
        return [name for name in self._recorded.of_kind(kind) if name not in self.held_out]

    def _longest(self, kind: str) -> str:
        recordings = self._recorded.recordings
        names = self._not_held_out(kind)
        return max(names, key=lambda name: recordings[name].duration_s, default='')

    async def _command(self, name: str, *arguments: str) -> list[str]:
        """Run a command to its end and return the lines that it printed.

        Parameters
        ----------
        name
            Of the function that starts it, in :mod:`slip_detector.commands.command_line`.
        arguments
            The arguments of the command.

        Raises
        ------
        ValueError
            When it fails, with the last line of what it said.
        """
        if self._ended:
            raise ValueError(self._ended)
        process = self._process = await asyncio.create_subprocess_exec(
            *_with_low_priority(), sys.executable, '-c', START.format(name=name), *arguments,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
        )  # fmt: skip
        if self._ended:  # While the process was created.
            self._signal(signal.SIGKILL)
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            printed, said = await asyncio.gather(
                process.stdout.read(), self._progress(process.stderr)
            )
            code = await process.wait()
        finally:
            self._process = None
        if code and self._ended:
            raise ValueError(self._ended)
        if code:
            last = said[-1] if said else f'slip_{name} ended with the exit code {code}'
            raise ValueError(last)
        return printed.decode(errors='replace').splitlines()

    async def _progress(self, stream: asyncio.StreamReader) -> list[str]:
        """Follow a command's progress messages; return the last lines."""
        said: list[str] = []
        while line := (await stream.readline()).decode(errors='replace'):
            said = [*said[-9:], line.strip()] if line.strip() else said
            trial = _TRIAL.match(line)
            if trial:
                self.share = int(trial[1]) / int(trial[2])
                self.step = f'searching: {trial[1]} of {trial[2]} chains tried, {trial[3]}'
        return said

    def _signal(self, number: int) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)


def compared(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Comparison]:
    """Return two sets of figures side by side.

    Examples
    --------
    >>> figures = [{**dict.fromkeys(MAIN_FIGURES), 'recall': recall} for recall in (0.8, 0.95)]
    >>> [tuple(row) for row in compared(*figures) if row.title == 'recall']
    [('recall', '0.800', '0.950', 'better')]
    """
    rows = []
    for name in MAIN_FIGURES:
        was, now = before[name], after[name]
        if name == 'auc_moving' and was is None and now is None:
            continue
        change = ''
        known = was is not None and now is not None and was != now and name != 'slips'
        # A negative latency, ON before the slip, is neither better nor worse.
        if known and not (name.startswith('latency') and min(was, now) < 0.0):
            change = 'better' if (now > was) == (name in LARGER_IS_BETTER) else 'worse'
        texts = figure_text(name, was), figure_text(name, now)
        rows.append(Comparison(heading(name), *texts, change))
    return rows


def _with_low_priority() -> Sequence[str]:
    """Return a command prefix that lowers the priority and ends the command with this process."""
    low = ['nice', '-n', '10'] if shutil.which('nice') else []
    # For the case that this process is killed and cannot end the command itself.
    dies = ['setpriv', '--pdeathsig', 'KILL'] if shutil.which('setpriv') else []
    return [*low, *dies]
