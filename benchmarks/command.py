"""The command line of the benchmarks, and what they share.

A machine's speed differs from hour to hour, a ratio of two things that take turns hardly does. So
every claim on speed is a ratio: the two sides take turns (A B A B ...) and the least time of each
counts, which is the one that nothing disturbed.

``slip_benchmark chain --json`` prints one object:

``machine``
    ``cores``, ``system``, ``processor``, ``python``, ``numpy``, ``scipy``, ``numba`` (null where
    missing) and ``compiled``.
``quick``
    Whether the sizes were cut short.

With these come the keys of :mod:`benchmarks.chain_speed`, and ``precision`` with the
keys of :mod:`benchmarks.chain_precision`, unless ``--part`` leaves them out. Those
of ``scenes``, ``extremes``, ``tune`` and ``soak`` are in the modules of these names in
:mod:`benchmarks`.
"""

import argparse
import contextlib
import gc
import importlib
import json
import os
import platform
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

#: What the subcommands are added to.
Commands: TypeAlias = 'argparse._SubParsersAction[argparse.ArgumentParser]'


class Bound(NamedTuple):
    """What is wanted of a figure."""

    relation: str
    value: float

    def met(self, figure: float) -> bool:
        """Return whether a figure is as wanted."""
        if self.relation == '>=':
            return figure >= self.value
        return figure <= self.value if self.relation == '<=' else figure < self.value

    def __str__(self) -> str:
        return f'{self.relation} {self.value:g}'


def machine() -> dict[str, Any]:
    """Return what the figures depend on."""
    import scipy

    from slip_detector.chain.compiled import COMPILED

    numba = importlib.import_module('numba').__version__ if COMPILED else None
    return {
        'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.release()}',
        'processor': platform.processor() or platform.machine(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'scipy': scipy.__version__,
        'numba': numba,
        'compiled': COMPILED,
    }


def least_times_s(sides: list[Callable[[], None]], rounds: int) -> list[float]:
    """Let the sides take turns and return the least time of each.

    Each side runs once before, unmeasured, to have its memory and caches in place.
    """
    for side in sides:
        side()
    least_s = [float('inf')] * len(sides)
    with gc_off():
        for _ in range(rounds):
            for i, side in enumerate(sides):
                start_s = time.perf_counter()
                side()
                least_s[i] = min(least_s[i], time.perf_counter() - start_s)
    return least_s


@contextlib.contextmanager
def gc_off() -> Iterator[None]:
    """Keep the collector out: when it runs depends on all that was done before."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def verdicts(
    bounds: Mapping[str, Bound], values: Mapping[str, float | None], judged: bool = True
) -> dict[str, dict[str, Any]]:
    """Hold each claim's figure against what is wanted of it: ``value``, ``bound`` and ``met``.

    Value and met are None where it was not measured; met is also None where the measurement was
    too short to be judged.
    """
    return {
        claim: {
            'value': value,
            'bound': str(bound),
            'met': bound.met(value) if judged and value is not None else None,
        }
        for claim, bound in bounds.items()
        for value in (values[claim],)
    }


def verdict_words(entry: Mapping[str, Any]) -> str:
    """Say whether a claim of :func:`verdicts` is met; nothing where it was not measured."""
    if entry['value'] is None:
        return ''
    return {None: 'not judged', True: 'met', False: 'NOT met'}[entry['met']]


def heading(result: dict[str, Any]) -> str:
    """Say on which machine and how was measured: the first lines of every table."""
    facts = result['machine']
    how = f'Numba {facts["numba"]}' if facts['compiled'] else 'no Numba: interpreted'
    return '\n'.join(
        (
            f'Machine      {facts["cores"]} cores, {facts["processor"]}, {facts["system"]}',
            f'             Python {facts["python"]}, NumPy {facts["numpy"]}, '
            f'SciPy {facts["scipy"]}, {how}',
            'Ratios are of times taken in turns, the least of all rounds for each side'
            + (' (--quick: few and short).' if result['quick'] else '.'),
        )
    )


class Report(NamedTuple):
    """What a subcommand has measured.

    Attributes
    ----------
    result : dict
        What ``--json`` prints.
    text : str
        The same as tables.
    """

    result: dict[str, Any]
    text: str


def shared_options(picture: str = '') -> argparse.ArgumentParser:
    """Return the options that all subcommands have, to be a parent of a subcommand's parser.

    Parameters
    ----------
    picture
        What ``--plot`` without a file writes; a subcommand that draws nothing has no such option.
    """
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument('--json', action='store_true', help='print one JSON object instead')
    options.add_argument('--quick', action='store_true', help='short and rough, for tests')
    if picture:
        options.add_argument(
            '--plot', metavar='FILE', nargs='?', const=picture,
            help='draw the error against run time (default FILE: %(const)s)',
        )  # fmt: skip
    return options


def add_chain(commands: Commands) -> None:
    """Add the subcommand ``chain``."""
    command = commands.add_parser(
        'chain',
        parents=[shared_options('out/chain_work_precision.png')],
        help='run time and numerical error of the chain',
        description='Measure the run time of the chain in blocks, row by row and by number of '
        'channels, each against a rival in the same run, and the latency and processor time of '
        'the detector node against those of a bare relay; then its numerical error against a '
        'reference of 50 digits, beside that of float32 and of polynomials. Says of each figure '
        'what is wanted and whether it is met; the exit code is 0 either way.',
    )
    command.add_argument('--without-ros', action='store_true', help='leave the nodes out')
    command.add_argument(
        '--part', choices=('all', 'speed', 'precision'), default='all', help='only one of the two'
    )
    command.set_defaults(run=run_chain)


def run_chain(words: argparse.Namespace) -> Report:
    """Measure the chain.

    Raises
    ------
    ValueError
        When a picture is asked for of what is not measured.
    """
    from benchmarks import chain_precision, chain_precision_table, chain_speed

    if words.plot and words.part == 'speed':
        raise ValueError('--plot draws the precision, allowed: --part all or precision')
    if words.plot:  # what cannot be written is said before the measurement
        from slip_detector.report.plots import draw_chain_precision, writable_picture

        picture = writable_picture(words.plot)
    result = {'machine': machine(), 'quick': words.quick}
    texts = [heading(result)]
    if words.part != 'precision':
        result |= chain_speed.measure(words.quick, not words.without_ros)
        texts.append(chain_speed.table(result))
    if words.part != 'speed':
        precision = result['precision'] = chain_precision.measure(words.quick)
        texts.append(chain_precision_table.table(precision))
    if words.plot:
        draw_chain_precision(picture, precision)
    return Report(result, '\n\n'.join(texts))


def add_scenes(commands: Commands) -> None:
    """Add the subcommand ``scenes``."""
    command = commands.add_parser(
        'scenes',
        parents=[shared_options('out/scenes_work_precision.png')],
        help='error of the simulated fingertip against run time',
        description="Measure errors and run times of the live stepper and of SciPy's integrators "
        'on the shipped scenes against a tight reference, and what each part of a scene costs. '
        'Says of each figure what is wanted and whether it is met; the exit code is 0 either way.',
    )
    command.add_argument(
        '--scene', action='append', default=[], metavar='NAME', help='only this one; repeatable'
    )
    command.set_defaults(run=run_scenes)


def run_scenes(words: argparse.Namespace) -> Report:
    """Measure the scenes."""
    from benchmarks import scenes

    if words.plot:  # what cannot be written is said before the measurement
        from slip_detector.report.plots import draw_scenes_precision, writable_picture

        picture = writable_picture(words.plot)
    result = {'machine': machine(), 'quick': words.quick}
    result |= scenes.measure(words.quick, tuple(words.scene))
    if words.plot:
        draw_scenes_precision(picture, result)
    return Report(result, '\n\n'.join((heading(result), scenes.table(result))))


def add_extremes(commands: Commands) -> None:
    """Add the subcommand ``extremes``."""
    command = commands.add_parser(
        'extremes',
        parents=[shared_options()],
        help='stiff and extreme cases of the simulated fingertip',
        description='Run the simulated fingertip at its extremes: whether all stays finite and '
        'bounded, whether friction creates energy, the error against a tight reference, and what '
        'is refused in which words. --quick runs a minute in place of an hour.',
    )
    command.set_defaults(run=run_extremes)


def run_extremes(words: argparse.Namespace) -> Report:
    """Run the extremes."""
    from benchmarks import extremes

    result = {'machine': machine(), 'quick': words.quick} | extremes.measure(words.quick)
    return Report(result, extremes.table(result))


def add_soak(commands: Commands) -> None:
    """Add the subcommand ``soak``."""
    command = commands.add_parser(
        'soak',
        parents=[shared_options()],
        help='drivers and detectors left to themselves',
        description='Run drivers and detectors as processes and watch what they lose, how their '
        'memory and latency grow and what they take of the processor. Says of each figure what '
        'is wanted and whether it is met; the exit code is 0 either way.',
    )
    command.add_argument('--seconds', type=float, help='how long (default: 11 minutes)')
    command.add_argument('--fingers', type=int, default=1, help='so many of each')
    command.add_argument(
        '--samples-per-message',
        type=int,
        default=1,
        metavar='N',
        help='let the drivers send batches',
    )
    command.set_defaults(run=run_soak)


def run_soak(words: argparse.Namespace) -> Report:
    """Let the nodes run."""
    from benchmarks import soak

    seconds = words.seconds or (soak.QUICK_SECONDS if words.quick else soak.SECONDS)
    result = {'machine': machine(), 'quick': words.quick}
    result |= soak.measure(seconds, words.fingers, words.samples_per_message)
    return Report(result, '\n\n'.join((heading(result), soak.table(result))))


def add_tune(commands: Commands) -> None:
    """Add the subcommand ``tune``."""
    command = commands.add_parser(
        'tune',
        parents=[shared_options()],
        help='recordings read, evaluated, searched and reported; what tuning brings',
        description='Measure what evaluating and reading an hour costs, a search against the same '
        'around SciPy and NumPy, and the report of an hour; then what tuning brings on families '
        'of simulated scenes and, where they are given, on real recordings. Says of each figure '
        'what is wanted and whether it is met; the exit code is 0 either way.',
    )
    command.add_argument(
        '--part', action='append', default=[], metavar='NAME',
        help='only this one: evaluate, read, search, report, families or real; repeatable',
    )  # fmt: skip
    command.add_argument(
        '--recordings', metavar='FOLDER', type=Path, help='for real: labelled recordings'
    )
    command.add_argument(
        '--config', metavar='FILE', type=Path, help='for real: the parameters to begin with'
    )
    command.set_defaults(run=run_tune)


def run_tune(words: argparse.Namespace) -> Report:
    """Measure the tuner and what is around it.

    Raises
    ------
    ValueError
        For an unknown part, or one that lacks its recordings.
    """
    from benchmarks import tune

    result = {'machine': machine(), 'quick': words.quick}
    result |= tune.measure(words.quick, words.part, words.recordings, words.config)
    return Report(result, '\n\n'.join((heading(result), tune.table(result))))


#: The subcommands: each function adds one, with its options and, as ``run``, what it does. What
#: a subcommand imports is imported when it runs.
COMMANDS: tuple[Callable[..., None], ...] = (
    add_chain,
    add_scenes,
    add_extremes,
    add_tune,
    add_soak,
)


def _terminated(number: int, frame: FrameType | None) -> None:
    """Turn the signal into an exception, so that what was started is ended."""
    sys.exit(128 + number)


def main(arguments: list[str] | None = None) -> int:
    """Entry point of ``slip_benchmark``."""
    parser = argparse.ArgumentParser(
        prog='slip_benchmark', description='Measure how fast and how exact the package is.'
    )
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for add in COMMANDS:
        add(commands)
    words = parser.parse_args(arguments)
    before = signal.signal(signal.SIGTERM, _terminated)
    try:
        report = words.run(words)
        print(json.dumps(report.result, indent=2) if words.json else report.text)
    except KeyboardInterrupt:
        return 130
    except (RuntimeError, OSError, ValueError) as error:
        print(f'slip_benchmark: {error}', file=sys.stderr)
        return 1
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0


if __name__ == '__main__':
    sys.exit(main())
