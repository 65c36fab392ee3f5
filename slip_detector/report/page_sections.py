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
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slip_detector.chain.filters import design, group_delay_s, response
from slip_detector.evaluation.figures import ReplayOutcome
from slip_detector.evaluation.scores import MOTION, REST, ScoreCounts
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.overview import Overview
from slip_detector.report.pictures import COLORS, svg
from slip_detector.report.tables import IF_DEFINED, MAIN_FIGURES, UNDEFINED, figure_text, heading

#: The figures by which trials of a search are drawn.
COSTS = ('latency_median_ms', 'false_alarms_per_minute', 'sooner_than_chance')

#: Figures of a chain by their names; None where one is not defined.
Figures = Mapping[str, Any]

#: Name of the trials of a search, beside those of the variants.
TRIAL = 'trial'


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


def sections(
    variants: Sequence[Variant],
    trials: Mapping[str, Sequence[Figures]] | None = None,
    outcomes: Sequence[ReplayOutcome] = (),
) -> str:
    """Return the sections of a page below the timeline, as HTML.

    Parameters
    ----------
    variants, trials, outcomes
        As :func:`slip_detector.report.page.write_page` takes them.

    Examples
    --------
    >>> config = ChainConfig()
    >>> given = Variant('given', config, [Overview('rest.npz', config)], {})
    >>> [line for line in sections([given]).splitlines() if line.startswith('<h2>')]
    ['<h2>Figures</h2>', '<h2>Filter</h2>', '<h2>Parameters</h2>']
    """
    parts = {'Figures': _figures(variants)}
    if outcomes:
        parts['Latency'] = _image(latency_figure(outcomes), 'Latencies and ROC curve')
    if trials:
        parts['Trade-off'] = _trade_off(trials)
    meaning = 'Response and group delay of the filters over the frequency'
    parts['Filter'] = _image(filters_figure(variants), meaning)
    parts['Parameters'] = _parameters(variants)
    return '\n'.join(
        f'<section>\n<h2>{title}</h2>\n{content}\n</section>' for title, content in parts.items()
    )


# ---- tables


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

    shown = [name for name in IF_DEFINED if any(row[2].get(name) is not None for row in rows)]
    main = table([name for name in [*MAIN_FIGURES, *shown] if name in names])
    legend = f'{UNDEFINED}: not defined, as nothing of the kind occurred or it was not asked for'
    return f'{main}{_details("All figures", table(names))}<p class="legend">{legend}</p>'


def _trade_off(trials: Mapping[str, Sequence[Figures]]) -> str:
    undefined = sum(figures['latency_median_ms'] is None for figures in trials[TRIAL])
    text = (
        f'{len(trials[TRIAL])} trials gave a chain (the others cannot be built, or are never ON). '
        'The figures are those of the recordings that were tuned on. Not drawn are trials that '
        f'found no more slips than chance, which have no latency: {undefined}.'
    )
    image = _image(trials_figure(trials), 'Latency, false alarms and sooner than chance')
    return f'<p>{text}</p>{image}'


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


# ---- pictures


def _image(figure: Figure, meaning: str) -> str:
    data = base64.b64encode(svg(figure).encode()).decode()
    return f'<img alt="{meaning}" src="data:image/svg+xml;base64,{data}">'


def _panels(columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes side by side, with a grid."""
    figure = Figure(figsize=(width, height), layout='constrained')
    axes = list(figure.subplots(1, columns, squeeze=False)[0])
    for axis in axes:
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    return figure, axes


def filters_figure(variants: Sequence[Variant]) -> Figure:
    """Draw gain and group delay of the filters of each variant over the frequency.

    Examples
    --------
    >>> figure = filters_figure([Variant('given', ChainConfig(), [], {})])
    >>> [axis.get_ylabel() for axis in figure.axes]
    ['gain [dB]', 'group delay [ms]']
    """
    figure, (gain_axis, delay_axis) = _panels(2, 10, 3.6)
    longest_ms = 0.0
    for variant, color, style in zip(variants, COLORS, ('-', '--'), strict=False):
        config = variant.config
        rate, sections = config.sample_rate_hz, design(config)
        low, high = config.passband_hz
        frequency = np.geomspace(min(low, 0.01 * rate) / 3, 0.499 * rate, 1000)
        # The response of all filters together, without the constant gain.
        gain = np.abs(response(sections, frequency, rate)) / config.gain
        delay_ms = 1e3 * group_delay_s(sections, frequency, rate)
        line: Any = {'color': color, 'linestyle': style, 'label': variant.name}
        gain_axis.plot(frequency, 20 * np.log10(np.maximum(gain, 1e-6)), **line)
        delay_axis.plot(frequency, delay_ms, **line)
        top = high or frequency[-1]
        within = (frequency >= low) & (frequency <= top)
        longest_ms = max(longest_ms, float(delay_ms[within].max()))
        for axis in (gain_axis, delay_axis):
            axis.axvspan(low, top, color=color, alpha=0.08, linewidth=0)
            axis.set(xscale='log', xlabel='frequency [Hz]')
    gain_axis.set(ylabel='gain [dB]', title='Response (shaded: passband)', ylim=(-80, 5))
    # The scale is set by the passband: outside of it the delay has no meaning and may be extreme.
    delay_axis.set(ylabel='group delay [ms]', title='Delay', ylim=(0.0, 1.3 * longest_ms))
    gain_axis.legend(loc='lower center')
    return figure


def trials_figure(trials: Mapping[str, Sequence[Figures]]) -> Figure:
    """Draw the trials of a search: latency against false alarms, sooner than chance as colour.

    Examples
    --------
    >>> figure = trials_figure({TRIAL: [dict(zip(COSTS, (40.0, 2.0, 1.0)))]})
    >>> figure.axes[0].get_xlabel()
    'median latency [ms]'
    """
    figure, (axis,) = _panels(1, 8, 4.6)
    for (label, several), edge in zip(trials.items(), ['none', *COLORS[1:]], strict=False):
        places = [[figures[name] for name in COSTS] for figures in several]
        known = [place for place in places if None not in place]
        latency_ms, alarms, sooner = np.array(known, np.float64).reshape(-1, len(COSTS)).T
        size, marker = (40, 'o') if label == TRIAL else (200, '*')
        drawn = axis.scatter(
            latency_ms, alarms, size, sooner, marker=marker, edgecolors=edge, label=label,
            vmin=0.0, vmax=1.0,
        )  # fmt: skip
    figure.colorbar(drawn, label='sooner than chance')
    # Logarithmic, but linear near 0, so that the axis can show 0 false alarms too.
    axis.set_yscale('symlog', linthresh=1.0)
    axis.set_ylim(bottom=-0.1)
    axis.set(xlabel='median latency [ms]', ylabel='false alarms per minute')
    axis.legend(fontsize=9)
    return figure


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
    figure, (latencies, roc) = _panels(2, 10, 4.2)
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
