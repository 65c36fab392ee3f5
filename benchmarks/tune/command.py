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

"""Recordings read, evaluated and searched, and what tuning brings.

Keys of ``python -m benchmarks tune --json``; with ``--part`` only the named ones are there:

``evaluate``, ``read``, ``search``
    The figures of :mod:`benchmarks.tune.hour`.
``families``
    The figures of :mod:`benchmarks.tune.families`.
``onset``
    The figures of :mod:`benchmarks.tune.onset`.
``presses``
    The figures of :mod:`benchmarks.tune.presses`.
"""

import argparse
from collections.abc import Sequence
from typing import Any

from benchmarks.measurement import Bound, shared_options
from benchmarks.tune import families, hour, onset, presses

WANTED = {
    'evaluate.ratio': Bound(high=4.0),
    'read.times_real_time': Bound(low=200.0),
    'search.ratio': Bound(high=0.5),
    'families.better': Bound(low=5.0),
    'onset.mean_delay_ms': Bound(high=15.0),
    'onset.detected_percent': Bound(low=100.0),
    'onset.false_time_percent': Bound(high=0.01),
    'onset.taps_percent': Bound(high=0.05),
    'onset.rolling_percent': Bound(high=0.05),
    'onset.fast_detected_percent': Bound(low=100.0),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'tune',
        'Measure what evaluating and reading an hour costs, a search against a chain in SciPy '
        'and NumPy; then what tuning brings on families of '
        'simulated scenes, and how soon and clean config/onset.yaml is.',
    )
    parser.add_argument(
        '--part', action='append', default=[], choices=MEASURES, help='only this one; repeatable'
    )
    parser.add_argument(
        '--seed', type=int, default=0, help='of the searches of families (default: %(default)s)'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Measure reading, evaluation and search, and what tuning brings."""
    result = {}
    for part in words.part or MEASURES:
        measure_part, *quick = MEASURES[part]
        seed = {'seed': words.seed} if part == 'families' else {}
        result[part] = measure_part(*(quick if words.quick else ()), **seed)
    return result


#: What measures each part, and its arguments if it is to be quick.
MEASURES: dict[str, Sequence[Any]] = {
    'evaluate': (hour.measure_evaluation, 50.0, 2),
    'read': (hour.measure_reading, 30.0),
    'search': (hour.measure_search, 4, 0.5),
    'families': (families.measure_families, 4, range(2), range(2, 3)),
    'onset': (onset.measure_onset, range(6000, 6001)),
    'presses': (presses.measure_presses, range(7700, 7701)),
}
