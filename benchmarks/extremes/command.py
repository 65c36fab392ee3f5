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

"""The subcommand ``extremes``."""

import argparse
import textwrap
from collections.abc import Mapping
from typing import Any

from benchmarks.extremes.measure import measure_extremes
from benchmarks.measurement import Measurement, machine, shared_options
from benchmarks.verdicts import verdict_in_words
from slip_detector.report.tables import number_text, text_table


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    return shared_options(
        'extremes',
        'Run the simulated fingertip in extreme cases: whether all results are finite and '
        'bounded, the error against a tight reference, and what is refused with which message. '
        '--quick slides for a minute instead of an hour.',
    )


def run(words: argparse.Namespace) -> Measurement:
    """Measure the extremes."""
    figures = {'machine': machine(), 'quick': words.quick} | measure_extremes(words.quick)
    return Measurement(figures, _tables(figures))


def _tables(figures: Mapping[str, Any]) -> str:
    """Return the figures as text."""
    rows = [('case', 'setting', 'finite, bounded', 'volts error', 'object m', 'reference, check')]
    said = list(dict.fromkeys(row['said'] for row in figures['extremes'] if row['said']))
    for row in figures['extremes']:
        if row['said']:
            refused = f'refused, see {said.index(row["said"]) + 1}'
            rows.append((row['case'], row['setting'], refused, '', '', ''))
            continue
        sound = 'yes' if row['finite'] and row['bounded'] else 'NO'
        errors = (number_text(row[key], '.1e') for key in ('voltage_error', 'position_error_m'))
        check = number_text(row['reference_error'], '.0e')
        rows.append((row['case'], row['setting'], sound, *errors, f'{row["reference"]}, {check}'))
    reasons = [
        textwrap.fill(f'{number}: {text}', 99, subsequent_indent='   ')
        for number, text in enumerate(said, start=1)
    ]
    hour = figures['hour']
    cycles = (
        f'{hour["simulated_s"]:g} s of sliding forth and back ({hour["cycles"]} cycles): '
        f'{"all finite" if hour["finite"] else "NOT FINITE"}; the last cycle differs from the '
        f'second by {hour["drift"]:.1e} of the range'
    )
    wanted = [
        (claim, number_text(entry['value'], '.2g'), entry['bound'], verdict_in_words(entry))
        for claim, entry in figures['wanted'].items()
    ]
    parts = [text_table(rows, '<<<>><'), *reasons, cycles, 'Wanted\n' + text_table(wanted, '<><')]
    return '\n\n'.join(parts)
