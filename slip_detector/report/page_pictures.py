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

"""The figures of a report, for the HTML file and as pictures."""

import io
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slip_detector.chain.filters import design, group_delay_s, response
from slip_detector.parameters.files import whole_file
from slip_detector.report.overview import EVENT_KINDS, Overview, RowNumbers
from slip_detector.report.page_data import SearchTrial, Variant, trade_off_front
from slip_detector.report.pictures import COLORS

Floats = NDArray[np.float64]

STYLES = ('-', '--', ':', '-.')

#: Marker and colour of each kind of event.
EVENT_STYLES = (('v', COLORS[1]), ('x', COLORS[3]), ('D', COLORS[4]), ('.', COLORS[2]))

#: Largest number of bins of a channel in a picture of a timeline; finer ones would not be visible.
PICTURE_BINS = 2000


def svg(figure: Figure) -> str:
    """Return a figure as SVG, with text as text; the same figure gives the same bytes.

    Examples
    --------
    >>> svg(Figure()).startswith('<?xml')
    True
    """
    stream = io.StringIO()
    with matplotlib.rc_context({'svg.fonttype': 'none', 'svg.hashsalt': 'slip_detector'}):
        _save(figure, stream, format='svg', metadata={'Date': None, 'Creator': None})
    return stream.getvalue()


def png(figure: Figure, path: Path) -> None:
    """Write a figure as PNG.

    Examples
    --------
    >>> import tempfile
    >>> from matplotlib.figure import Figure
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'empty.png'
    >>> png(Figure(figsize=(1, 1)), path)
    >>> path.read_bytes()[1:4]
    b'PNG'
    >>> folder.cleanup()
    """
    with whole_file(path) as new:
        _save(figure, new, dpi=120)


def _save(figure: Figure, to: Any, **settings: Any) -> None:
    with warnings.catch_warnings():
        # A file name may have any character; one that is not in the font is drawn as a box.
        warnings.filterwarnings('ignore', 'Glyph', UserWarning)
        figure.savefig(to, **settings)


def _plain(text: str) -> str:
    """Escape what matplotlib would read as a formula."""
    return text.replace('$', r'\$')


def filters_figure(variants: Sequence[Variant]) -> Figure:
    """Draw gain and group delay of the filters of each variant over the frequency.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> figure = filters_figure([Variant('given', ChainConfig(), [], {})])
    >>> [axis.get_ylabel() for axis in figure.axes]
    ['gain [dB]', 'group delay [ms]']
    """
    figure = Figure(figsize=(10, 3.6), layout='constrained')
    gain_axis, delay_axis = figure.subplots(1, 2)
    longest_ms = 0.0
    for variant, color, style in zip(variants, COLORS, STYLES, strict=False):
        config = variant.config
        rate = config.sample_rate_hz
        sections = design(config)
        low, high = config.passband_hz
        frequency = np.geomspace(min(low, 0.01 * rate) / 3, 0.499 * rate, 1000)
        # The response of all filters together, without the constant gain.
        gain = np.abs(response(sections, frequency, rate)) / config.gain
        delay_ms = 1e3 * group_delay_s(sections, frequency, rate)
        line = {'color': color, 'linestyle': style, 'label': _plain(variant.name)}
        gain_axis.plot(frequency, 20 * np.log10(np.maximum(gain, 1e-6)), **line)
        delay_axis.plot(frequency, delay_ms, **line)
        within = (frequency >= low) & (frequency <= (high or frequency[-1]))
        longest_ms = max(longest_ms, float(delay_ms[within].max()))
        for axis in (gain_axis, delay_axis):
            axis.axvspan(low, high or frequency[-1], color=color, alpha=0.08, linewidth=0)
    gain_axis.set(ylabel='gain [dB]', title='Response (shaded: passband)', ylim=(-80, 5))
    # The scale is set by the passband: outside of it the delay has no meaning and may be extreme.
    delay_axis.set(
        ylabel='group delay [ms]',
        title='Delay',
        ylim=(min(0.0, -0.05 * longest_ms), 1.3 * longest_ms),
    )
    for axis in (gain_axis, delay_axis):
        axis.set(xscale='log', xlabel='frequency [Hz]')
        axis.grid(color='0.9', linewidth=0.5)
    if len(variants) > 1:
        gain_axis.legend(loc='lower center')
    return figure


def front_figure(trials: Sequence[SearchTrial]) -> Figure:
    """Draw the trials of a search: latency against false alarms, sooner than chance as colour.

    Examples
    --------
    >>> figure = front_figure([SearchTrial(0, 0.04, 2.0, 0.1, 1.0)])
    >>> figure.axes[0].get_xlabel()
    'median latency [ms]'
    """
    figure = Figure(figsize=(8, 4.6), layout='constrained')
    axis = figure.subplots()
    known = [trial for trial in trials if trial.costs is not None]
    latency_ms, alarms, sooner = _columns([trial for trial in known if not trial.mark])
    points = axis.scatter(
        latency_ms, alarms, c=sooner, cmap='viridis', vmin=0.0, vmax=1.0, s=22, zorder=2,
        label='trial',
    )  # fmt: skip
    figure.colorbar(points, label='sooner than chance')
    latency_ms, alarms, _ = _columns(trade_off_front(trials))
    axis.plot(
        latency_ms, alarms, 'o', markersize=9, markerfacecolor='none', markeredgecolor='k',
        label='on the front', zorder=3,
    )  # fmt: skip
    marked = [trial for trial in known if trial.mark]
    for trial, color in zip(marked, COLORS[1:], strict=False):
        (x,), (y,), (sooner_than_chance,) = _columns([trial])
        figures = f'{x:.0f} ms, {y:.2g} a minute, sooner than chance {sooner_than_chance:.2f}'
        axis.plot(
            x, y, '*', color=color, markersize=17, markeredgecolor='k', zorder=4,
            label=f'{_plain(trial.mark)}: {figures}',
        )  # fmt: skip
    # Logarithmic, but linear near 0, so that the axis can show 0 false alarms too.
    axis.set_yscale('symlog', linthresh=1.0)
    axis.set_ylim(bottom=-0.1)
    axis.set(xlabel='median latency [ms]', ylabel='false alarms per minute')
    axis.grid(color='0.9', linewidth=0.5)
    axis.legend(fontsize=9)
    return figure


def _columns(trials: Sequence[SearchTrial]) -> tuple[Floats, Floats, Floats]:
    """Return latency in ms, false alarms per minute and sooner than chance of trials."""
    table = np.array([trial.costs for trial in trials], np.float64).reshape(-1, 4)
    return 1e3 * table[:, 0], table[:, 1], 1.0 - table[:, 3]


def timeline_figure(names: Sequence[str], overviews: Sequence[Overview]) -> Figure:
    """Draw one recording: label, decisions of all variants, and groups and channels of the last.

    Parameters
    ----------
    names, overviews
        The name of each variant and its overview of the recording.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> figure = timeline_figure(['given'], [Overview('rest.npz', ChainConfig())])
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()][:4]
    ['events', 'slip', 'TP', 'ch14']
    """
    last = overviews[-1]
    config, rate = last.config, last.sample_rate_hz
    lanes: list[tuple[str, float]] = [('events', 1.0)]
    if last.truth is not None:
        lanes.append(('label', 0.8))
    lanes += [(f'slip {name}' if len(names) > 1 else 'slip', 0.8) for name in names]
    members = {name: [c - 1 for c in group] for name, group in config.groups.items()}
    for name, group in members.items():
        lanes += [(name, 0.7), *((last.channel_names[c], 2.0) for c in group)]
    heights = np.array([height for _, height in lanes])
    bottoms = -np.cumsum(heights)
    figure = Figure(figsize=(12, min(1.2 + 0.16 * heights.sum(), 60.0)), layout='constrained')
    axis = figure.subplots()
    places = iter(zip(bottoms + 0.1, heights - 0.2, strict=True))

    bottom, height = next(places)
    for kind, (marker, color) in zip(EVENT_KINDS, EVENT_STYLES, strict=True):
        starts_s = [event.start_s for event in last.events if event.kind == kind]
        middle = np.full(len(starts_s), bottom + height / 2)
        axis.plot(starts_s, middle, marker, color=color, markersize=5, label=kind)
    if last.truth is not None:
        _bars(axis, last.truth, rate, (bottoms[-1], -bottoms[-1]), '0.92')
        _bars(axis, last.truth, rate, next(places), '0.5')
    for overview in overviews:
        _bars(axis, overview.slip, rate, next(places), COLORS[1])
    low, high, time_s = _picture_bins(last)
    for name, group in members.items():
        _bars(axis, last.groups[name], rate, next(places), COLORS[4])
        for channel in group:
            bottom, height = next(places)
            lowest, highest = low[:, channel], high[:, channel]
            if not np.isfinite(lowest).any():
                continue
            base, span = np.nanmin(lowest), np.nanmax(highest) - np.nanmin(lowest)
            scale = height / span if span else 0.0
            axis.fill_between(
                time_s, bottom + scale * (lowest - base), bottom + scale * (highest - base),
                color=COLORS[0], linewidth=0.6,
            )  # fmt: skip
    axis.set_yticks(bottoms + heights / 2, [_plain(name) for name, _ in lanes], fontsize=8)
    axis.set(
        xlabel='time [s]', xlim=(0.0, max(last.duration_s, 1 / rate)), ylim=(bottoms[-1], 0.0)
    )
    axis.set_title(
        f'{_plain(last.name)} (grey: label; each channel from its lowest to its highest volts)'
    )
    if last.events:
        figure.legend(loc='outside lower right', ncols=len(EVENT_KINDS), fontsize=8, frameon=False)
    return figure


def _bars(
    axis: Axes, rows: RowNumbers, rate: float, place: tuple[float, float], color: str
) -> None:
    spans = [(start / rate, (stop - start) / rate) for start, stop in rows.tolist()]
    # The edge keeps a bar visible that is narrower than a pixel.
    axis.broken_barh(spans, place, color=color, linewidth=0.5, zorder=0.5)


def _picture_bins(overview: Overview) -> tuple[Floats, Floats, Floats]:
    """Return lowest and highest volts of at most ``PICTURE_BINS`` bins, and their times."""
    bin_rows = overview.bin_rows
    while overview.rows > PICTURE_BINS * bin_rows:
        bin_rows *= 2
    low, high, _ = overview.bins(bin_rows)
    time_s = (np.arange(len(low), dtype=np.float64) + 0.5) * bin_rows
    time_s /= overview.sample_rate_hz
    return low.astype(np.float64), high.astype(np.float64), time_s
