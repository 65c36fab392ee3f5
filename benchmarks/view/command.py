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

"""The subcommand ``view``."""

import argparse

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.view.measure import SECONDS, measure_view
from benchmarks.view.table import view_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'view',
        'Show five fingers at 380 Hz on the live page, in Chromium and to a program that draws '
        'nothing; measure frames, memory and processor time, and the latency of the detectors '
        'with and without. Says of each figure what is wanted and whether it is met; the exit '
        'code is 0 either way.',
    )
    parser.add_argument(
        '--seconds',
        type=float,
        help=f'how long the page is open in Chromium (default: {SECONDS:g}); 3600 for a soak',
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Let the page run."""
    figures = {'machine': machine(), 'quick': words.quick}
    figures |= measure_view(words.quick, words.seconds)
    return Measurement(figures, '\n\n'.join((heading(figures), view_table(figures))))
