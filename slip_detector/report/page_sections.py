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

"""The sections of a report below its timeline: figures, trade-off, filters and parameters."""

import base64
from collections.abc import Sequence
from html import escape
from typing import Any

from slip_detector.report.evaluation_tables import figure_text
from slip_detector.report.page_data import SearchTrial, Variant, trade_off_front
from slip_detector.report.text_table import text_table

UNDEFINED = '\N{EN DASH}'

#: The figures in the first table, in this order; a second table has all figures.
MAIN_FIGURES = (
    'slips', 'missed', 'late', 'recall', 'sooner_than_chance', 'precision', 'false_alarms',
    'false_alarms_per_minute', 'false_time_percent', 'latency_median_all_ms', 'latency_median_ms',
    'latency_p90_ms', 'latency_worst_ms', 'auc_all', 'auc_moving',
)  # fmt: skip

UNITS = {'ms': 'ms', 's': 's', 'percent': '%', 'hz': 'Hz', 'v': 'V'}

#: Of a longer list of numbers, such as one for each channel, only the range is shown.
MOST_NUMBERS = 8

#: Largest number of trials of the front that are listed.
MOST_LISTED = 60


def sections(variants: Sequence[Variant], trials: Sequence[SearchTrial]) -> list[str]:
    """Return the sections of a page below the timeline, as HTML.

    Parameters
    ----------
    variants, trials
        As :func:`slip_detector.report.page.write_page` takes them.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.report.overview import Overview
    >>> config = ChainConfig()
    >>> given = Variant('given', config, [Overview('rest.npz', config)], {})
    >>> [html.splitlines()[1] for html in sections([given], trials=[])]
    ['<h2>Figures</h2>', '<h2>Filter</h2>', '<h2>Parameters</h2>']
    """
    from slip_detector.report import page_pictures

    parts = [_section('Figures', _figures(variants))]
    if trials:
        parts.append(_section('Trade-off', _front(trials)))
    filters = _image(
        page_pictures.svg(page_pictures.filters_figure(variants)),
        'Response and group delay of the filters over the frequency',
    )
    parts.append(_section('Filter', filters))
    parts.append(_section('Parameters', _parameters(variants)))
    return parts


def figures_text(variants: Sequence[Variant]) -> str:
    """Return all figures as a text: a block for each recording, a line for each figure.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> figures = {'trial.npz': {'slips': 3, 'latency_median_ms': 41.25}}
    >>> print(figures_text([Variant('given', ChainConfig(), [], figures)]).splitlines()[2])
    latency median [ms]   41.2
    """
    names = _figure_names(variants)
    rows = []
    for title in _row_titles(variants):
        figures = [variant.figures.get(title, {}) for variant in variants]
        rows.append([title, *(variant.name for variant in variants)])
        rows += [
            [_heading(name), *(_cell(name, one.get(name)) for one in figures)] for name in names
        ]
        rows.append([''] * len(rows[0]))
    return '\n'.join([text_table(rows, indent=0), f'{UNDEFINED}: not defined', ''])


def _section(title: str, content: str) -> str:
    return f'<section>\n<h2>{title}</h2>\n{content}\n</section>'


def _figures(variants: Sequence[Variant]) -> str:
    names = _figure_names(variants)
    main = [name for name in MAIN_FIGURES if name in names] or names
    content = _figure_table(variants, main)
    if len(main) < len(names):
        whole = _figure_table(variants, names)
        content += f'<details><summary>All figures</summary>{whole}</details>'
    legend = f'{UNDEFINED}: not defined, as nothing of the kind occurred or it was not asked for'
    return f'{content}<p class="legend">{legend}</p>'


def _figure_table(variants: Sequence[Variant], names: Sequence[str]) -> str:
    several = len(variants) > 1
    heads = ['recording', *([''] if several else []), *map(_heading, names)]
    bodies = []
    for row in _row_titles(variants):
        lines = [
            [
                row if v == 0 else '',
                *([variant.name] if several else []),
                *(_cell(name, variant.figures.get(row, {}).get(name)) for name in names),
            ]
            for v, variant in enumerate(variants)
        ]
        kind = ' class="whole"' if row.startswith('all ') else ''
        bodies.append(f'<tbody{kind}>{"".join(map(_row, lines))}</tbody>')
    return _table(heads, ''.join(bodies), 'figures')


def _front(trials: Sequence[SearchTrial]) -> str:
    from slip_detector.report import page_pictures

    searched = [trial for trial in trials if trial.number is not None]
    best = trade_off_front(searched)
    text = (
        f'{len(searched)} trials. {len(best)} of them are on the front: no other trial is as good '
        'in latency, false alarms, false time and sooner than chance and better in one of them. '
        'The figures are those of the recordings that were tuned on.'
    )
    undefined = sum(trial.costs is None for trial in searched)
    if undefined:
        text += (
            f' {undefined} are not drawn, as one of these figures is not defined: there is no '
            'latency where no more slips were found than chance finds.'
        )
    image = _image(
        page_pictures.svg(page_pictures.front_figure(trials)),
        'Latency, false alarms and sooner than chance of all trials',
    )
    rows = [
        [
            _trial_name(trial),
            _cell('latency_ms', None if trial.latency_s is None else 1e3 * trial.latency_s),
            _cell('false_alarms_per_minute', trial.false_alarms_per_minute),
            _cell('false_time_percent', trial.false_time_percent),
            _cell('sooner_than_chance', trial.sooner_than_chance),
            ', '.join(f'{name} {_value(value)}' for name, value in trial.parameters.items()),
        ]
        for trial in [*(trial for trial in trials if trial.number is None), *best[:MOST_LISTED]]
    ]
    heads = [
        'trial', 'latency [ms]', 'false alarms per minute', 'false time [%]',
        'sooner than chance', 'parameters',
    ]  # fmt: skip
    listed = '' if len(best) <= MOST_LISTED else f' (the first {MOST_LISTED})'
    table = _table(heads, ''.join(map(_row, rows)), 'front')
    return (
        f'<p>{text}</p>{image}'
        f'<details><summary>The trials on the front{listed}</summary>{table}</details>'
    )


def _trial_name(trial: SearchTrial) -> str:
    if trial.number is None:
        return trial.mark
    return f'{trial.number} ({trial.mark})' if trial.mark else f'{trial.number}'


def _parameters(variants: Sequence[Variant]) -> str:
    columns = [variant.config.to_parameters() for variant in variants]
    rows = []
    for name in dict.fromkeys(name for column in columns for name in column):
        values = [column.get(name, UNDEFINED) for column in columns]
        cells = [_value(value) for value in values]
        differs = 'differs' if any(value != values[0] for value in values) else ''
        rows.append((_row([name, *cells], differs), differs))
    heads = ['parameter', *(variant.name for variant in variants)]
    whole = _table(heads, ''.join(row for row, _ in rows), 'parameters')
    if len(variants) == 1:
        return whole + _floors(variants)
    differing = [row for row, differs in rows if differs]
    shown = _table(heads, ''.join(differing), 'parameters') if differing else '<p>All equal.</p>'
    return f'{shown}<details><summary>All parameters</summary>{whole}</details>{_floors(variants)}'


def _floors(variants: Sequence[Variant]) -> str:
    """Return a table of noise floors that differ from channel to channel; empty without any."""
    columns = [
        variant.config.noise_floor if variant.config.decision == 'evidence' else ()
        for variant in variants
    ]
    if max(map(len, columns)) <= 1:
        return ''
    names = variants[0].overviews[0].channel_names
    # A single floor holds for all channels.
    cells = [floors * len(names) if len(floors) == 1 else floors for floors in columns]
    rows = [
        [name, *(_value(floors[c]) if floors else UNDEFINED for floors in cells)]
        for c, name in enumerate(names)
    ]
    heads = ['channel', *(variant.name for variant in variants)]
    table = _table(heads, ''.join(map(_row, rows)), 'parameters')
    return f'<details><summary>noise_floor of each channel</summary>{table}</details>'


def _table(heads: Sequence[str], rows: str, name: str) -> str:
    head = ''.join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    return (
        f'<div class="scroll"><table class="{name}"><thead><tr>{head}</tr></thead>{rows}</table>'
        '</div>'
    )


def _row(cells: Sequence[str], name: str = '') -> str:
    kind = f' class="{name}"' if name else ''
    return f'<tr{kind}>{"".join(f"<td>{escape(cell)}</td>" for cell in cells)}</tr>'


def _image(svg: str, meaning: str) -> str:
    data = base64.b64encode(svg.encode()).decode()
    return f'<img alt="{meaning}" src="data:image/svg+xml;base64,{data}">'


def _row_titles(variants: Sequence[Variant]) -> list[str]:
    return list(dict.fromkeys(row for variant in variants for row in variant.figures))


def _figure_names(variants: Sequence[Variant]) -> list[str]:
    rows = [row for variant in variants for row in variant.figures.values()]
    return list(dict.fromkeys(name for row in rows for name in row))


def _heading(name: str) -> str:
    """Return the name of a figure as a heading, with the unit, its last word, in brackets."""
    words = name.split('_')
    unit = f' [{UNITS[words.pop()]}]' if words[-1] in UNITS and len(words) > 1 else ''
    return ' '.join('AUC' if word == 'auc' else word for word in words) + unit


def _cell(name: str, value: float | str | None) -> str:
    if value is None:
        return UNDEFINED
    return value if isinstance(value, str) else figure_text(name, value)


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        if len(value) > MOST_NUMBERS and all(isinstance(one, float) for one in value):
            return f'{len(value)} numbers, {_value(min(value))} to {_value(max(value))}'
        return ' '.join(map(_value, value)) or 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)
