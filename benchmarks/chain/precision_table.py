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

"""The figures of the chain's precision as text."""

import textwrap
from collections.abc import Callable
from typing import Any

from benchmarks.verdicts import claim_in_words

TABLE_COLUMNS = 99

#: Heads of the methods' columns, by method; the chain's comes first.
COLUMNS = {
    'chain': 'chain',
    'sections float64': 'float64',
    'sections float32': 'float32',
    'polynomials float64': 'float64',
    'polynomials float32': 'float32',
}


def chain_precision_table(figures: dict[str, Any]) -> str:
    """Return the figures as text.

    Parameters
    ----------
    figures
        Result of :func:`benchmarks.chain.precision.measure_chain_precision`.
    """

    def claim(name: str) -> str:
        verdict = figures['wanted'][name]
        return f"  the chain's worst: {verdict['value']:.1e} {claim_in_words(verdict)}"

    lines = [
        f'Precision    worst error of the level as a share of the largest one, against '
        f'{figures["digits"]} digits',
        '             "run": of the chain with its float64 coefficients taken as exact',
        '',
        *_heads(f'  {"rate":>7} {"band":>6} {"stop-bands [Hz]":<15}'),
    ]
    for entry in figures['rates']:
        stops = ' '.join(_band(pair) for pair in entry['stopbands_hz'])
        lead = f'  {entry["sample_rate_hz"]:7g} {_band(entry["passband_hz"]):>6} {stops:<15}'
        lines.append(lead + _error_cells(entry))
    lines += [claim('rates.error'), *_wrapped(figures['rates_note'], '  ')]
    lines += ['', '  ns a row of 16 channels, taking turns']
    for entry in figures['rates']:
        cells = (f'{entry["methods"][name]["ns_per_row"]:9.0f}' for name in COLUMNS)
        first, *rest = cells
        lines.append(f'  {entry["sample_rate_hz"]:7g} {"":22}{first}{"":9}{"".join(rest)}')
    network = ''
    for entry in figures['edges']:
        if entry['network'] != network:
            network = entry['network']
            lines += ['', f'  {network}, at {entry["sample_rate_hz"]:g} Hz']
            lines += _heads(f'  {"edge / rate":>11}  {"largest pole":<19}')
        if entry['refused']:
            lines += _wrapped(f'refused: {entry["refused"]}', f'  {entry["edge_share"]:11.2e}  ')
            continue
        lead = f'  {entry["edge_share"]:11.2e}  {entry["largest_pole_radius"]:<19.9f}'
        lines.append(lead + _error_cells(entry))
    lines.append(claim('edges.error'))
    long = figures['long_run']
    lines += ['', '  error over the last period after ... rows at 380 Hz']
    lines.append(f'  {"":22}' + ''.join(f'{rows:14,}' for rows in long['rows']))
    for name, method in long['methods'].items():
        errors = ''.join(f'{_figure(worst):>14}' for worst in method['errors'])
        lines.append(f'  {name:<22}{errors}')
    lines += [claim('long_run.error'), '', '  extremes']
    for entry in figures['extremes']:
        worst = '' if entry['error'] is None else f'error {_figure(entry["error"])}'
        said = ', '.join(part for part in (worst, entry['found']) if part)
        others = '; '.join(f'{name} {_figure(value)}' for name, value in entry['others'].items())
        said += '' if entry['finite'] else ', NOT finite'
        lines += _wrapped(
            f'{said}; rivals: {others}' if others else said, f'  {entry["case"]:<44} '
        )
    slow = figures['slow_down']
    return '\n'.join(
        [
            *lines,
            claim('extremes.error'),
            *_evidence_lines(figures['evidence'], claim),
            f'  time a row, as a multiple of an ordinary one: denormal input '
            f'{slow["denormal_input"]:.2f},',
            f'  a pulse decayed to denormals {slow["decay_to_denormals"]:.2f}',
        ]
    )


def _evidence_lines(part: dict[str, Any], claim: Callable[[str], str]) -> list[str]:
    lines = ['', '  evidence: worst errors of floor and excess in dB, of the evidence as a share']
    lines.append(f'  {"rate":>9} {"floor":>9} {"excess":>9} {"evidence":>9}  other decisions')
    for entry in part['rates']:
        errors = (entry['floor_error_db'], entry['excess_error_db'], entry['level_error'])
        cells = ' '.join(f'{error:9.1e}' for error in errors)
        lines.append(
            f'  {entry["sample_rate_hz"]:9g} {cells}  {entry["differing_decisions"]} of '
            f'{entry["rows"]:,} rows'
        )
    lines += [claim('evidence.level_error'), '  of its logarithm, in dB']
    lines.append(claim('evidence.logarithm_error_db'))
    lines += [
        f'  drift in {entry["rows"]:,} rows at {entry["sample_rate_hz"]:g} Hz: floor '
        f'{entry["floor_drift_db"]:.1e} dB, evidence of {entry["evidence_db_s"]:,.0f} dB s '
        f'{entry["drift_db_s"]:.1e}'
        for entry in part['slides']
    ]
    lines.append(claim('evidence.drift_db'))
    for entry in part['extremes']:
        said = entry['found'] + ('' if entry['finite'] else ', NOT finite or out of bounds')
        lines += _wrapped(said, f'  {entry["case"]:<44} ')
    return [*lines, '']


def _band(edges_hz: tuple[float, float]) -> str:
    return f'{edges_hz[0]:g}-{edges_hz[1]:g}'


def _figure(worst: float | None) -> str:
    return 'not finite' if worst is None else f'{worst:.1e}'


def _heads(lead: str) -> list[str]:
    """Return the two lines above columns of errors; the column ``run`` is also the chain's."""
    first, *rest = COLUMNS.values()
    return [
        f'{"":{len(lead) + 18}}{"SciPy sections":>18}{"SciPy polynomials":>18}',
        lead + ''.join(f'{head:>9}' for head in (first, 'run', *rest)),
    ]


def _error_cells(entry: dict[str, Any]) -> str:
    cells = [
        entry['methods'][name]['state'] or _figure(entry['methods'][name]['error'])
        for name in COLUMNS
    ]
    cells.insert(1, _figure(entry['run_error']))
    return ''.join(f'{cell:>9}' for cell in cells)


def _wrapped(text: str, lead: str) -> list[str]:
    return textwrap.wrap(
        text, TABLE_COLUMNS, initial_indent=lead, subsequent_indent=' ' * len(lead)
    )
