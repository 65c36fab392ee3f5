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

"""A report as one HTML file that needs no network.

The scripts in ``templates`` draw the timeline. They read one JSON, which has for each recording a
string of bytes, compressed and in base64: of the bins the lowest volts, the highest volts and, for
each variant, the codes of the levels, channel after channel. Volts are 16-bit codes over the range
of the channel, all low bytes before all high ones, as slow signals compress better in this order.
"""

import base64
import json
import time
import zlib
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation import evaluator
from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import name_list, whole_file
from slip_detector.recordings import by_number
from slip_detector.report import texts
from slip_detector.report.overview import OUTCOMES, Codes, Overview, Volts
from slip_detector.tuning.tracks import Track

#: Scripts of a page; each comes after the scripts that it needs.
SCRIPTS = ('numbers.js', 'drawing.js', 'timeline.js', 'bins.js', 'report_lanes.js', 'report.js')
STYLES = ('drawing.css', 'report.css')

#: Code of a bin without samples, and the highest code of a channel's range. Finer steps would make
#: the file larger and would not be seen: a channel has some 40 pixels in the timeline.
NO_SAMPLE, MOST_CODE = 0xFFFF, 2**14 - 1

#: The figures that carry the answer, and the figures of each recording.
MAIN_FIGURES = 'slips', 'matched', 'latency_median_ms', 'false_alarms', 'false_time_percent'
RECORDING_FIGURES = *MAIN_FIGURES, 'false_alarms_per_minute', 'late', 'coverage'


class Variant(NamedTuple):
    """One configuration of the chain, with its overviews and figures of all recordings.

    Attributes
    ----------
    name : str
        For example ``given`` or ``tuned``.
    overviews : sequence of Overview
        One for each recording, in the same order for all variants.
    figures : mapping
        Figures of all recordings together, then of each recording, by its name; None where one is
        not defined.
    """

    name: str
    overviews: Sequence[Overview]
    figures: Mapping[str, Mapping[str, Any]]


def write_page(
    path: str | Path,
    title: str,
    variants: Sequence[Variant],
    sentences: Sequence[str] = (),
    notes: Sequence[str] = (),
    config: str | Path | None = None,
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
        One configuration, or two to compare, the result last. Both show the same recordings, at
        least one.
    sentences
        Lines below the title: first the :func:`.answer`, then what matters most.
    notes
        What else the reader may want to know.
    config
        The file of the configuration; None: there is none.

    Raises
    ------
    ValueError
        When the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.chain.samples import Samples
    >>> overview = Overview('rest.npz', ChainConfig())
    >>> rest = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.zeros(380))
    >>> outcome = Replay(ChainConfig()).run([rest], observer=overview)
    >>> given = Variant('given', [overview], {'rest.npz': {'alarms': 0}})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(Path(folder) / 'report.html', 'A second of rest', [given])
    ...     '<title>A second of rest</title>' in (Path(folder) / 'report.html').read_text('utf-8')
    True
    """
    changes = [f'{n} {v}' for n, default, *_, v in _parameter_rows(variants) if v != default]
    page = Template(_read('report.html')).substitute(
        title=escape(title),
        said=_paragraphs(sentences),
        tiles=_tiles(variants),
        config=escape(name_list([Path(config or 'defaults').name, *changes], 5)),
        made=time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime()),
        notes=_paragraphs(notes),
        css='\n'.join(map(_read, STYLES)),
        js='\n'.join(map(_read, SCRIPTS)),
        data=_data(variants),
        figures=_figures(variants),
        parameters=_parameters(variants),
    )
    with whole_file(path) as new:
        new.write_text(page, encoding='utf-8', errors='backslashreplace')


def _read(name: str) -> str:
    return resources.files('slip_detector.report').joinpath(f'templates/{name}').read_text('utf-8')


def _paragraphs(lines: Iterable[str]) -> str:
    return ''.join(f'<p>{escape(line)}</p>' for line in lines)


def _tiles(variants: Sequence[Variant]) -> str:
    tiles, wholes = '', [next(iter(variant.figures.values()), {}) for variant in variants]
    for name in texts.TABLES['decisions'] if wholes[-1].get('slips') is None else MAIN_FIGURES:
        *before, text = (texts.figure_text(name, figures) for figures in wholes)
        was = (f' <small>{variants[0].name} {old}</small>' for old in {*before} - {text, '-'})
        tiles += f'<div><dt>{texts.heading(name)}</dt><dd>{text}{"".join(was)}</dd></div>'
    return tiles


def _figures(variants: Sequence[Variant]) -> str:
    titles, names = list(variants[0].figures), [variant.name for variant in variants]
    rows = {
        f'{title}, {variant.name}' if len(names) > 1 else title: variant.figures[title]
        for title in titles
        for variant in variants
    }
    blocks = texts.figure_tables(rows, {'recording': RECORDING_FIGURES, **texts.TABLES})
    main, *others = [_table('figures', block[0], block[1:]) for block in blocks] or ['']
    if len(names) > 1:
        changes = texts.compared(*(variant.figures[titles[0]] for variant in variants))
        table = _table('compared', [titles[0], *names, ''], changes)
        main = f'{_details("What changed", table)}{main}'
    every = _details('All figures', ''.join(others))
    return f'{main}{every}<p class="legend">{texts.LEGEND}</p>'


def _parameter_rows(variants: Sequence[Variant]) -> list[list[str]]:
    """Return the name, the default and the values of each parameter."""
    configs = [variant.overviews[0].config for variant in variants]
    sets = [config.to_parameters() for config in (type(configs[0])(), *configs)]
    names = dict.fromkeys(name for values in sets for name in values)
    undefined = texts.UNDEFINED
    return [[name, *(_value(values.get(name, undefined)) for values in sets)] for name in names]


def _parameters(variants: Sequence[Variant]) -> str:
    rows = _parameter_rows(variants)
    heads = ['parameter', 'default', *(variant.name for variant in variants)]
    differing = _table('parameters', heads, [row for row in rows if len(set(row[1:])) > 1])
    return differing + _details('All parameters', _table('parameters', heads, rows))


def _table(name: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f'<thead><tr>{_cells("th", heads)}</tr></thead>']
    for row in rows:
        whole = ' class="whole"' if row[0].startswith('all ') else ''
        lines.append(f'<tbody{whole}><tr>{_cells("td", row)}</tr></tbody>')
    return f'<div class="scroll"><table class="{name}">{"".join(lines)}</table></div>'


def _cells(tag: str, texts: Sequence[str]) -> str:
    return ''.join(f'<{tag}>{escape(text)}</{tag}>' for text in texts)


def _details(title: str, content: str) -> str:
    return f'<details><summary>{title}</summary>{content}</details>'


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ' '.join(map(_value, value)) or 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _data(variants: Sequence[Variant]) -> str:
    """Return what the scripts read, as JSON."""
    recordings = zip(*(variant.overviews for variant in variants), strict=True)
    data = {
        'variants': [variant.name for variant in variants],
        'recordings': [pack_recording(overviews) for overviews in recordings],
    }
    # Only '<' can end a script element; JSON may write it as an escape.
    return json.dumps(data, separators=(',', ':'), allow_nan=False).replace('<', '\\u003c')


def pack_recording(variants: Sequence[Overview]) -> dict[str, Any]:
    """Return what the scripts read of one recording; it has an overview for each variant."""
    first = variants[0]
    lowest = np.fmin.reduce(first.low, initial=np.inf).astype(np.float64)
    highest = np.fmax.reduce(first.high, initial=-np.inf).astype(np.float64)
    empty = lowest > highest  # a channel that has no sample
    lowest[empty] = highest[empty] = 0.0
    # A flat channel has one code only, with any step.
    step = np.where(highest > lowest, (highest - lowest) / MOST_CODE, 1.0)

    def packed_volts(volts: Volts) -> bytes:
        codes = np.rint((volts - lowest) / step)
        return _bytes(np.where(np.isnan(codes), NO_SAMPLE, codes).astype('<u2'))

    # In bins of one row the lowest and the highest volts are the same.
    data = [packed_volts(extreme) for extreme in (first.low, first.high)[: min(first.bin_rows, 2)]]
    data += [_bytes(overview.codes) for overview in variants]
    return {
        'name': first.name,
        'rate_hz': first.sample_rate_hz,
        'rows': first.rows,
        'bin_rows': first.bin_rows,
        'bins': len(first.low),
        'channels': first.channel_names,
        'lowest_v': lowest.tolist(),
        'step_v': step.tolist(),
        'truth': first.truth.edges if first.labelled else None,
        'variants': [_variant(overview) for overview in variants],
        'data': base64.b64encode(zlib.compress(b''.join(data))).decode(),
    }


def _bytes(values: Codes | NDArray[np.uint16]) -> bytes:
    """Return columns one after another: all low bytes, then all high ones."""
    by_channel = np.ascontiguousarray(values.T)
    return bytes(by_channel.view(np.uint8).reshape(-1, values.itemsize).T.tobytes())


def _variant(overview: Overview) -> dict[str, Any]:
    return {
        'slip': overview.slip.edges,
        'groups': [
            {'name': name, 'members': members, 'on': overview.groups[name].edges}
            for name, members in overview.config.groups.items()
        ],
        'events': [[OUTCOMES.index(outcome), *rest] for outcome, *rest in overview.events],
    }


def write_evaluation_report(
    path: Path,
    sets: Mapping[str, Mapping[str, evaluator.EvaluatedRecording]],
    report: Mapping[str, Any],
    config: str | None = None,
) -> None:
    """Write the page of an evaluation.

    Parameters
    ----------
    path
        The HTML file to write.
    sets
        The recordings by the names of set and file, each with its overview as the observer.
    report
        Their report, see :func:`slip_detector.commands.evaluate.as_report`.
    config
        The file of the configuration; None: there is none.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.
    """
    recordings = [recording for files in sets.values() for recording in files.values()]
    figures, overviews = texts.by_name(report['sets']), [each.observer for each in recordings]
    for title, overview in zip(figures, overviews, strict=True):
        overview.name = title
    whole = {'all recordings': report['all']} if len(recordings) > 1 else {}
    given = Variant('given', overviews, {**whole, **figures})
    lines = [*report['answer'], *([report['note']] if 'note' in report else [])]
    write_page(path, f'Slips and alarms: {", ".join(sets)}', [given], lines, (), config)


def replay_variant(name: str, replay: Replay, parts: Mapping[str, Sequence[Track]]) -> Variant:
    """Replay the recordings of a search through one chain, which is compared with another.

    Parameters
    ----------
    name
        ``given`` or ``tuned``.
    replay
        Has the parameters of the chain, and what counts as detected.
    parts
        The recordings that were ``held out``, and those that were ``tuned on``.

    Returns
    -------
    Variant
        With the figures of all of each part (``all held out``) and of each recording, in the order
        of names and numbers.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> rows = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.zeros(380, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> parts = {'held out': [track], 'tuned on': [track]}
    >>> list(replay_variant('given', Replay(ChainConfig()), parts).figures)
    ['all held out', 'all tuned on', 'rest (held out)', 'rest (tuned on)']
    """
    chain, share = replay.chain.config, 1 / sum(map(len, parts.values()))
    every = [(f'{track.name} ({what})', what, track) for what in parts for track in parts[what]]
    overviews, of_each = list[Overview](), {}
    outcomes: dict[str, list[ReplayOutcome]] = {what: [] for what in parts}
    for title, what, track in sorted(every, key=lambda entry: by_number(entry[0])):
        overviews.append(Overview(title, chain, track.samples.names, share, track.sample_rate_hz))
        outcomes[what].append(replay.run(track.rows(), track.sample_rate_hz, overviews[-1]))
        of_each[title] = figures_of_merit(outcomes[what][-1:])
    of_all = {f'all {what}': figures_of_merit(several) for what, several in outcomes.items()}
    return Variant(name, overviews, {**of_all, **of_each})
