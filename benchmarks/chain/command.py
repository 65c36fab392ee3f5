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

"""The subcommand ``chain``."""

import argparse
from typing import Any

from benchmarks.chain.cpp_chain import NUMBA_WITHOUT_AVX512
from benchmarks.chain.precision import measure_chain_precision
from benchmarks.chain.precision_table import chain_precision_table
from benchmarks.chain.speed import measure_chain_speed
from benchmarks.chain.speed_table import chain_speed_table
from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.pictures import draw_chain_precision
from benchmarks.processes import figures_of_process
from slip_detector.parameters.files import check_writable

#: Longest time, in seconds, for a measurement of a minute or two, and for compiling.
SPEED_TIMEOUT_S = 1200.0


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
        '--without-avx512',
        action='store_true',
        help='measure the speed as on a processor that has AVX2 only',
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
        When a picture of something that is not measured is requested.
    """
    if words.plot and words.part == 'speed':
        raise ValueError('--plot draws the precision, allowed: --part all or precision')
    # A picture that cannot be written is reported before the measurement, not after it.
    picture = words.plot
    if picture:
        check_writable(picture)
    figures = {'machine': machine(), 'quick': words.quick}
    tables = [heading(figures)]
    if words.part != 'precision':
        figures |= _speed_figures(words)
        tables.append(chain_speed_table(figures))
    if words.part != 'speed':
        precision = figures['precision'] = measure_chain_precision(words.quick)
        tables.append(chain_precision_table(precision))
        if picture:
            draw_chain_precision(picture, precision)
    return Measurement(figures, '\n\n'.join(tables))


def _speed_figures(words: argparse.Namespace) -> dict[str, Any]:
    """Measure the speed; without AVX-512 in another process, as Numba reads its options once."""
    if not words.without_avx512:
        return measure_chain_speed(words.quick)
    given = ['--quick'] * words.quick
    environment = {'NUMBA_CPU_FEATURES': NUMBA_WITHOUT_AVX512}
    return figures_of_process('benchmarks.chain.speed', given, SPEED_TIMEOUT_S, environment)
