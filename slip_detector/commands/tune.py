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

"""The command ``slip_tune``.

Search the bands, stop-bands, exponent, windows, decision, threshold, votes and common mode that
catch slips of labelled recordings soonest without false alarms. Some recordings are held out: on
these the result is never worse than the given parameters. Ctrl-C ends the search with the result
so far, and the same command continues it.

It uses no ROS. :mod:`slip_detector.tuning.search` searches and stores the trials.
"""

import argparse
import datetime
import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from slip_detector.commands import workers
from slip_detector.commands.command_line import Parser, interrupts_noted, run, whole_number
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.files import read_yaml, write_yaml
from slip_detector.parameters.sections import ALL, node_of, sections_of
from slip_detector.report.tables import comparison_table, number_text
from slip_detector.tuning.learning import learn_from_quiet
from slip_detector.tuning.problem import Candidate, searched
from slip_detector.tuning.tracks import Track, TrainingFiles
from slip_detector.tuning.verdict import TuningParameters, tune

NAME = 'slip_tune'

TRIALS = 200

#: Options that only a search has.
OF_SEARCH = ('held_out', 'report', 'storage', 'jobs', 'cluster', 'press', 'roll', 'idle')

#: Options for recordings in which nothing slides, and what happens in these.
OF_KINDS = {'press': 'pressed, squeezed and let go', 'roll': 'rolled', 'idle': 'not touched'}

STOPPING = '\nstopping; results so far are kept (Ctrl-C again: end at once)\n'

#: Number of lines on the progress of a search where no bar can be shown.
LINES = 10


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read and check the arguments; end the process with the exit code 2 where they are wrong."""
    parser = Parser(prog=NAME, description=__doc__.split('\n\n')[1])
    add = parser.add_argument
    add('--out', type=Path, required=True, metavar='FILE', help='the parameter file to write')
    workers.add_options(parser, 'search')
    add(
        '--trials', type=whole_number(1), default=TRIALS, metavar='N',
        help='number of trials of the study, including earlier runs (default: %(default)s)',
    )  # fmt: skip
    add(
        '--storage', metavar='URL', help='where the study is kept and shared: the path of a '
        'journal (.journal), sqlite:///FILE, postgresql://... (default: a journal beside --out)',
    )  # fmt: skip
    add('--seed', type=int, default=0, metavar='N', help='seed (default: %(default)s)')
    add = parser.add_mutually_exclusive_group().add_argument
    add(
        '--hold-out', type=float, default=1 / 3, metavar='SHARE',
        help='share of the recordings to hold out, evenly spread and with the last (of two the '
        'second, of four the fourth), or of the time of a single one (default: 1/3)',
    )  # fmt: skip
    add(
        '--held-out', action='append', default=[], metavar='RECORDING', help='hold out this '
        'recording, or a folder of them, and tune on all other RECORDINGs; repeatable',
    )  # fmt: skip
    add = parser.add_argument_group('more to tune on, unlabelled, as nothing slides').add_argument
    for kind, happens in OF_KINDS.items():
        text = f'a recording of a finger that is {happens}, or a folder of them; repeatable'
        add(f'--{kind}', action='append', default=[], metavar='RECORDING', help=text)
    add = parser.add_argument_group('learn from a recording, without a search').add_argument
    add(
        '--quiet', metavar='RECORDING', help='a recording without slip, in which mains hum is '
        'sought and, where evidence decides, the noise floors are learnt',
    )  # fmt: skip
    add('--false-alarms-per-hour', type=float, metavar='R', help='set the threshold too, for this')
    add(
        '--taps', metavar='RECORDING', help='a recording of knocks: impact_v is set between its '
        'steps and those of the slips of the RECORDINGs',
    )  # fmt: skip
    options = parser.parse_args(argv)
    if not 0.0 < options.hold_out < 1.0:
        parser.error(f'--hold-out: is {options.hold_out:g}, allowed: a number between 0 and 1')
    rate = options.false_alarms_per_hour
    if rate is not None and not 0.0 < rate < math.inf:
        parser.error(f'--false-alarms-per-hour: is {rate:g}, allowed: a number above 0')
    if options.quiet is None and rate is not None:
        parser.error('--false-alarms-per-hour goes with --quiet')
    if options.quiet is None and not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --quiet)')
    what = 'quiet' if options.quiet is not None else 'taps'
    others = ('recordings', 'taps', *OF_SEARCH) if what == 'quiet' else OF_SEARCH
    for name in others if getattr(options, what) is not None else ():
        if getattr(options, name):
            word = 'RECORDING' if name == 'recordings' else f'--{name.replace("_", "-")}'
            parser.error(f'--{what} searches nothing, allowed: no {word} with it')
    return options


def _progress(bar: Any) -> Callable[[int, Candidate | None], None]:
    """Return a function that shows how many trials there are, and the result so far."""
    printed = 0

    def show(count: int, best: Candidate | None) -> None:
        nonlocal printed
        found = in_short(best)
        bar.set_postfix_str(found, refresh=False)
        bar.update(count - bar.n)
        if bar.disable and (count - printed) * LINES >= bar.total:
            printed = count
            sys.stderr.write(f'{count} of {bar.total} trials, {found}\n')

    return show


def in_short(found: Candidate | None) -> str:
    """Return the figures of the best chain so far, if there is one, as a short text.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> figures = {'latency_median_all_ms': 41.0, 'sooner_than_chance': 0.95}
    >>> figures |= {'false_alarms_per_minute': 1.5, 'false_time_percent': None}
    >>> in_short(Candidate(ChainConfig(), cost_ms=91.0, error_ms=9.0, figures=figures))[:46]
    'result so far: costs 91.0 ms, latency 41.0 ms,'
    """
    if found is None:
        return 'no result yet'
    figures = found.figures
    return (
        f'result so far: costs {found.cost_ms:.1f} ms, '
        f'latency {number_text(figures["latency_median_all_ms"], ".1f")} ms, '
        f'sooner than chance {number_text(figures["sooner_than_chance"], ".2f")}, '
        f'{number_text(figures["false_alarms_per_minute"], ".2g")} false/min, '
        f'{number_text(figures["false_time_percent"], ".2g")} % false time'
    )


def _names_of(tracks: Sequence[Track]) -> str:
    """Return the names of tracks, with the number of all slips and the length of all."""
    n = sum(len(track.slips) for track in tracks)
    minutes = sum(track.duration_s for track in tracks) / 60.0
    names = ', '.join(track.name for track in tracks)
    return f'{names} ({n} slip{"" if n == 1 else "s"} in {minutes:.3g} min)'


def _search(
    options: argparse.Namespace, parameters: TuningParameters, where: str, stop: Callable[[], bool]
) -> tuple[dict[str, Any], list[str], Callable[[Path], None]]:
    """Search; return what is found, lines about it, and a function that writes the report."""
    workers.make_paths_whole(options, 'recordings', 'held_out', *OF_KINDS)
    of_kinds = [(kind, path) for kind in OF_KINDS for path in getattr(options, kind)]
    held_out = options.held_out, options.hold_out
    files = TrainingFiles(options.recordings, parameters.loader, *held_out, of_kinds)
    with (
        workers.processes(options.jobs, options.cluster) as calls,
        workers.progress_bar(options.trials, 'trial') as bar,
    ):
        more: Any = {'seed': options.seed, 'storage': where, 'progress': _progress(bar)}
        more['doubt'] = lambda sentences: bar.write('\n'.join(sentences), file=sys.stderr)
        result = tune(files, parameters, options.trials, stop=stop, calls=calls, **more)
    # It takes a while to load.
    from slip_detector.report.page import replay_variant, write_page

    problem, held, study, verdict, notes = result
    parts = {'held out': held, 'tuned on': problem.tracks}
    given, tuned = (
        replay_variant(name, Replay(chain, problem.evaluation), parts)
        for name, chain in (('given', problem.given), ('tuned', verdict.chain))
    )
    lines = [
        f'{study.follow()} trials ({options.trials} asked for), {len(study.trials)} of them gave '
        f'a chain, seed {options.seed}',
        f'Tuned on: {_names_of(problem.tracks)}',
        f'Held out, and not tuned on: {_names_of(held)}',
        *notes,
    ]
    if verdict.kept:
        lines.append(f'The given parameters are kept: {verdict.kept}')
    if not tuned.figures['all held out']['recall']:
        slips = sum(len(track.slips) for track in held)
        lines.insert(0, f'The result detects none of {slips} slips that are held out')
    title, notes = 'Tuning of the slip detector', [*lines]
    for what in parts:
        figures = (one.figures[f'all {what}'] for one in (given, tuned))
        lines += [f'On what was {what}:', *comparison_table(*figures).splitlines()]
    changes = {} if verdict.kept else searched(verdict.chain)
    return changes, lines, lambda path: write_page(path, title, [given, tuned], notes)


def with_parameters(given: str | Path | None, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a parameter file with changed values for the detector.

    Parameters
    ----------
    given
        The file to start from; None: the defaults of the detector.
    changes
        New values by the name of the parameter, in the form that ROS uses (flat lists).

    Returns
    -------
    dict
        The whole document, with the sections of other nodes but without comments.

    Raises
    ------
    ValueError
        When the file cannot be read; names it.

    Examples
    --------
    >>> document = with_parameters(None, {'threshold': 0.25})
    >>> document['/**/slip_detector']['ros__parameters']['threshold']
    0.25
    """
    document = DetectorConfig().to_document() if given is None else read_yaml(given)
    sections = list(sections_of(document, given))
    own = [parameters for name, parameters in sections if node_of(name) == DetectorConfig.NODE]
    if not own:
        own = [{}]
        document['/**/slip_detector'] = {'ros__parameters': own[0]}
    for name, parameters in sections:
        # A section for all nodes that comes after the detector's would override it.
        if node_of(name) in ALL:
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return document


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
    options = _arguments(argv)

    def work() -> str:
        sets = workers.sets_of_parameters(options, *map(type, TuningParameters()[:-1]))
        parameters = TuningParameters(*sets)
        written = {'--out': options.out, '--report': options.report}
        where = options.storage or f'{options.out}.study.journal'
        workers.check_apart(written, options.labels, where)
        workers.check_apart({'--report': options.report}, options.config)
        paths = [path for path in written.values() if path is not None]
        of, rate = (parameters.chain, parameters.loader), options.false_alarms_per_hour
        with interrupts_noted(STOPPING) as stop:
            if options.quiet is not None:
                changes, lines = learn_from_quiet(options.quiet, *of, rate)
            elif options.taps is not None:
                raise ValueError
            else:
                changes, lines, write_report = _search(options, parameters, where, stop)
            now = datetime.datetime.now(datetime.timezone.utc)
            command = shlex.join([NAME, *(sys.argv[1:] if argv is None else argv)])
            comments = [f'Written by {NAME} on {now:%Y-%m-%d %H:%M} UTC:', f'  {command}', *lines]
            write_yaml(options.out, with_parameters(options.config, changes), comments)
            if options.report is not None:
                try:
                    write_report(options.report)
                except ValueError as error:
                    raise ValueError(f'{error}; {options.out} is written') from None
        return '\n'.join([*lines, f'Written: {", ".join(map(str, paths))}'])

    return run(NAME, work)
