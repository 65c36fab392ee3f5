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

"""The subcommand ``tune``."""

import argparse

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.tune.measure import measure_tuning
from benchmarks.tune.table import tuning_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'tune',
        'Measure what evaluating and reading an hour costs, a search against the same around '
        'SciPy and NumPy, and the report of an hour; then what tuning brings on families of '
        'simulated scenes and on a new sensor, and how '
        'soon and clean config/onset.yaml is. Says of each figure what is wanted and whether it '
        'is met; the exit code is 0 either way.',
    )
    parser.add_argument(
        '--part', action='append', default=[], metavar='NAME',
        help='only this one: evaluate, read, jobs, search, report, families, sensor or '
        'onset; repeatable',
    )  # fmt: skip
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Measure reading, evaluation, search and report, and what tuning brings.

    Raises
    ------
    ValueError
        For an unknown part.
    """
    figures = {'machine': machine(), 'quick': words.quick}
    figures |= measure_tuning(words.quick, words.part)
    return Measurement(figures, '\n\n'.join((heading(figures), tuning_table(figures))))
