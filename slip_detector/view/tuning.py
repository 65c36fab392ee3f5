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


"""Tunes a detector on the recordings of the live page, in a process of low priority."""

import asyncio
import contextlib
import functools
import itertools
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.commands.command_line import interrupts_noted
from slip_detector.commands.tune import in_short
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.files import writable_folder, write_yaml
from slip_detector.report.tables import figure_text, heading, main_figures
from slip_detector.tuning.learning import learn_from_quiet
from slip_detector.tuning.problem import Candidate, searched
from slip_detector.tuning.tracks import TrainingFiles
from slip_detector.tuning.verdict import TuningParameters, tune
from slip_detector.view.detectors import OF_THE_CHAIN, Values, to_decide_as
from slip_detector.view.recordings import RecordedFolder

#: Number of chains that the search tries.
TRIALS = 200

#: Figures of which larger is better; of all others, smaller is better.
LARGER_IS_BETTER = ('recall', 'coverage', 'sooner_than_chance', 'precision', 'auc_all')

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

#: What a page shows of a run as it is.
DESCRIBED = 'finger', 'running', 'step', 'share', 'lines', 'table', 'kept'

#: How much the search gives way to the nodes.
NICE = 10

#: Title, figure of the running and of the tuned detector, 'better', 'worse' or ''.
Row = tuple[str, str, str, str]


class TuneJob(NamedTuple):
    """What the process is to do."""

    running: Values
    #: By kind the names of recordings to tune on, the longest last; and of all that are held out.
    to_tune_on: dict[str, list[str]]
    held_out: list[str]
    #: A line on each recording that is left out, as its rate is another.
    left_out: list[str]
    #: Where the recordings are; parameter files are written in a folder in it.
    folder: Path
    trials: int

    def paths(self, names: Iterable[str]) -> list[str]:
        """Return the paths of recordings."""
        return [str(self.folder / name) for name in names]


class TuneRun:
    """One run of the search on the recordings of a finger.

    Noise is learnt from rest and impacts from taps; a search begins with what was learnt. Then the
    running and the tuned detector are compared on the held-out recordings.

    Raises
    ------
    ValueError
        When there are too few recordings.
    """

    def __init__(self, recorded: RecordedFolder, finger: str, config: DetectorConfig) -> None:
        to_tune_on, self.held_out = recorded.divided()
        if not any(name.startswith('slip') for name in self.held_out):
            slips = len(to_tune_on['slip'])
            raise ValueError(f'there are {slips} recordings of slips, allowed: two or more')
        self.finger, self._config = finger, config
        for names in to_tune_on.values():
            names.sort(key=lambda name: recorded.recordings[name].duration_s)
        off = [(name, recorded.off_rate(name)) for name in recorded.recordings]
        left_out = [f'{name} is left out: it {words}' for name, words in off if words]
        values = config.to_parameters()
        job = TuneJob(values, to_tune_on, self.held_out, left_out, recorded.folder, TRIALS)
        context = multiprocessing.get_context('spawn')
        self._connection, child = context.Pipe()
        self._process = context.Process(target=work, args=(job, child), daemon=True)
        self._process.start()
        child.close()
        #: Whether it has not ended, and was stopped.
        self.running, self.stopping = True, False
        #: What is left out, what was learnt, and which steps did not work.
        self.lines = left_out
        #: The present step, why the run failed, and why what was found should not be applied.
        self.step = self.failed = self.kept = ''
        #: Share of the search that is done, 0 to 1.
        self.share = 0.0
        #: The running and the tuned detector side by side.
        self.table: list[Row] = []
        #: The tuned parameters, once they were compared.
        self.found: DetectorConfig | None = None

    async def run(self) -> None:
        """Note what the process reports until it ends; an error is noted in ``failed``."""
        with contextlib.suppress(EOFError, ConnectionResetError):  # The process has ended.
            while True:
                vars(self).update(await asyncio.to_thread(self._connection.recv))
        if self.found is None and not self.failed:
            self.failed = 'the search ended before it was done, the log of slip_view says why'
        await asyncio.to_thread(self._process.join)
        self._connection.close()
        self.running, self.step = False, ''

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
        return to_decide_as(self.found, config)

    def stop(self) -> None:
        """Stop the search; the best chain so far is judged and kept."""
        if self.running and not self.stopping:
            self.stopping = True
            with contextlib.suppress(OSError):  # It has just ended.
                self._connection.send('stop')

    def kill(self) -> None:
        """End the process at once; the run then fails."""
        self._process.kill()

    def described(self) -> dict[str, Any]:
        """Return the state of the run, for the page."""
        return {
            **{name: getattr(self, name) for name in DESCRIBED},
            'stopping': self.stopping and self.running,
            'failed': '' if self.running else self.failed,
            'changes': len(self.to_apply(self._config)),
        }


def work(job: TuneJob, connection: Connection) -> None:
    """Do a job, as the only thing of this process; report changes of the run's attributes."""
    os.setsid()  # Ctrl-C in the terminal is for slip_view.
    os.nice(NICE)
    try:
        with interrupts_noted() as stop:
            threading.Thread(target=_obey, args=(connection,), daemon=True).start()
            _tune(job, lambda **changes: connection.send(changes), stop)
    except KeyboardInterrupt:
        connection.send({'failed': 'stopped before anything was found'})
    except ValueError as error:
        connection.send({'failed': str(error)})


def _obey(connection: Connection) -> None:
    """Interrupt the search when it is to stop; end when slip_view has ended, even if killed."""
    try:
        while connection.recv():
            os.kill(os.getpid(), signal.SIGINT)
    except (EOFError, OSError):
        os._exit(1)


def _tune(job: TuneJob, report: Callable[..., None], stop: Callable[[], bool]) -> None:
    """Learn, search and compare."""
    folder = writable_folder(job.folder / 'tuning')
    begin, lines = learnt(job, beginning(DetectorConfig.from_parameters(job.running)), report)
    _write(folder / 'begin.yaml', begin)
    running = _parameters(job.running).chain
    parameters = _parameters(begin)._replace(running=running)

    def progress(count: int, best: Candidate | None) -> None:
        tried = f'{count} of {job.trials} chains tried'
        report(share=count / job.trials, step=f'searching: {tried}, {in_short(best)}')

    report(step='searching')
    to_tune_on = job.paths(itertools.chain(*job.to_tune_on.values()))
    files = TrainingFiles(to_tune_on, parameters.loader, job.paths(job.held_out))
    journal = str(folder / 'tuned.yaml.study.journal')
    calls: Any = {'progress': progress, 'doubt': lambda said: report(lines=lines + said)}
    result = tune(files, parameters, job.trials, storage=journal, stop=stop, **calls)
    report(step='comparing on what was held out', lines=lines + result.notes)
    kept, tried = result.verdict.kept, result.verdict.tried
    tuned = {**begin, **searched(tried)} if tried else job.running

    _write(folder / 'tuned.yaml', job.running if kept else tuned)
    outcomes = (
        [replay.run(one.rows(), one.sample_rate_hz) for one in result.held]
        for replay in (Replay(running), Replay(_parameters(tuned).chain))
    )
    table = compared(*map(figures_of_merit, outcomes))
    report(found=DetectorConfig.from_parameters(tuned), table=table, kept=kept)


def beginning(config: DetectorConfig) -> Values:
    """Return where learning begins: the present parameters, or those for a new sensor.

    Examples
    --------
    >>> beginning(DetectorConfig())['passband_hz']
    [20.0, 0.0]
    """
    if config.decision == 'evidence':
        return config.to_parameters()
    low_hz = min(LOW_HZ, LOW_SHARE * config.sample_rate_hz)
    vote = min(2, *map(len, config.groups.values()))
    return {**config.to_parameters(), **NEW_SENSOR, 'passband_hz': [low_hz, 0.0], 'vote': vote}


def learnt(job: TuneJob, begin: Values, report: Callable[..., None]) -> tuple[Values, list[str]]:
    """Learn noise and impacts if there are recordings of them; return parameters and lines."""
    slips = job.paths(job.to_tune_on['slip'])
    steps: list[tuple[str, str, Callable[..., tuple[Values, list[str]]]]] = [
        ('noise', 'rest', learn_from_quiet),
    ]
    lines = job.left_out
    for what, kind, learn in steps:
        if not job.to_tune_on[kind]:
            lines = [*lines, f'No {what} learnt: there is no recording for that']
            continue
        name = job.to_tune_on[kind][-1]
        report(lines=lines, step=f'learning the {what} of {name}')
        path, parameters = str(job.folder / name), _parameters(begin)
        try:
            found, more = learn(path, chain=parameters.chain, loader=parameters.loader)
            begin, lines = {**begin, **found}, lines + more
        except ValueError as error:  # Taps may look like slips: what was learnt before is kept.
            lines = [*lines, str(error)]
    report(lines=lines)
    return begin, lines


def _parameters(values: Values) -> TuningParameters:
    chain = {n: value for n, value in values.items() if n.partition('.')[0] in OF_THE_CHAIN}
    return TuningParameters(ChainConfig.from_parameters(chain))


def _write(file: Path, values: Values) -> None:
    document = DetectorConfig.from_parameters(values).to_document()
    write_yaml(file, document, ['Written by slip_view, which has tuned.'])


def compared(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Row]:
    """Return two sets of figures side by side, each with its title and 'better' or 'worse'.

    Of what finds no slip nothing is better; and the latency of the slips found is neither where
    more of them are missed, as it falls where late ones are.

    Examples
    --------
    >>> compared({'recall': 0.8}, {'recall': 0.95})
    [('recall', '0.800', '0.950', 'better')]
    """
    rows, recalls = [], [one.get('recall') or 0.0 for one in (before, after)]
    for name in main_figures([before, after]):
        was, now, change = before[name], after[name], ''
        known = was is not None and now is not None and was != now and 'slips' not in name
        # A negative latency, ON before the slip, is neither better nor worse.
        if known and not (name.startswith('latency') and min(was, now) < 0.0):
            change = 'better' if (now > was) == (name in LARGER_IS_BETTER) else 'worse'
        late_missed = name.startswith('latency') and '_all' not in name and recalls[1] < recalls[0]
        if change == 'better' and (late_missed or not recalls[1]):
            change = ''
        rows.append((heading(name), figure_text(name, before), figure_text(name, after), change))
    return rows
