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

"""The subcommand ``soak``."""

import argparse

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.soak.measure import PARTS, measure_soak
from benchmarks.soak.table import soak_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'soak',
        'Run drivers and detectors as processes and watch what they lose, how their memory and '
        'latency grow and what they take of the processor; the detector against a bare relay too. '
        'Says of each figure what is wanted and whether it is met; the exit code is 0 either way.',
    )
    parser.add_argument('--part', choices=('all', *PARTS), default='all', help='only one of them')
    times = ', '.join(f'{name} {part.seconds:g}' for name, part in PARTS.items())
    parser.add_argument(
        '--seconds', type=float, help=f'how long each part runs (default: {times})'
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Let the nodes run."""
    figures = {'machine': machine(), 'quick': words.quick}
    parts = list(PARTS) if words.part == 'all' else [words.part]
    figures |= measure_soak(parts, words.quick, words.seconds)
    return Measurement(figures, '\n\n'.join((heading(figures), soak_table(figures))))
