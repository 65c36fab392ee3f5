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

"""The subcommand ``scenes``."""

import argparse
from collections.abc import Mapping
from typing import Any

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.pictures import draw_scenes_precision
from benchmarks.scenes.measure import PLATE, measure_scenes
from benchmarks.verdicts import verdict_in_words
from slip_detector.parameters.files import check_writable
from slip_detector.report.tables import number_text, text_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'scenes',
        "Measure errors and run times of the live stepper and of SciPy's integrators on the "
        'shipped scenes against a tight reference. '
        'Prints what is wanted and whether it is met; the exit code is 0 either way.',
        picture='out/scenes_work_precision.png',
    )
    parser.add_argument(
        '--scene',
        action='append',
        default=[],
        metavar='NAME',
        help='measure only this scene; repeatable',
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Measure the scenes."""
    # A picture that cannot be written is reported before the measurement, not after it.
    picture = words.plot
    if picture:
        check_writable(picture)
    figures = {'machine': machine(), 'quick': words.quick}
    figures |= measure_scenes(words.quick, words.scene)
    if picture:
        draw_scenes_precision(picture, figures)
    return Measurement(figures, '\n\n'.join((heading(figures), _tables(figures))))


def _tables(figures: Mapping[str, Any]) -> str:
    """Return the figures as text."""
    rows: list[tuple[str, ...]] = [('scene', 'ms per s', 'x real time')]
    rows += [
        (entry['scene'], f'{entry["run_time_per_s"] * 1e3:.2f}', f'{entry["speed"]:.0f}')
        for entry in figures['costs']
    ]
    pace = figures['pace']
    tables = [
        text_table(rows),
        f'Slowest read of {pace["rows"]} rows of {PLATE}: {pace["slowest_share"]:.1%} of '
        f'the time they last; mean {pace["mean_share"]:.1%}',
    ]
    for entry in figures['precision']:
        title = f'{entry["scene"]}: {entry["simulated_s"]:g} s, {entry["states"]} states'
        if entry['note']:
            tables.append(f'{title}\n  {entry["note"]}')
            continue
        reference = entry['reference']
        shipped = {**entry['shipped_live'], 'method': 'shipped'}
        rows = [('method', 'setting', 'volts', 'object m', 'ms per s')]
        for run in (shipped, *entry['runs']):
            errors = (
                number_text(run[key], '.1e') for key in ('voltage_error', 'position_error_m')
            )
            taken_s = run['run_time_per_s']
            last = run['said'] if taken_s is None else f'{taken_s * 1e3:.2f}'
            rows.append((run['method'], run['setting'], *errors, last))
        tables.append(
            f'{title}\n  reference {reference["method"]}, from which {reference["check"]} differs '
            f'by {reference["voltage_error"]:.1e} of the range\n{text_table(rows, "<<>")}'
        )
    rows = [
        (claim, number_text(entry['value'], '.3g'), entry['bound'], verdict_in_words(entry))
        for claim, entry in figures['wanted'].items()
    ]
    return '\n\n'.join([*tables, 'Wanted\n' + text_table(rows, '<><')])
