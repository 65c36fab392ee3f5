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
:mod:`slip_detector.report.page_data` writes. The sections below it, of
:mod:`slip_detector.report.page_sections`, can be read where scripts are off.
"""

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

from slip_detector.parameters.files import whole_file, writable_folder
from slip_detector.report.overview import Overview
from slip_detector.report.page_data import (
    SearchTrial,
    Variant,
    bin_rows,
    choose_snippets,
    pack_recording,
)
from slip_detector.report.page_sections import figures_text, sections

#: Scripts of a page; each comes after those that it needs.
SCRIPTS = (
    'uplot/uPlot.iife.min.js', 'drawing.js', 'timeline.js', 'report_data.js', 'report_lanes.js',
    'report.js',
)  # fmt: skip
STYLES = ('uplot/uPlot.min.css', 'drawing.css', 'report.css')


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
        sections='\n'.join(sections(variants, trials)),
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


def _list(lines: Iterable[str]) -> str:
    items = ''.join(f'<li>{escape(line)}</li>' for line in lines)
    return f'<ul>{items}</ul>' if items else ''
