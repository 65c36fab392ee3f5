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

"""The sections of a report below its timeline: figures, latencies and parameters."""

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from slip_detector.evaluation.figures import ReplayOutcome
from slip_detector.evaluation.scores import MOTION, REST, ScoreCounts
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.overview import Overview
from slip_detector.report.pictures import COLORS, svg
from slip_detector.report.tables import UNDEFINED, figure_text, heading, main_figures


class Variant(NamedTuple):
    """One configuration of the chain, with its overviews and figures of all recordings.

    Attributes
    ----------
    name : str
        For example ``given`` or ``tuned``.
    config : ChainConfig
    overviews : sequence of Overview
        One for each recording, in the same order for all variants.
    figures : mapping
        Figures of each recording, and of all together, by its name; None where one is not
        defined.

    Examples
    --------
    >>> given = Variant('given', ChainConfig(), [], {'all recordings': {'recall': 0.95}})
    >>> given.figures['all recordings']['recall']
    0.95
    """

    name: str
    config: ChainConfig
    overviews: Sequence[Overview]
    figures: Mapping[str, Mapping[str, float | None]]


def sections(variants: Sequence[Variant], outcomes: Sequence[ReplayOutcome] = ()) -> str:
    """Return the sections of a page below the timeline, as HTML.

    Parameters
    ----------
    variants, outcomes
        As :func:`slip_detector.report.page.write_page` takes them.

    Examples
    --------
    >>> config = ChainConfig()
    >>> given = Variant('given', config, [Overview('rest.npz', config)], {})
    >>> [line for line in sections([given]).splitlines() if line.startswith('<h2>')]
    ['<h2>Figures</h2>', '<h2>Parameters</h2>']
    """
    parts = {'Figures': _figures(variants)}
    if outcomes:
        data = base64.b64encode(svg(latency_figure(outcomes)).encode()).decode()
        source = f'data:image/svg+xml;base64,{data}'
        parts['Latency'] = f'<img alt="Latencies and ROC curve" src="{source}">'
    parts['Parameters'] = _parameters(variants)
    return '\n'.join(
        f'<section>\n<h2>{title}</h2>\n{content}\n</section>' for title, content in parts.items()
    )


def _figures(variants: Sequence[Variant]) -> str:
    titles = list(dict.fromkeys(title for variant in variants for title in variant.figures))
    rows = [(title, one.name, one.figures.get(title, {})) for title in titles for one in variants]
    names = list(dict.fromkeys(name for *_, figures in rows for name in figures))

    def table(names: Sequence[str]) -> str:
        cells = [
            [title, variant, *(figure_text(name, figures) for name in names)]
            for title, variant, figures in rows
        ]
        return _table('figures', ['recording', 'variant', *map(heading, names)], cells)

    main = table(main_figures(figures for *_, figures in rows))
    legend = f'{UNDEFINED}: not defined: no labels, nothing of the kind, or it was not asked for'
    return f'{main}{_details("All figures", table(names))}<p class="legend">{legend}</p>'


def _parameters(variants: Sequence[Variant]) -> str:
    columns = [variant.config.to_parameters() for variant in variants]
    names = dict.fromkeys(name for column in columns for name in column)
    rows = [[name, *(_value(column.get(name, UNDEFINED)) for column in columns)] for name in names]
    heads = ['parameter', *(variant.name for variant in variants)]
    differing = [row for row in rows if len(set(row[1:])) > 1]
    shown = _table('parameters', heads, differing) if differing else '<p>All equal.</p>'
    return shown + _details('All parameters', _table('parameters', heads, rows))


def _table(name: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f'<thead><tr>{_cells("th", heads)}</tr></thead>']
    for row in rows:
        kind = ' class="whole"' if row[0].startswith('all ') else ''
        lines.append(f'<tbody{kind}><tr>{_cells("td", row)}</tr></tbody>')
    return f'<div class="scroll"><table class="{name}">{"".join(lines)}</table></div>'


def _cells(tag: str, texts: Sequence[str]) -> str:
    return ''.join(f'<{tag}>{escape(text)}</{tag}>' for text in texts)


def _details(title: str, content: str) -> str:
    return f'<details><summary>{title}</summary>{content}</details>'


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ' '.join(map(_value, value)) or 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def latency_figure(outcomes: Sequence[ReplayOutcome]) -> Figure:
    """Draw the latencies of all detected slips and the ROC curve.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> rows = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.arange(380) >= 190)
    >>> figure = latency_figure([Replay(ChainConfig()).run([rows])])
    >>> figure.axes[0].get_title()
    '0 detected, 1 missed'
    """
    figure = Figure(figsize=(10, 4.2), layout='constrained')
    latencies, roc = figure.subplots(1, 2)
    for axis in (latencies, roc):
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    slips = [slip for one in outcomes for slip in one.slips if not slip.settling]
    known_ms = [slip.latency_s * 1e3 for slip in slips if slip.latency_s is not None]
    latencies.hist(known_ms, bins=min(40, max(10, len(known_ms) // 5)), color=COLORS[0])
    latencies.set(xlabel='latency of the global signal [ms]', ylabel='slips')
    latencies.set_title(f'{len(known_ms)} detected, {len(slips) - len(known_ms)} missed')
    scores = ScoreCounts.pooled([one.scores for one in outcomes])
    for name, kinds in (('all other rows', (REST, MOTION)), ('rows of motion', (MOTION,))):
        area = scores.auc(kinds)
        if area is not None:
            false_share, true_share, limit = scores.roc(kinds)
            label = f'{name}: {area:.3f}'
            (line,) = roc.plot([0.0, *false_share], [0.0, *true_share], label=label)
            at = max(int(np.searchsorted(-limit, -1.0, 'right')) - 1, 0)
            roc.plot(false_share[at], true_share[at], 'o', color=line.get_color())
    roc.plot([0.0, 1.0], [0.0, 1.0], color='0.7', linewidth=0.8, linestyle=':', label='chance')
    roc.set(xlabel='share of the rows without slip', ylabel='share of the rows with slip')
    roc.set_title('ROC of the decision statistic (dot: threshold)')
    roc.legend(title='area, slip against', loc='lower right', frameon=False)
    return figure
