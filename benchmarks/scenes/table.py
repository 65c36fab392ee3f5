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

"""The figures of the scenes as text."""

from collections.abc import Mapping
from typing import Any

from benchmarks.scenes.measure import PLATE
from benchmarks.verdicts import verdict_in_words
from slip_detector.report.tables import number_text, text_table

#: Widest line.
COLUMNS = 99


def _short(value: float | None, unit: float = 1.0) -> str:
    return '-' if value is None else f'{value / unit:.1e}'


def scenes_table(figures: Mapping[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.scenes.measure.measure_scenes` as text."""
    lines = ['Run time for a simulated second; share of it that remains without a part']
    for entry in figures['costs']:
        left = ', '.join(
            f'{part} {"needed" if cost["said"] else format(cost["share"], ".0%")}'
            for part, cost in entry['without'].items()
        )
        lines.append(
            f'{entry["scene"]:<13}{entry["run_time_per_s"] * 1e3:6.2f} ms'
            f'{entry["speed"]:5.0f} x real time  without {left}'
        )
    pace = figures['pace']
    lines += [
        '',
        f'Slowest read of {pace["rows"]} rows of {PLATE}: {pace["slowest_share"]:.1%} of '
        f'the time they last; mean {pace["mean_share"]:.1%}',
    ]
    for entry in figures['precision']:
        lines += ['', f'{entry["scene"]}: {entry["simulated_s"]:g} s, {entry["states"]} states']
        if not entry['runs']:
            lines.append(f'  {entry["note"]}')
            continue
        reference = entry['reference']
        lines.append(
            f'  reference {reference["method"]} at rtol {reference["rtol"]:g}; '
            f'{reference["check"]} differs by {_short(reference["voltage_error"])} of the range, '
            f'{_short(reference["onset_error_s"], 1e-3)} ms, '
            f'{_short(reference["position_error_m"])} m'
        )
        lines.append(
            f'  {"method":<8}{"setting":<20}{"from to s":<14}{"volts":>9}{"onset ms":>10}'
            f'{"object m":>10}{"ms per s":>11}'
        )
        for run in entry['runs']:
            over = f'{run["over"][0]:.2f} {run["over"][1]:.2f}'
            start = f'  {run["method"]:<8}{run["setting"]:<20}{over:<14}'
            if run['said']:
                lines.append(start + run['said'][: COLUMNS - len(start)])
                continue
            # What is below the reference's own error is not known.
            known = run['voltage_error'] >= reference['voltage_error']
            volts = ('' if known else '<') + _short(
                run['voltage_error'] if known else reference['voltage_error']
            )
            lines.append(
                f'{start}{volts:>9}{_short(run["onset_error_s"], 1e-3):>10}'
                f'{_short(run["position_error_m"]):>10}{run["run_time_per_s"] * 1e3:>11.2f}'
            )
        worst = entry['front']
        shipped = entry['shipped_live']
        lines.append(
            f'  as shipped ({shipped["setting"]}): {_short(shipped["voltage_error"])} of the '
            f'range, {shipped["run_time_per_s"] * 1e3:.2f} ms per s'
        )
        if worst is None:
            lines.append(f'  {entry["note"]}')
        elif worst['ratio'] is not None:
            lines.append(
                f'  time of live / best of the others at the same error, 1e-3 and above: '
                f'{worst["ratio"]:.2f} ({worst["against"]})'
            )
    lines += ['', 'Wanted']
    rows = [
        (claim, number_text(entry['value'], '.3g'), entry['bound'], verdict_in_words(entry))
        for claim, entry in figures['wanted'].items()
    ]
    lines.append(text_table(rows, '<><'))
    return '\n'.join(lines)
