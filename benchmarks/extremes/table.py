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

"""The figures of the extremes as text."""

import textwrap
from typing import Any

from benchmarks.verdicts import verdict_in_words
from slip_detector.report.tables import number_text, text_table

#: Widest line.
COLUMNS = 99


def extremes_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.extremes.measure.measure_extremes` as text."""
    lines = [
        f'{"case":<20}{"setting":<22}{"method":<8}{"finite,":>8}{"energy":>9}{"volts":>9}'
        f'{"object":>9} reference',
        f'{"":<20}{"":<22}{"":<8}{"bounded":>8}{"created":>9}{"error":>9}{"m":>9} and its check',
    ]
    said: dict[str, int] = {}
    for row in figures['extremes']:
        start = f'{row["case"]:<20}{row["setting"]:<22}{row["method"]:<8}'
        if row['said']:
            said.setdefault(row['said'], len(said) + 1)
            lines.append(f'{start}refused, see {said[row["said"]]}')
            continue
        sound = 'yes' if row['finite'] and row['bounded'] else 'NO'
        check = row['reference_error']
        far = row['position_error_m']
        lines.append(
            f'{start}{sound:>8}{row["energy_created"]:>9.0e}{row["voltage_error"]:>9.1e}'
            f'{"-" if far is None else format(far, ".1e"):>9} {row["reference"]}'
            + ('' if check is None else f' {check:.0e}')
        )
    for text, number in said.items():
        lines += ['', *textwrap.wrap(f'{number}: {text}', 99, subsequent_indent='   ')]
    hour = figures['hour']
    lines += [
        '',
        f'{hour["simulated_s"]:g} s of sliding forth and back ({hour["cycles"]} cycles): '
        f'{"all finite" if hour["finite"] else "NOT FINITE"};',
        f'the last cycle differs from the second by {hour["drift"]:.1e} of the range, its work by '
        f'{hour["work_growth"]:.1e};',
        f'energy created {hour["energy_created"]:.0e}',
        '',
        'Wanted',
    ]
    rows = [
        (claim, number_text(entry['value'], '.2g'), entry['bound'], verdict_in_words(entry))
        for claim, entry in figures['wanted'].items()
    ]
    lines.append(text_table(rows, '<><'))
    return '\n'.join(lines)
