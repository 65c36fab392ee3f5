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

"""A report as one HTML file that needs no network, and the same figures as pictures.

The scripts in ``templates`` draw the timeline with uPlot from the data that
:mod:`slip_detector.report.page_data` writes. Everything else is laid out here and can be read
where scripts are off.
"""

import base64
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from slip_detector.parameters.files import whole_file, writable_folder
from slip_detector.report.evaluation_tables import figure_text
from slip_detector.report.overview import Overview
from slip_detector.report.page_data import (
    SearchTrial,
    Variant,
    bin_rows,
    choose_snippets,
    pack_recording,
    trade_off_front,
)
from slip_detector.report.text_table import text_table

#: Scripts of a page; each comes after those that it needs.
SCRIPTS = (
    'uplot/uPlot.iife.min.js', 'drawing.js', 'timeline.js', 'report_data.js', 'report_lanes.js',
    'report.js',
)  # fmt: skip
STYLES = ('uplot/uPlot.min.css', 'drawing.css', 'report.css')

UNDEFINED = '\N{EN DASH}'

#: The figures in the first table, in this order; a second table has all figures.
MAIN_FIGURES = (
    'slips', 'missed', 'late', 'recall', 'sooner_than_chance', 'precision', 'false_alarms',
    'false_alarms_per_minute', 'false_time_percent', 'latency_median_all_ms', 'latency_median_ms',
    'latency_p90_ms', 'latency_worst_ms', 'auc_all', 'auc_moving',
)  # fmt: skip

UNITS = {'ms': 'ms', 's': 's', 'percent': '%', 'hz': 'Hz', 'v': 'V'}

#: A list of more numbers, as of one for each channel, is told by its lowest and highest one.
MOST_NUMBERS = 8

#: How many trials of the front are listed at most.
MOST_LISTED = 60


def write_page(
    path: str | Path,
    title: str,
    variants: Sequence[Variant],
    trials: Sequence[SearchTrial] = (),
    notes: Iterable[str] = (),
) -> None:
    """Write a report as an HTML file.

    All texts are plain text: characters that have a meaning in HTML are shown as they are.

    Parameters
    ----------
    path
        The HTML file to write.
    title
        Heading of the page.
    variants
        One configuration, or two to compare: first the given one, then the tuned one.
    trials
        Trials of a search; without trials the report has no trade-off front.
    notes
        Lines below the title.

    Raises
    ------
    ValueError
        When the file cannot be written, or the variants do not show the same recordings.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector import ChainConfig, SlipChain
    >>> config, volts = ChainConfig(), [[4.3] * 16] * 380
    >>> overview = Overview('rest.npz', config)
    >>> overview.add(volts, SlipChain(config).update(volts), truth=None)
    >>> given = Variant('given', config, [overview], {'rest.npz': {'alarms': 0}})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(Path(folder) / 'report.html', 'A second of rest', [given])
    ...     '<title>A second of rest</title>' in (Path(folder) / 'report.html').read_text('utf-8')
    True
    """
    page = Template(_read('report.html')).substitute(
        title=escape(title),
        notes=_list(notes),
        css='\n'.join(map(_read, STYLES)),
        licence=_read('uplot/LICENSE.txt'),
        js='\n'.join(map(_read, SCRIPTS)),
        data=_data(variants),
        sections='\n'.join(_sections(variants, trials)),
    )
    # HTML has no NUL; a browser would drop it in one place and replace it in another.
    page = page.replace('\0', '\N{REPLACEMENT CHARACTER}')
    with whole_file(path) as new:
        new.write_text(page, encoding='utf-8', errors='backslashreplace')


def write_pictures(
    folder: str | Path, variants: Sequence[Variant], trials: Sequence[SearchTrial] = ()
) -> list[Path]:
    """Write the pictures of a report as PNG files, and its table as text.

    Parameters
    ----------
    folder
        Where the files are written; it is made if it does not exist.
    variants, trials
        As :func:`write_page` takes them.

    Returns
    -------
    list of Path
        The files: ``timeline_<recording>.png`` for each recording, ``filters.png``,
        ``front.png`` where there are trials, and ``figures.txt``.

    Raises
    ------
    ValueError
        When a file cannot be written, or the variants do not show the same recordings.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector import ChainConfig
    >>> config = ChainConfig()
    >>> given = Variant('given', config, [Overview('rest.npz', config)], {})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in write_pictures(folder, [given])]
    ['timeline_rest.npz.png', 'filters.png', 'figures.txt']
    """
    from slip_detector.report import page_pictures

    recordings = _recordings(variants)
    names = [variant.name for variant in variants]
    folder, paths = writable_folder(Path(folder)), []
    for r, overviews in enumerate(recordings):
        number = f'{r + 1}_' if len(recordings) > 1 else ''
        paths.append(folder / f'timeline_{number}{_file_name(overviews[0].name)}.png')
        page_pictures.png(page_pictures.timeline_figure(names, overviews), paths[-1])
    paths.append(folder / 'filters.png')
    page_pictures.png(page_pictures.filters_figure(variants), paths[-1])
    if trials:
        paths.append(folder / 'front.png')
        page_pictures.png(page_pictures.front_figure(trials), paths[-1])
    paths.append(folder / 'figures.txt')
    with whole_file(paths[-1]) as new:
        new.write_text(figures_text(variants), encoding='utf-8', errors='backslashreplace')
    return paths


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


def _file_name(text: str) -> str:
    return ''.join(c if c.isalnum() or c in '._-' else '_' for c in text)[:80]


def _recordings(variants: Sequence[Variant]) -> list[list[Overview]]:
    """Return the overviews of each recording, one for each variant."""
    first = variants[0].overviews
    for variant in variants:
        same = len(variant.overviews) == len(first) and all(
            (a.name, a.rows, a.config.channels) == (b.name, b.rows, b.config.channels)
            for a, b in zip(variant.overviews, first, strict=True)
        )
        if not first or not same:
            shown = ', '.join(overview.name for overview in variant.overviews) or 'no recording'
            raise ValueError(f'{variant.name}: shows {shown}, allowed: the same for all variants')
    return [list(overviews) for overviews in zip(*(v.overviews for v in variants), strict=True)]


def _read(name: str) -> str:
    return resources.files('slip_detector.report').joinpath(f'templates/{name}').read_text('utf-8')


def _data(variants: Sequence[Variant]) -> str:
    """Return what the scripts read: a header as JSON, and the data of each recording."""
    recordings = _recordings(variants)
    chosen = choose_snippets(recordings)
    packed = [
        pack_recording(*parts)
        for parts in zip(recordings, bin_rows(recordings), chosen, strict=True)
    ]
    header = {
        'variants': [variant.name for variant in variants],
        'recordings': [header for header, _ in packed],
    }
    # Only '<' can end a script element; JSON may write it as an escape.
    text = json.dumps(header, separators=(',', ':'), allow_nan=False).replace('<', '\\u003c')
    blocks = [f'<script type="application/json" id="header">{text}</script>']
    blocks += [
        f'<script type="text/plain" id="data-{r}">{data}</script>'
        for r, (_, data) in enumerate(packed)
    ]
    return '\n'.join(blocks)


def _sections(variants: Sequence[Variant], trials: Sequence[SearchTrial]) -> list[str]:
    from slip_detector.report import page_pictures

    sections = [_section('Figures', _figures(variants))]
    if trials:
        sections.append(_section('Trade-off', _front(trials)))
    filters = _image(
        page_pictures.svg(page_pictures.filters_figure(variants)),
        'Response and group delay of the filters over the frequency',
    )
    sections.append(_section('Filter', filters))
    sections.append(_section('Parameters', _parameters(variants)))
    return sections


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
    # One floor is for all channels.
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


def _list(lines: Iterable[str]) -> str:
    items = ''.join(f'<li>{escape(line)}</li>' for line in lines)
    return f'<ul>{items}</ul>' if items else ''


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
