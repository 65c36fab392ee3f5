"""The subcommand ``chain``."""

import argparse

from benchmarks.chain.precision import measure_chain_precision
from benchmarks.chain.precision_table import chain_precision_table
from benchmarks.chain.speed import measure_chain_speed
from benchmarks.chain.speed_table import chain_speed_table
from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.pictures import draw_chain_precision
from slip_detector.report.pictures import writable_picture


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'chain',
        'Measure the run time of the chain in blocks, row by row and by number of channels, each '
        'against a rival in the same run; then its numerical error against a reference of 50 '
        'digits, beside that of float32 and of polynomials. Says of each figure what is wanted '
        'and whether it is met; the exit code is 0 either way.',
        picture='out/chain_work_precision.png',
    )
    parser.add_argument(
        '--part', choices=('all', 'speed', 'precision'), default='all', help='only one of the two'
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Measure the chain.

    Raises
    ------
    ValueError
        When a picture is asked for of what is not measured.
    """
    if words.plot and words.part == 'speed':
        raise ValueError('--plot draws the precision, allowed: --part all or precision')
    # What cannot be written is said before the measurement.
    picture = writable_picture(words.plot) if words.plot else None
    figures = {'machine': machine(), 'quick': words.quick}
    tables = [heading(figures)]
    if words.part != 'precision':
        figures |= measure_chain_speed(words.quick)
        tables.append(chain_speed_table(figures))
    if words.part != 'speed':
        precision = figures['precision'] = measure_chain_precision(words.quick)
        tables.append(chain_precision_table(precision))
        if picture:
            draw_chain_precision(picture, precision)
    return Measurement(figures, '\n\n'.join(tables))
