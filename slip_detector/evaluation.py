"""Evaluate the chain on recordings: areas under the ROC curve, delays, false positives.

No ROS here: the chain runs over each recording as the detector node would, from its first row.

``slip_evaluate --protocol paper`` takes no recordings: it simulates the paper's three plates, ten
trials on each, and prints the paper's Table 2 beside ours; see ``slip_detector.protocol``.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from slip_detector.chain import SlipChain, SlipResult
from slip_detector.config import ChainConfig, DriverConfig, EvaluationConfig
from slip_detector.recordings import Whole, read_recording

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

NAME = 'slip_evaluate'

#: How far a recording's rate may be from that of the chain, as a share of it: beyond, the bands
#: and windows are no longer those that the configuration speaks of.
RATE_TOLERANCE = 0.02

#: More simulated trials than this are taken for a slip of the keys.
MOST_TRIALS = 1000

ENDINGS = ('.npz', '.csv')

LEGEND = '-: not defined (no rows of one of the two kinds, or no motion_key is configured)'


def decision_statistic(result: SlipResult, config: ChainConfig) -> Floats:
    """Return the number that the global decision holds against 1.

    Per group it is taken over level / threshold of the valid channels: the smallest for the vote
    ``all``, the k-th largest for a vote of k, the geometric mean for ``mean``; 0 where the group
    cannot vote. Over the groups it is the largest. Sweeping a limit over it is sweeping the
    threshold, hence it is the score of the ROC curve.

    Parameters
    ----------
    result : SlipResult
        Of n rows, with its level.
    config : ChainConfig
        Of the chain that gave it.

    Returns
    -------
    ndarray, shape (n,)
        Dimensionless; above 1 where ``result.slip``.
    """
    ratios, valid = result.level / config.threshold, result.valid
    by_group = [
        _group_statistic(ratios[:, columns], valid[:, columns], config.vote)
        for columns in (np.array(members) - 1 for members in config.groups.values())
    ]
    return np.asarray(np.max(by_group, axis=0))


def _group_statistic(ratios: Floats, valid: Bools, vote: str | int) -> Floats:
    """Return the statistic of one group of m channels; ``ratios`` and ``valid`` are (n, m)."""
    if isinstance(vote, int):
        # Channels that are not valid come last; where a valid one is wanted in their place: 0.
        return np.asarray(np.sort(np.where(valid, ratios, 0.0), axis=1)[:, -vote])
    n_valid = valid.sum(axis=1)
    if vote == 'all':
        statistic = np.where(valid, ratios, np.inf).min(axis=1)
    else:
        with np.errstate(divide='ignore'):  # The logarithm of 0 is -inf, and so is the mean.
            logarithms = np.log(np.where(valid, ratios, 1.0))
        statistic = np.exp(logarithms.sum(axis=1) / np.maximum(n_valid, 1))
    return np.where(n_valid > 0, statistic, 0.0)


def roc_auc(score: ArrayLike, label: ArrayLike) -> float | None:
    """Return the area under the ROC curve: how often a positive scores above a negative.

    Parameters
    ----------
    score : array_like, shape (n,)
        The higher, the more it says positive.
    label : array_like of bool, shape (n,)
        True for a positive.

    Returns
    -------
    float or None
        0 to 1, ties count half; None where there is no positive or no negative.

    Raises
    ------
    ValueError
        When the shapes differ or a score is not a number.
    """
    scores, positive = np.asarray(score, dtype=np.float64), np.asarray(label, dtype=bool)
    if scores.ndim != 1 or scores.shape != positive.shape:
        raise ValueError(
            f'score and label have the shapes {scores.shape} and {positive.shape}, allowed: both '
            '(n,)'
        )
    if np.isnan(scores).any():
        raise ValueError('score has NaN, allowed: numbers that can be ordered')
    pairs = int(positive.sum()) * int((~positive).sum())
    if not pairs:
        return None
    test = stats.mannwhitneyu(scores[positive], scores[~positive], method='asymptotic')
    return float(test.statistic) / pairs


def first_on_delay_s(on: ArrayLike, time_s: ArrayLike, start_s: float) -> float | None:
    """Return the time from the start of slip to the first ON at or after it.

    Parameters
    ----------
    on : array_like of bool, shape (n,)
        Decisions on one channel, group or all.
    time_s : array_like, shape (n,)
        Time of each row, rising.
    start_s : float
        When slip begins.

    Returns
    -------
    float or None
        Seconds; None where there is no such ON.
    """
    times = np.asarray(time_s, dtype=np.float64)
    after = np.flatnonzero(np.asarray(on, dtype=bool) & (times >= start_s))
    return float(times[after[0]]) - start_s if after.size else None


def mean_delay(delays: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation of the delays of the channels (the paper's Eq. 10).

    Parameters
    ----------
    delays
        Seconds, one a channel; None for a channel without.

    Returns
    -------
    mean, sd : float or None
        Over those channels that have a delay; the mean of none and the standard deviation (of
        the sample: n - 1) of fewer than two are not defined: None.
    """
    known = [delay for delay in delays if delay is not None]
    mean = float(np.mean(known)) if known else None
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else None


def false_positive_percent(on: ArrayLike, truth: ArrayLike) -> float | None:
    """Return the share of the time without slip that is ON (the paper's false positives).

    Parameters
    ----------
    on, truth : array_like of bool, shape (n,)
        Decision and true slip of each row.

    Returns
    -------
    float or None
        Percent; None where all rows have slip.
    """
    without = ~np.asarray(truth, dtype=bool)
    return float(100.0 * np.asarray(on, dtype=bool)[without].mean()) if without.any() else None


class Scored(NamedTuple):
    """Rows with their score and what is known of them.

    Attributes
    ----------
    score : ndarray, shape (n,)
        Decision statistic.
    slip : ndarray of bool, shape (n,)
        The recording's label.
    moving : ndarray of bool, shape (n,), or None
        Whether the robot moves, where the configuration says how to tell.
    """

    score: Floats
    slip: Bools
    moving: Bools | None

    def figures(self) -> dict[str, Any]:
        """Return the figures of merit by name; None where one is not defined."""
        moving = self.moving
        counted = None if moving is None else self.slip | moving
        return {
            'auc_all': roc_auc(self.score, self.slip),
            'auc_moving': None
            if counted is None
            else roc_auc(self.score[counted], self.slip[counted]),
            'rows': len(self.slip),
            'slip_rows': int(self.slip.sum()),
            'moving_rows': None if moving is None else int(moving.sum()),
        }


def pooled(parts: Sequence[Scored]) -> Scored:
    """Put the rows of several recordings, at least one, together."""
    moving = [part.moving for part in parts if part.moving is not None]
    return Scored(
        np.concatenate([part.score for part in parts]),
        np.concatenate([part.slip for part in parts]),
        np.concatenate(moving) if moving else None,
    )


class Evaluator:
    """Runs one chain over recordings, each on its own.

    Parameters
    ----------
    chain_config
        The chain's parameters.
    driver_config
        Names of the parts of a recording.
    config
        Which rows are rows of motion.
    """

    def __init__(
        self, chain_config: ChainConfig, driver_config: DriverConfig, config: EvaluationConfig
    ) -> None:
        self._chain = SlipChain(chain_config)
        self._driver_config, self._config = driver_config, config

    def score(self, path: Path) -> Scored:
        """Run the chain over a recording from its first row.

        Raises
        ------
        ValueError
            When it cannot be read, does not suit the chain or has no labels; names the file.
        """
        recording = read_recording(path, self._driver_config)
        chain, config = self._chain, self._chain.config
        if len(recording.channel_names) != config.channels:
            raise ValueError(
                f'{path}: has {len(recording.channel_names)} channels, allowed: '
                f'{config.channels}, the parameter channels'
            )
        # An npz file has no names to compare: its reader counts the channels.
        named = path.suffix == '.csv' and config.channel_names
        if named and recording.channel_names != config.channel_names:
            raise ValueError(
                f'{path}: has the channels {", ".join(recording.channel_names)}, allowed: '
                f'{", ".join(config.channel_names)}, the parameter channel_names'
            )
        rate, wanted = recording.sample_rate_hz, config.sample_rate_hz
        if abs(rate - wanted) > RATE_TOLERANCE * wanted:
            raise ValueError(
                f'{path}: has {rate:g} Hz where the parameter sample_rate_hz is {wanted:g} Hz, '
                f'allowed: at most {RATE_TOLERANCE:.0%} apart'
            )
        if recording.truth is None:
            raise ValueError(
                f'{path}: has no label {self._driver_config.recording_truth_key}, there are: '
                f'{", ".join(sorted(recording.arrays))}'
            )
        chain.reset()
        statistic = decision_statistic(chain.update(recording.volts, envelope=False), config)
        return Scored(statistic, recording.truth, self._moving(recording, path))

    def _moving(self, recording: Whole, path: Path) -> Bools | None:
        """Tell the rows of motion, shape (n,), from the recording's velocities."""
        key, arrays = self._config.motion_key, recording.arrays
        if not key:
            return None
        if key not in arrays:
            raise ValueError(f'{path}: has no array {key}, there are: {", ".join(sorted(arrays))}')
        velocities = arrays[key]
        n = len(recording.volts)
        numbers = velocities.dtype.kind in 'fiu' and velocities.ndim in (1, 2) and velocities.size
        if not numbers or len(velocities) != n:
            raise ValueError(
                f'{path}: {key} has the shape {velocities.shape} and type {velocities.dtype}, '
                f'allowed: numbers of shape ({n},) or ({n}, columns)'
            )
        table = velocities.astype(np.float64).reshape(n, -1)
        if self._config.motion_columns:
            table = table[:, self._columns(arrays.get(f'{key}_names'), table.shape[1], path)]
        if not np.isfinite(table).all():
            row = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1
            raise ValueError(f'{path}: {key} is not finite in row {row}, allowed: finite numbers')
        return np.asarray(np.linalg.norm(table, axis=1) > self._config.moving_above)

    def _columns(self, names: NDArray[Any] | None, n_columns: int, path: Path) -> list[int]:
        """Look up the configured columns of motion by their names."""
        where = f'{path}: {self._config.motion_key}_names'
        if names is None or names.shape != (n_columns,):
            found = 'is not there' if names is None else f'has the shape {names.shape}'
            raise ValueError(f'{where} {found}, allowed: a name for each of {n_columns} columns')
        known = [str(name) for name in names]
        for name in self._config.motion_columns:
            if known.count(name) != 1:
                raise ValueError(
                    f'{where} has {name} {known.count(name)} times, allowed: once; there are: '
                    f'{", ".join(known)}'
                )
        return [known.index(name) for name in self._config.motion_columns]


def recording_sets(arguments: Sequence[str]) -> dict[str, list[Path]]:
    """Sort files and folders into sets of recordings.

    Parameters
    ----------
    arguments
        Paths: a folder stands for all recordings in it, files of one folder belong together.

    Returns
    -------
    dict
        Name of each set, which is that of its folder (the whole path where two folders have the
        same name), and its files, those of a folder in the order of their names.

    Raises
    ------
    ValueError
        For a folder without recordings or a recording given twice.
    """
    by_folder: dict[Path, list[Path]] = {}
    for argument in map(Path, arguments):
        files = _recordings_in(argument) if argument.is_dir() else [argument]
        for file in files:
            mine = by_folder.setdefault(file.parent.resolve(), [])
            if file.name in [other.name for other in mine]:
                raise ValueError(f'{file}: is given twice, allowed: each once')
            mine.append(file)
    names = [folder.name for folder in by_folder]
    return {
        folder.name if folder.name and names.count(folder.name) == 1 else str(folder): files
        for folder, files in by_folder.items()
    }


def _recordings_in(folder: Path) -> list[Path]:
    try:
        files = sorted(file for file in folder.iterdir() if file.suffix in ENDINGS)
    except OSError as error:
        raise ValueError(f'{folder}: cannot be read ({error.strerror})') from None
    if not files:
        raise ValueError(f'{folder}: has no recordings, allowed: {", ".join(ENDINGS)} files')
    return files


def evaluate(arguments: Sequence[str], evaluator: Evaluator) -> dict[str, dict[str, Any]]:
    """Evaluate sets of recordings.

    Returns
    -------
    dict
        By the name of the set its figures over all rows and, under ``recordings``, those of each
        file by its name.

    Raises
    ------
    ValueError
        When a recording cannot be evaluated; names it.
    """
    report: dict[str, dict[str, Any]] = {}
    for name, files in recording_sets(arguments).items():
        scored = {file.name: evaluator.score(file) for file in files}
        report[name] = pooled(list(scored.values())).figures()
        report[name]['recordings'] = {file: part.figures() for file, part in scored.items()}
    return report


COLUMNS = ('rows', 'slip_rows', 'moving_rows', 'auc_all', 'auc_moving')
HEADS = ('rows', 'slip rows', 'moving rows', 'AUC all', 'AUC moving')


def as_tables(report: dict[str, dict[str, Any]]) -> str:
    """Write a report as one table for each set, the set as a whole in the last line."""
    tables = []
    undefined = False
    for name, whole in report.items():
        lines = [(name, *HEADS)]
        for row, figures in [*whole['recordings'].items(), ('all rows', whole)]:
            values = [figures[column] for column in COLUMNS]
            undefined |= None in values
            lines.append((row, *map(_cell, values)))
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        tables += [
            '  '.join([first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])])
            for first, *rest in lines
        ] + ['']
    return '\n'.join([*tables, LEGEND] if undefined else tables[:-1])


def _cell(value: float | None) -> str:
    if value is None:
        return '-'
    return f'{value:.3f}' if isinstance(value, float) else str(value)


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f'{NAME}: {message} ({NAME} --help says more)\n')


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog=NAME,
        description='Run the slip chain over labelled recordings and print the area under the '
        'ROC curve: of all rows, and of the rows with slip against those of motion without. Or, '
        'with --protocol paper, simulate the trials of the paper and print delays, success rate '
        'and false positives beside those that it reports, and for each figure what is wanted and '
        'whether it is met; the exit code is 0 either way.',
    )
    parser.add_argument(
        'recordings',
        nargs='*',
        metavar='RECORDING',
        help=f'a recording ({", ".join(ENDINGS)}) or a folder of them',
    )
    parser.add_argument(
        '--config',
        metavar='FILE',
        help='a ROS parameter file with the sections slip_detector, slip_driver (names of the '
        f'parts of a recording) and {NAME} (how to tell motion); else the defaults',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    protocol = parser.add_argument_group('with --protocol')
    protocol.add_argument(
        '--protocol',
        choices=('paper',),
        help='simulate, in place of recordings, the protocol of the paper: the plates of 400, 440 '
        'and 480 um, the same trials through the chain, through others of its windows and bands',
    )
    protocol.add_argument(
        '--trials',
        type=_whole_number(1, MOST_TRIALS),
        metavar='N',
        help='trials on each plate (default: 10)',
    )
    protocol.add_argument(
        '--seed',
        type=_whole_number(0, 2**31 - 1),
        metavar='FIRST',
        help='seed of the first trial, the next have the next (default: 0)',
    )
    protocol.add_argument(
        '--plot',
        nargs='?',
        const=Path('out'),
        type=Path,
        metavar='FOLDER',
        help='write the counterparts of the figures 2, 4, 5, 6 and 7 of the paper to a folder '
        '(default: out)',
    )
    return parser


def _whole_number(low: int, high: int) -> Callable[[str], int]:
    """Return what reads an argument that is a whole number."""

    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(
                f'is {text!r}, allowed: a whole number, {low} to {high}'
            )
        return int(text)

    return read


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the arguments and see that they go together."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.protocol:
        if options.recordings:
            parser.error('--protocol simulates its trials, allowed: no RECORDING with it')
        return options
    for name in ('trials', 'seed', 'plot'):
        if getattr(options, name) is not None:
            parser.error(f'--{name} is for simulated trials, allowed: with --protocol')
    if not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --protocol)')
    return options


def _of_recordings(options: argparse.Namespace) -> tuple[dict[str, Any], Callable[..., str]]:
    """Return the figures of the recordings, and what lays them out."""
    file = options.config
    evaluator = Evaluator(
        ChainConfig.from_yaml(file) if file else ChainConfig(),
        DriverConfig.from_yaml(file) if file else DriverConfig(),
        EvaluationConfig.from_yaml(file) if file else EvaluationConfig(),
    )
    return evaluate(options.recordings, evaluator), as_tables


def _of_protocol(options: argparse.Namespace) -> tuple[dict[str, Any], Callable[..., str]]:
    """Return the figures of the paper's protocol, and what lays them out."""
    # Who evaluates recordings need not load the simulation.
    from slip_detector import protocol

    config = ChainConfig.from_yaml(options.config) if options.config else ChainConfig()
    trials = protocol.TRIALS if options.trials is None else options.trials
    return protocol.run(config, trials, options.seed or 0, options.plot), protocol.table


def _print(text: str) -> int:
    """Print; a reader that stops early, like ``head``, is no error, a full disk is."""
    try:
        print(text, flush=True)
    except OSError as error:
        # What is left in the buffer must not fail again when the interpreter flushes it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 0
        sys.stderr.write(f'{NAME}: the output cannot be written ({error.strerror})\n')
        return 1
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of ``slip_evaluate``.

    Parameters
    ----------
    argv
        The arguments; those of the process if not given.

    Returns
    -------
    int
        Exit code: 0, or 1 after an error, which is one line on stderr.
    """
    options = _arguments(argv)
    try:
        report, layout = (_of_protocol if options.protocol else _of_recordings)(options)
    except ValueError as error:
        sys.stderr.write(f'{NAME}: {error}\n')
        return 1
    return _print(json.dumps(report, indent=2) if options.json else layout(report))


if __name__ == '__main__':
    sys.exit(main())
