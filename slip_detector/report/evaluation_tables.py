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

"""The figures of ``slip_evaluate`` as tables of text."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from slip_detector.evaluation.figures import ALREADY_ON, STAGES
from slip_detector.report.text_table import UNDEFINED, text_table

Cells = tuple[str, ...]


class TableSection(NamedTuple):
    """One table.

    Attributes
    ----------
    title : str
        Heading of the first column; if empty, the name of the set.
    columns : dict
        Headings of the other columns by the names of their figures.
    optional : bool
        Whether the table is left out where all figures of the set are 0 or not defined.

    Examples
    --------
    >>> TableSection('Time', {'duration_s': 'duration [s]'}).optional
    False
    """

    title: str
    columns: dict[str, str]
    optional: bool = False


TABLE_SECTIONS = (
    TableSection(
        '',
        {
            'rows': 'rows',
            'slip_rows': 'slip rows',
            'moving_rows': 'moving rows',
            'settling_rows': 'settling rows',
            'auc_all': 'AUC all',
            'auc_moving': 'AUC moving',
        },
    ),
    TableSection(
        "as the paper's",
        {
            'mean_delay_ms': 'mean delay [ms]',
            'sd_delay_ms': 'sd [ms]',
            'success_percent': 'success [%]',
            'false_positive_percent': 'false positives [%]',
        },
    ),
    TableSection(
        'slips',
        {
            'slips': 'slips',
            'settling_slips': 'while settling',
            'matched': 'detected',
            'late': 'of them late',
            'missed': 'missed',
            'recall': 'recall',
            'recall_by_chance': 'by chance',
            'sooner_than_chance': 'sooner than chance',
        },
    ),
    TableSection(
        'latency',
        {
            'latency_median_all_ms': 'median of all [ms]',
            'latency_median_ms': 'of the detected: median [ms]',
            'latency_p90_ms': 'p90 [ms]',
            'latency_worst_ms': 'worst [ms]',
        },
    ),
    TableSection(
        'alarms',
        {
            'alarms': 'alarms',
            'settling_alarms': 'while settling',
            'repeated_alarms': 'repeated',
            'false_alarms': 'false',
            'precision': 'precision',
            'precision_by_chance': 'by chance',
        },
    ),
    TableSection(
        'rest',
        {
            'rest_s': 'rest [s]',
            'false_alarms_per_minute': 'false alarms a minute',
            'false_time_percent': 'ON without slip [%]',
            'false_time_s_per_hour': '[s an hour]',
        },
    ),
    TableSection(
        'mean latency, by stage',
        {f'{stage}_ms': f'{stage} [ms]' for stage in STAGES},
        True,
    ),
    TableSection(
        'of the late ones',
        {f'late_{stage}_ms': f'{stage} [ms]' for stage in STAGES},
        True,
    ),
    TableSection(
        'missed slips, lost at',
        {
            **{f'missed_at_{stage}': stage for stage in STAGES},
            f'missed_{ALREADY_ON}': 'already ON',
        },
        True,
    ),
    TableSection(
        'faults',
        {
            'bad_samples': 'bad samples',
            'gaps': 'gaps bridged',
            'bridged_rows': 'rows bridged',
            'long_gaps': 'long gaps',
            'dropped': 'rows dropped',
        },
        True,
    ),
)

#: The texts about a recording; each is printed as a line.
NOTES = ('lost', 'doubts')

#: Printed where the section of faults is left out.
NO_FAULTS = '{}: no bad samples, no gaps, no rows dropped'

LEGEND = f'{UNDEFINED}: not defined (no such rows or events, or the motion is not recorded)'


def evaluation_tables(report: Mapping[str, Any]) -> str:
    """Return a report of ``slip_evaluate`` as tables; the last line of each is the whole set.

    Parameters
    ----------
    report
        As :func:`slip_detector.commands.evaluate.as_report` returns it.

    Examples
    --------
    >>> from slip_detector.evaluation.evaluator import recording_figures
    >>> figures = recording_figures([])
    >>> report = {'sets': {'trials': {**figures, 'recordings': {}}}, 'all': figures}
    >>> evaluation_tables(report).splitlines()[1].split()
    ['all', 'rows', '0', '0', '-', '0', '-', '-']
    """
    blocks: list[list[Cells]] = []
    notes = []
    for name, whole in report['sets'].items():
        blocks += _tables(name, {**whole['recordings'], 'all rows': whole}, whole)
        files = whole['recordings'].items()
        if not any(whole[column] for column in TABLE_SECTIONS[-1].columns):
            notes.append(NO_FAULTS.format(name))
        notes += [f'{file}: {one[key]}' for file, one in files for key in NOTES if one[key]]
    if len(report['sets']) > 1:
        blocks += _tables('all sets', {**report['sets'], 'all rows': report['all']}, report['all'])
    if any(cell == UNDEFINED for block in blocks for line in block for cell in line):
        notes.append(LEGEND)
    if 'not_evaluated' in report:
        notes.append(f'Stopped early, not evaluated: {", ".join(report["not_evaluated"])}')
    if 'written' in report:
        notes.append(f'Written: {", ".join(report["written"])}')
    return '\n\n'.join([*(text_table(block, indent=0) for block in blocks), '\n'.join(notes)])


def _tables(
    name: str, rows: Mapping[str, Mapping[str, Any]], whole: Mapping[str, Any]
) -> list[list[Cells]]:
    """Return the cells of the table of each section; all first columns are equally wide."""
    width = max(map(len, [name, *rows, *(section.title for section in TABLE_SECTIONS)]))
    return [
        [
            ((section.title or name).ljust(width), *section.columns.values()),
            *(
                (
                    row.ljust(width),
                    *(figure_text(column, figures[column]) for column in section.columns),
                )
                for row, figures in rows.items()
            ),
        ]
        for section in TABLE_SECTIONS
        if not section.optional or any(whole[column] for column in section.columns)
    ]


def figure_text(name: str, value: float | None) -> str:
    """Return a figure as text, with the digits that its name asks for.

    Examples
    --------
    >>> figure_text('sd_ms', 41.26), figure_text('recall', 0.95), figure_text('auc', None)
    ('41.3', '0.950', '-')
    """
    if value is None:
        return UNDEFINED
    if isinstance(value, int):
        return str(value)
    if name.endswith('_ms'):
        return f'{value:.1f}'
    if name.endswith(('_s', '_per_hour')):
        return f'{value:.1f}'
    return f'{value:.2f}' if name.endswith(('_percent', '_per_minute')) else f'{value:.3f}'
