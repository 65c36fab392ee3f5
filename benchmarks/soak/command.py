"""The subcommand ``soak``."""

import argparse

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.soak.measure import QUICK_SECONDS, SECONDS, measure_soak
from benchmarks.soak.table import soak_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'soak',
        'Run drivers and detectors as processes and watch what they lose, how their memory and '
        'latency grow and what they take of the processor. Says of each figure what is wanted and '
        'whether it is met; the exit code is 0 either way.',
    )
    parser.add_argument('--seconds', type=float, help=f'how long (default: {SECONDS:g})')
    parser.add_argument('--fingers', type=int, default=1, help='so many of each')
    parser.add_argument(
        '--samples-per-message', type=int, default=1, metavar='N',
        help='let the drivers send batches',
    )  # fmt: skip
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Let the nodes run."""
    seconds = words.seconds or (QUICK_SECONDS if words.quick else SECONDS)
    figures = {'machine': machine(), 'quick': words.quick}
    figures |= measure_soak(seconds, words.fingers, words.samples_per_message)
    return Measurement(figures, '\n\n'.join((heading(figures), soak_table(figures))))
