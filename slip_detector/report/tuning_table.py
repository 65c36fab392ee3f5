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

"""The figures of a search as text."""

from collections.abc import Mapping
from typing import Any

from slip_detector.report.text_table import number_text, text_table

#: Name and format of each figure in the table.
FIGURES = {
    'slips': ('slips', 'd'),
    'recall': ('recall', '.3f'),
    'sooner_than_chance': ('sooner than chance', '.3f'),
    'precision': ('precision', '.3f'),
    'false_alarms_per_minute': ('false alarms per minute', '.3g'),
    'false_time_percent': ('ON without slip [% of the rest]', '.3g'),
    'latency_median_all_ms': ('latency, median of all, missed ones last [ms]', '.1f'),
    'latency_median_ms': ('latency, median of those detected [ms]', '.1f'),
    'latency_p90_ms': ('latency, 90th percentile [ms]', '.1f'),
    'latency_worst_ms': ('latency, worst [ms]', '.1f'),
    'auc_all': ('AUC, all rows', '.3f'),
    'auc_moving': ('AUC, rows of motion', '.3f'),
}


def comparison_text(name: str, value: float | None) -> str:
    """Return one of the figures as it stands in a comparison.

    A latency below 0 is no early detection: ``slip`` was ON before its label, for example from an
    unrelated alarm. The text says so.

    Examples
    --------
    >>> comparison_text('latency_median_ms', 41.25), comparison_text('latency_median_ms', -96.3)
    ('41.2', 'ON 96.3 before')
    """
    form = FIGURES[name][1]
    if name.startswith('latency') and value is not None and value < 0.0:
        return f'ON {number_text(-value, form)} before'
    return number_text(value, form)


def comparison_table(given: Mapping[str, Any], tuned: Mapping[str, Any]) -> str:
    """Return the figures of the given and of the tuned chain beside each other, as text.

    Parameters
    ----------
    given, tuned
        Figures as :func:`slip_detector.evaluation.figures.figures_of_merit` returns them.

    Examples
    --------
    >>> given, tuned = ({**dict.fromkeys(FIGURES), 'recall': recall} for recall in (0.8, 0.95))
    >>> print(comparison_table(given, tuned).splitlines()[2])
      recall                                         0.800  0.950
    """
    rows = [('', 'given', 'tuned')]
    for name, (title, _) in FIGURES.items():
        if name == 'auc_moving' and given[name] is None:
            continue
        rows.append(
            (title, comparison_text(name, given[name]), comparison_text(name, tuned[name]))
        )
    return text_table(rows)
