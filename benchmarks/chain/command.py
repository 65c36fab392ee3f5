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

"""The subcommand ``chain``, with the figures of its modules ``speed`` and ``precision``."""

import argparse
from pathlib import Path
from typing import Any

from benchmarks.chain.precision import measure_chain_precision
from benchmarks.chain.speed import measure_chain_speed
from benchmarks.measurement import Bound, shared_options
from benchmarks.pictures import draw_work_precision

#: What is wanted, by part and figure.
WANTED = {
    'blocks.speedup': Bound(low=10.0),
    'blocks.kept_ratio': Bound(high=1.5),
    'blocks.whole_kept_ratio': Bound(high=1.5),
    'blocks.median_ratio': Bound(high=2.0),
    'blocks.evidence_ratio': Bound(high=2.0),
    'blocks.contact_ratio': Bound(high=1.3),
    'one_row.speedup': Bound(low=13.8),
    'precision.rates_error': Bound(high=1e-8),
    'precision.edges_error': Bound(high=1e-7),
    'precision.long_run_error': Bound(high=1e-12),
    'precision.extremes_error': Bound(high=1e-6),
    'precision.evidence_error': Bound(high=1e-4),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'chain',
        'Measure the run time of the chain in blocks and row by row, each '
        'against a rival in the same run; then its numerical error against a reference of 50 '
        'digits, beside that of float32 and of polynomials, and the run time of each.',
        picture='chain_work_precision.png',
    )
    parser.add_argument(
        '--part', choices=('all', 'speed', 'precision'), default='all', help='only one of the two'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Measure the chain."""
    parts: dict[str, Any] = {}
    if words.part != 'precision':
        parts |= measure_chain_speed(words.quick)
    if words.part != 'speed':
        parts['precision'] = measure_chain_precision(words.quick)
        if words.plot:
            draw(words.plot, parts['precision']['rates'])
    return parts


def draw(path: Path, rates: list[dict[str, Any]]) -> None:
    """Draw the error of each method, at most 1, against its run time, in a panel for each rate."""
    panels = {
        f'{entry["sample_rate_hz"]:g} Hz': {
            name: [(min(error, 1.0), entry['ns_per_row'][name] * 1e-3)]
            for name, error in entry['errors'].items()
        }
        for entry in rates
    }
    error_label = 'error of the level / its largest value (1: lost)'
    draw_work_precision(path, panels, error_label, 'time a row of 16 channels [µs]')
