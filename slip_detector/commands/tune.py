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

"""The command ``slip_tune``: it tunes the chain on labelled recordings, some of them held out.

It uses no ROS. :mod:`slip_detector.tuning.search` searches and stores the trials. The result is
judged on recordings that the search has not seen.
"""

import datetime
import math
import shlex
import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from typing import Any

from slip_detector.commands.command_line import run
from slip_detector.commands.progress import progress_bar
from slip_detector.commands.recording_options import paths_read, with_recording_options
from slip_detector.commands.tune_options import NAME, arguments_of
from slip_detector.commands.worker_options import (
    config_for_workers,
    paths_for_workers,
    workers_of,
)
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.parameters.files import check_apart, check_writable, writable_folder
from slip_detector.parameters.writing import with_parameters, write_file
from slip_detector.report.text_table import number_text
from slip_detector.tuning.learning import learn_from_quiet, learn_from_taps
from slip_detector.tuning.problem import Candidate, searched
from slip_detector.tuning.search import (
    TuningParameters,
    TuningResult,
    tune,
    tuning_parameters_of,
)
from slip_detector.tuning.tracks import Track, TrainingFiles

#: Number of lines on the progress of a search where no bar can be shown.
LINES = 10


class _Progress:
    """Shows the progress of a search and the best chain so far, as a bar or as lines.

    Parameters
    ----------
    total
        Number of trials that the study is to reach.
    """

    def __init__(self, total: int) -> None:
        self._total, self._count, self._told = total, 0, 0
        self._lowest_ms = math.inf
        self._shown = 'none detects slip so far'
        self._bar: Any = None

    def __call__(self, count: int, best: Candidate | None) -> None:
        """Show the number of trials so far."""
        if self._bar is None:
            self._bar = progress_bar(self._total, 'trial', count)
            self._count = self._told = count
        if best is not None and best.cost_ms < self._lowest_ms:
            self._lowest_ms = best.cost_ms
            self._shown = f'best: {in_short(best)}'
            self._bar.set_postfix_str(self._shown, refresh=False)
        self._bar.update(count - self._count)
        self._count = count
        if self._bar.disable and count - self._told >= max(self._total // LINES, 1):
            self._told = count
            sys.stderr.write(f'{count} of {self._total} trials, {self._shown}\n')

    def close(self) -> None:
        """Close the bar where it stands."""
        if self._bar is not None:
            self._bar.close()


def in_short(found: Candidate) -> str:
    """Return the figures of a chain as a short text.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> from slip_detector.tuning.problem import CandidateFigures
    >>> figures = CandidateFigures(41.0, 40.0, 0.95, 1.5, 0.25, auc=0.95)
    >>> in_short(Candidate(ChainConfig(), cost_ms=91.0, error_ms=9.0, figures=figures))
    'costs 91.0 ms, latency 41.0 ms, sooner than chance 0.95, 1.5 false/min, 0.25 % false time'
    """
    counts = found.figures
    return (
        f'costs {found.cost_ms:.1f} ms, '
        f'latency {number_text(counts.latency_median_all_ms, ".1f")} ms, '
        f'sooner than chance {number_text(counts.sooner_than_chance, ".2f")}, '
        f'{number_text(counts.false_alarms_per_minute, ".2g")} false/min, '
        f'{number_text(counts.false_time_percent, ".2g")} % false time'
    )


def _listed(tracks: Sequence[Track]) -> str:
    """Return the names of tracks, with the number of all slips and the length of all."""
    n = sum(len(track.slips) for track in tracks)
    minutes = sum(track.duration_s for track in tracks) / 60.0
    names = ', '.join(track.name for track in tracks)
    return f'{names} ({n} slip{"" if n == 1 else "s"} in {minutes:.3g} min)'


def _parameters(options: Namespace) -> TuningParameters:
    parameters = tuning_parameters_of(options.config)
    recording = config_for_workers(options, with_recording_options(parameters.recording, options))
    return parameters._replace(recording=recording)


def _comments(argv: Sequence[str] | None, lines: Sequence[str]) -> list[str]:
    """Return the comments at the top of the file: date, command, and the given lines."""
    now = datetime.datetime.now(datetime.timezone.utc)
    words = sys.argv[1:] if argv is None else argv
    return [
        f'Written by {NAME} on {now:%Y-%m-%d %H:%M} UTC:',
        f'  {NAME} {shlex.join(words)}',
        *lines,
    ]


def _learn(options: Namespace, argv: Sequence[str] | None) -> list[str]:
    """Set parameters from recordings without a search; return the lines to print."""
    parameters = _parameters(options)
    check_apart({'--out': options.out}, paths_read(options))
    check_writable(options.out)
    chain, loader = parameters.chain, parameters.loader
    if options.quiet is not None:
        learnt = learn_from_quiet(options.quiet, chain, loader, options.false_alarms_per_hour)
    else:
        learnt = learn_from_taps(options.taps, options.recordings, chain, loader)
    document = with_parameters(options.config, learnt.parameters)
    write_file(options.out, document, _comments(argv, learnt.lines))
    return [*learnt.lines, f'Written: {options.out}']


def _search(options: Namespace, argv: Sequence[str] | None) -> list[str]:
    """Search and write the result; return the lines to print."""
    parameters = _parameters(options)
    written = {'--out': options.out, '--report': options.report}
    where = options.storage or f'{options.out}.study.journal'
    check_apart(written, [*paths_read(options), where])
    check_apart({'--report': options.report}, [options.config] if options.config else [])
    for path in written.values():
        if path is not None:
            check_writable(path)
    if options.plot is not None:
        writable_folder(options.plot)
    files = TrainingFiles(
        paths_for_workers(options, options.recordings),
        parameters.loader,
        paths_for_workers(options, options.held_out),
        options.hold_out,
    )
    with workers_of(options) as workers, closing(_Progress(options.trials)) as progress:
        result = tune(
            files,
            parameters,
            options.trials,
            seed=options.seed,
            storage=where,
            progress=progress,
            calls=None if workers.here else workers.results,
        )
    return _finish(options, argv, result)


def _finish(options: Namespace, argv: Sequence[str] | None, result: TuningResult) -> list[str]:
    """Write the files; return the lines to print."""
    from slip_detector.report.tuning_report import replay_tracks, write_tuning_report
    from slip_detector.report.tuning_table import comparison_table

    problem, held, study, verdict, notes = result
    tracks = [*held, *problem.tracks]
    shown = options.report is not None or options.plot is not None
    given = replay_tracks(problem.given, tracks, problem.evaluation, shown)
    tuned = replay_tracks(verdict.chain, tracks, problem.evaluation, shown)
    n = len(held)
    parts = {'held out': slice(0, n), 'tuned on': slice(n, None)}
    both = {
        what: [figures_of_merit(one.outcomes[part]) for one in (given, tuned)]
        for what, part in parts.items()
    }
    lines = [
        *notes,
        f'{study.follow()} trials ({options.trials} asked for), seed {options.seed}',
        f'Tuned on: {_listed(problem.tracks)}',
        f'Held out, and not tuned on: {_listed(held)}',
    ]
    if verdict.kept:
        lines.append(f'The given parameters are kept: {verdict.kept}')
    for what, figures in both.items():
        lines += [f'On what was {what}:', *comparison_table(*figures).splitlines()]
    changes = {} if verdict.kept else searched(verdict.chain)
    write_file(options.out, with_parameters(options.config, changes), _comments(argv, lines))
    written = [options.out]
    if shown:
        written += write_tuning_report(
            options.report, options.plot, lines, given, tuned, held, both, study
        )
    return [*lines, f'Written: {", ".join(map(str, written))}']


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of ``slip_tune``.

    Parameters
    ----------
    argv
        The arguments; those of the process if not given.

    Returns
    -------
    int
        Exit code, see :func:`slip_detector.commands.command_line.run`.
    """
    options = arguments_of(argv)
    work = _search if options.quiet is None and options.taps is None else _learn
    return run(NAME, lambda: '\n'.join(work(options, argv)))


if __name__ == '__main__':
    sys.exit(main())
