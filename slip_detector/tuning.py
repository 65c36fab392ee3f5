"""Tune the chain on labelled recordings, some of them held out: the command ``slip_tune``.

No ROS here. The search is :mod:`slip_detector.search`, its memory :mod:`slip_detector.study`; what
is handed back is judged on the recordings that the search has not seen.
"""

import argparse
import datetime
import hashlib
import importlib.util
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from slip_detector.config import (
    ChainConfig,
    DriverConfig,
    EvaluationConfig,
    TuneConfig,
)
from slip_detector.evaluation import Evaluator, recording_sets
from slip_detector.parameter_files import check_writable, with_parameters, write_file
from slip_detector.quiet import Quiet, quiet_threshold
from slip_detector.replay import Outcome, Replay, figures
from slip_detector.search import Found, Objective
from slip_detector.tracks import Track, fingerprint, held_out, track_of
from slip_detector.workers import SEARCHED, Problem, Stopper, search, search_in_processes

NAME = 'slip_tune'

TRIALS = 200

#: Of a run that shows no bar, a line is printed so often.
LINES = 10

NEEDS_OPTUNA = "needs Optuna, which is not installed: pip install 'slip_detector[tune]'"

#: The figures that the file and the printed table have, what they are called, and their format.
TABLE = {
    'slips': ('slips', 'd'),
    'recall': ('recall', '.3f'),
    'precision': ('precision', '.3f'),
    'false_alarms_per_minute': ('false alarms per minute', '.3g'),
    'latency_median_ms': ('latency, median [ms]', '.1f'),
    'latency_p90_ms': ('latency, 90th percentile [ms]', '.1f'),
    'latency_worst_ms': ('latency, worst [ms]', '.1f'),
    'auc_all': ('AUC, all rows', '.3f'),
    'auc_moving': ('AUC, rows of motion', '.3f'),
}


class Settings(NamedTuple):
    """The sections of a parameter file that tuning needs; without a file the defaults."""

    chain: ChainConfig = ChainConfig()
    driver: DriverConfig = DriverConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    tune: TuneConfig = TuneConfig()


def settings_of(file: str | None) -> Settings:
    """Read a parameter file; without one it is the defaults.

    Raises
    ------
    ValueError
        When it cannot be read or holds what is not allowed; names it.
    """
    if file is None:
        return Settings()
    return Settings(
        ChainConfig.from_yaml(file),
        DriverConfig.from_yaml(file),
        EvaluationConfig.from_yaml(file),
        TuneConfig.from_yaml(file),
    )


def load(paths: Sequence[str], settings: Settings, labelled: bool = True) -> list[Track]:
    """Read recordings, or folders of them, into the memory.

    Raises
    ------
    ValueError
        When one cannot be read or does not suit the chain; names it.
    """
    evaluator = Evaluator(settings.chain, settings.driver, settings.evaluation)
    sets = recording_sets(paths)
    tracks = []
    for name, files in sets.items():
        for file in files:
            rows, rate_hz = evaluator.open(file, labelled)
            shown = f'{name}/{file.name}' if len(sets) > 1 else file.name
            tracks.append(track_of(shown, rows, rate_hz))
    return tracks


class Verdict(NamedTuple):
    """What is handed back, and why.

    Attributes
    ----------
    chain : ChainConfig
    kept : str
        Why the given parameters are kept; empty where they are not.
    """

    chain: ChainConfig
    kept: str


def judge(problem: Problem, held: Sequence[Track], best: Found | None) -> Verdict:
    """Decide on the held-out recordings between the given chain and the best found.

    The latter is handed back where it costs less there and, unless ``trade`` is set, none of
    median latency, misses and false alarms is worse.
    """
    given = problem.given
    if best is None:
        return Verdict(given, 'no trial found a chain that tells slip')
    objective = Objective(held, problem.evaluation, problem.config)
    before, after = objective.as_it_is(given), objective.as_it_is(best.chain)
    if not after.cost_ms < before.cost_ms:
        return Verdict(
            given,
            f'on the held-out recordings the best found costs {after.cost_ms:.4g} ms against '
            f'{before.cost_ms:.4g} ms',
        )
    worse = [] if problem.config.trade else after.figures.worse_than(before.figures)
    if worse:
        return Verdict(
            given,
            f'on the held-out recordings the best found has {", ".join(worse)} (trade: true '
            f'in the section {NAME} allows that where the cost falls)',
        )
    return Verdict(best.chain, '')


def study_name(problem: Problem) -> str:
    """Return a name that another question does not have."""
    asked = (
        fingerprint(problem.tracks),
        problem.given.to_parameters(),
        problem.figures,
        problem.evaluation.to_parameters(),
        problem.config.to_parameters(),
    )
    return f'{NAME}-{hashlib.sha256(repr(asked).encode()).hexdigest()[:16]}'


class Progress:
    """Shows how far the search is and the best so far: a bar, or lines where none can be shown."""

    def __init__(self, problem: Problem, study: Any, total: int) -> None:
        from tqdm import tqdm

        self._problem, self._study, self._total = problem, study, total
        self._count = self._said = study.follow()
        self._lowest = np.inf
        self._shown = ''
        self._bar = tqdm(
            total=total, initial=self._count, unit='trial', disable=not sys.stderr.isatty(),
            file=sys.stderr, dynamic_ncols=True,
        )  # fmt: skip

    def __call__(self, count: int) -> None:
        """Show that there are so many trials."""
        best = self._problem.best(self._study)
        if best is not None and best.cost_ms < self._lowest:
            self._lowest = best.cost_ms
            self._shown = f'best {in_short(best)}'
            self._bar.set_postfix_str(self._shown, refresh=False)
        self._bar.update(count - self._count)
        self._count = count
        if self._bar.disable and count - self._said >= max(self._total // LINES, 1):
            self._said = count
            sys.stderr.write(f'{count} of {self._total} trials, {self._shown}\n')

    def close(self) -> None:
        """Leave the bar as it is."""
        self._bar.close()


def in_short(found: Found) -> str:
    """Say in few words what a chain does."""
    counts = found.figures
    latency = '-' if counts.latency_ms is None else f'{counts.latency_ms:.1f} ms'
    return (
        f'{found.cost_ms:.1f}: {latency}, {counts.missed:.0%} missed, '
        f'{counts.false_alarms_per_minute:.2g} false/min'
    )


def tune(
    problem: Problem,
    where: str,
    trials: int,
    jobs: int,
    seed: int,
    stop: Callable[[], bool],
) -> Any:
    """Search, in this process or in several, and return the study.

    Raises
    ------
    ValueError
        When the storage fails; names it.
    """
    name = study_name(problem)
    study = problem.study(where, name, seed)
    progress = Progress(problem, study, trials)
    try:
        if jobs == 1:
            search(problem, study, trials, stop, progress)
        else:
            search_in_processes(
                problem, where, name, trials, jobs, seed + 1, study, stop, progress
            )
    finally:
        progress.close()
    return study


class Replayed(NamedTuple):
    """A chain on all recordings."""

    chain: ChainConfig
    outcomes: list[Outcome]
    overviews: list[Any]


def replayed(
    chain: ChainConfig, tracks: Sequence[Track], evaluation: EvaluationConfig, shown: bool
) -> Replayed:
    """Replay recordings through a chain; with overviews for a report where it is to be shown."""
    from slip_detector.overview import MOST_CELLS, Overview

    replay = Replay(chain, evaluation)
    outcomes, overviews = [], []
    for track in tracks:
        overview = None
        if shown:
            cells = max(MOST_CELLS // len(tracks), MOST_CELLS >> 5)
            overview = Overview(
                track.name, chain, most_cells=cells, sample_rate_hz=track.sample_rate_hz
            )
        outcome = replay.run(track.rows(), track.sample_rate_hz, overview)
        outcomes.append(outcome)
        if overview is not None:
            overview.events = _events(outcome)
            overviews.append(overview)
    return Replayed(chain, outcomes, overviews)


def _events(outcome: Outcome) -> list[Any]:
    """Return what a report marks in the timeline of a recording."""
    from slip_detector.overview import Event

    events = [
        Event('false alarm', alarm.start_s, alarm.end_s)
        for alarm in outcome.alarms
        if alarm.kind == 'false'
    ]
    for slip in outcome.slips:
        kind = 'missed' if slip.alarm is None else 'late' if slip.late else 'detected'
        events.append(Event(kind, slip.start_s, slip.end_s, slip.latency_s, slip.stages_s or {}))
    return sorted(events, key=lambda event: event.start_s)


def table(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Lay the figures of the given and of the tuned chain out beside each other."""
    rows = [('', 'given', 'tuned')]
    for name, (title, form) in TABLE.items():
        if name == 'auc_moving' and before[name] is None:
            continue
        cells = [
            '-' if value is None else format(value, form) for value in (before[name], after[name])
        ]
        rows.append((title, cells[0], cells[1]))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        f'  {title.ljust(widths[0])}  {given.rjust(widths[1])}  {tuned.rjust(widths[2])}'.rstrip()
        for title, given, tuned in rows
    ]


def _listed(tracks: Sequence[Track]) -> str:
    """Name tracks, and say how much they hold."""
    slips = sum(len(track.slips) for track in tracks)
    minutes = sum(track.duration_s for track in tracks) / 60.0
    names = ', '.join(track.name for track in tracks)
    return f'{names} ({slips} slips in {minutes:.3g} min)'


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f'{NAME}: {message} ({NAME} --help says more)\n')


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog=NAME,
        description='Search the bands, stop-bands, exponent, windows, threshold, votes and common '
        'mode that catch the slips of labelled recordings soonest without false alarms. Some '
        'recordings are held out: what is handed back is never worse on them than what was given. '
        'Ctrl-C keeps what was found, and the same command goes on from there.',
    )
    parser.add_argument(
        'recordings', nargs='*', metavar='RECORDING', help='a recording or a folder of them'
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='FILE', help='the parameter file to write'
    )
    parser.add_argument('--report', type=Path, metavar='FILE', help='an HTML report to write')
    parser.add_argument(
        '--config', metavar='FILE',
        help='a ROS parameter file to begin with: what is not searched stays as it is there; the '
        f'section {NAME} has the weights (default: the defaults)',
    )  # fmt: skip
    parser.add_argument(
        '--trials', type=_at_least_one, default=TRIALS, metavar='N',
        help='how many trials the study is to have, earlier runs counted (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--jobs', type=_at_least_one, default=1, metavar='N',
        help='processes that search (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--storage', metavar='URL',
        help='where the study is kept and shared: the path of a journal (.journal), '
        'sqlite:///FILE, postgresql://USER@HOST/NAME (default: a journal beside --out)',
    )  # fmt: skip
    parser.add_argument(
        '--seed', type=int, default=0, metavar='N', help='of the search (default: %(default)s)'
    )
    held = parser.add_mutually_exclusive_group()
    held.add_argument(
        '--hold-out', type=_share, default=1 / 3, metavar='SHARE',
        help='of the recordings, or of the time of a single one, to hold out (default: a third)',
    )  # fmt: skip
    held.add_argument(
        '--held-out', action='append', default=[], metavar='RECORDING',
        help='hold out these recordings and tune on all RECORDINGs; repeatable',
    )  # fmt: skip
    quiet = parser.add_argument_group('only the threshold')
    quiet.add_argument('--quiet', metavar='RECORDING', help='a recording without slip')
    quiet.add_argument(
        '--false-alarms-per-hour', type=_rate, metavar='R', help='that are allowed, above 0'
    )
    return parser


def _at_least_one(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a whole number from 1')
    return int(text)


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = 0.0
    if not 0.0 < share < 1.0:
        raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a number between 0 and 1')
    return share


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.0 < rate < np.inf:
        raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a number above 0')
    return rate


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the arguments and see that they go together."""
    parser = _parser()
    options = parser.parse_args(argv)
    if (options.quiet is None) != (options.false_alarms_per_hour is None):
        parser.error('--quiet and --false-alarms-per-hour go together')
    if options.quiet is not None:
        for name in ('recordings', 'held_out', 'report', 'storage'):
            if getattr(options, name):
                word = 'RECORDING' if name == 'recordings' else f'--{name.replace("_", "-")}'
                parser.error(f'--quiet sets only the threshold, allowed: no {word} with it')
    elif not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --quiet)')
    return options


def _comments(argv: Sequence[str] | None, lines: Sequence[str]) -> list[str]:
    """Return what stands at the top of the file: when, how, and the given lines."""
    now = datetime.datetime.now(datetime.timezone.utc)
    words = sys.argv[1:] if argv is None else argv
    return [
        f'Written by {NAME} on {now:%Y-%m-%d %H:%M} UTC:',
        f'  {NAME} {shlex.join(words)}',
        *lines,
    ]


def _run_quiet(options: argparse.Namespace, argv: Sequence[str] | None) -> list[str]:
    """Set the threshold from a recording without slip."""
    settings = settings_of(options.config)
    check_writable(options.out)
    tracks = load([options.quiet], settings, labelled=False)
    if len(tracks) != 1:
        raise ValueError(f'{options.quiet}: has {len(tracks)} recordings, allowed: one')
    found: Quiet = quiet_threshold(
        tracks[0], settings.chain, options.false_alarms_per_hour,
        np.random.default_rng(options.seed),
    )  # fmt: skip
    lines = [f'On {tracks[0].name}, without slip: {found}']
    document = with_parameters(options.config, {'threshold': found.chain.threshold})
    write_file(options.out, document, _comments(argv, lines))
    return [*lines, f'Written: {options.out}']


def _run(options: argparse.Namespace, argv: Sequence[str] | None) -> list[str]:
    """Tune, and write what was found."""
    for module in ('optuna', 'tqdm'):
        if importlib.util.find_spec(module) is None:
            raise ValueError(NEEDS_OPTUNA.replace('Optuna', module.capitalize()))
    settings = settings_of(options.config)
    for path in (options.out, options.report):
        if path is not None:
            check_writable(path)
    tracks = load(options.recordings, settings)
    if options.held_out:
        training, held = tracks, load(options.held_out, settings)
        for part, what in ((training, 'to tune on'), (held, 'held out')):
            if not any(track.slips for track in part):
                names = ', '.join(track.name for track in part)
                raise ValueError(f'{names}: has no slip, allowed: some with slips {what}')
    else:
        training, held = held_out(tracks, options.hold_out)
    stopper = Stopper()
    with stopper.listening():
        problem = Problem(training, settings.chain, None, settings.evaluation, settings.tune)
        before = Objective(training, problem.evaluation, problem.config).as_it_is(problem.given)
        if not settings.tune.trade:
            problem = Problem(
                training, settings.chain, before.figures, settings.evaluation, settings.tune
            )
        where = options.storage or f'{options.out}.study.journal'
        study = tune(problem, where, options.trials, options.jobs, options.seed, stopper)
        return _finish(options, argv, problem, held, study, stopper.stopped)


def _finish(
    options: argparse.Namespace,
    argv: Sequence[str] | None,
    problem: Problem,
    held: Sequence[Track],
    study: Any,
    stopped: bool,
) -> list[str]:
    """Judge the best found and write the files."""
    count = study.follow()
    verdict = judge(problem, held, problem.choice(study))
    tracks = [*held, *problem.tracks]
    shown = options.report is not None
    given = replayed(problem.given, tracks, problem.evaluation, shown)
    tuned = replayed(verdict.chain, tracks, problem.evaluation, shown)
    n = len(held)
    parts = {'held out': slice(0, n), 'tuned on': slice(n, None)}
    pooled = {
        what: [figures(one.outcomes[part]) for one in (given, tuned)]
        for what, part in parts.items()
    }
    how = 'stopped early: ' if stopped else ''
    lines = [
        f'{how}{count} trials ({options.trials} asked for), seed {options.seed}',
        f'Tuned on: {_listed(problem.tracks)}',
        f'Held out, and not tuned on: {_listed(held)}',
    ]
    if verdict.kept:
        lines.append(f'The given parameters are kept: {verdict.kept}')
    lines += ['On what was held out:', *table(*pooled['held out'])]
    lines += ['On what was tuned on:', *table(*pooled['tuned on'])]
    changes = {name: verdict.chain.to_parameters()[name] for name in SEARCHED}
    write_file(options.out, with_parameters(options.config, changes), _comments(argv, lines))
    written = [str(options.out)]
    if shown:
        _write_report(options.report, lines, given, tuned, held, pooled, study)
        written.append(str(options.report))
    return [*lines, f'Written: {", ".join(written)}']


def _write_report(
    path: Path,
    notes: Sequence[str],
    given: Replayed,
    tuned: Replayed,
    held: Sequence[Track],
    pooled: dict[str, list[dict[str, Any]]],
    study: Any,
) -> None:
    """Write the report of a search."""
    from slip_detector import report
    from slip_detector.report_data import Trial, Variant

    variants = []
    for k, (name, one) in enumerate((('given', given), ('tuned', tuned))):
        rows = {f'all {what}': both[k] for what, both in pooled.items()}
        for i, (overview, outcome) in enumerate(zip(one.overviews, one.outcomes, strict=True)):
            what = 'held out' if i < len(held) else 'tuned on'
            rows[f'{overview.name} ({what})'] = outcome.figures()
        variants.append(Variant(name, one.chain, one.overviews, rows))
    trials = [
        Trial(
            trial.number,
            None if counts['latency_ms'] is None else counts['latency_ms'] / 1e3,
            counts['false_alarms_per_minute'],
            100.0 * counts['missed'],
            found['parameters'],
        )
        for trial in study.trials
        for found in trial.user_attrs['found'][:1]
        for counts in [found['figures']]
    ]
    # The table of the figures is in the report itself.
    few = [line for line in notes if not line.startswith(('  ', 'On what'))]
    report.write(path, 'Tuning of the slip detector', variants, trials, few)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of ``slip_tune``.

    Parameters
    ----------
    argv
        The arguments; those of the process if not given.

    Returns
    -------
    int
        Exit code: 0, 1 after an error, which is one line on stderr, or 130 where Ctrl-C ended it
        before anything could be written.
    """
    options = _arguments(argv)
    run = _run if options.quiet is None else _run_quiet
    try:
        lines = run(options, argv)
    except ValueError as error:
        sys.stderr.write(f'{NAME}: {error}\n')
        return 1
    except KeyboardInterrupt:
        sys.stderr.write(f'{NAME}: ended before anything was written\n')
        return 130
    print('\n'.join(lines))
    return 0


if __name__ == '__main__':
    sys.exit(main())
