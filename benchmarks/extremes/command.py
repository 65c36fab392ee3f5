"""The subcommand ``extremes``."""

import argparse

from benchmarks.extremes.measure import measure_extremes
from benchmarks.extremes.table import extremes_table
from benchmarks.measurement import Measurement, machine, shared_options


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    return shared_options(
        'extremes',
        'Run the simulated fingertip in extreme cases: whether all results are finite and '
        'bounded, whether friction creates energy, the error against a tight reference, and what '
        'is refused with which message. --quick slides for a minute instead of an hour.',
    )


def run(words: argparse.Namespace) -> Measurement:
    """Measure the extremes."""
    figures = {'machine': machine(), 'quick': words.quick} | measure_extremes(words.quick)
    return Measurement(figures, extremes_table(figures))
