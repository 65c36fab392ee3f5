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

"""Pictures of trials and of an evaluation, their colours, and how they are saved."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slip_detector.chain.samples import Bools, Floats
from slip_detector.evaluation.figures import ReplayOutcome
from slip_detector.evaluation.scores import MOTION, SLIP, ScoreCounts
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import whole_file

#: Colours that colour-blind readers can distinguish (Okabe and Ito): blue, vermilion, green,
#: purple, orange, sky blue, black.
COLORS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure to a file, in the format that the ending names.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.
    """
    with whole_file(path) as new:
        figure.savefig(new, dpi=120)


def svg(figure: Figure) -> str:
    """Return a figure as SVG, with text as text; the same figure gives the same bytes."""
    stream = io.StringIO()
    settings: Any = {'svg.fonttype': 'none', 'svg.hashsalt': 'slip_detector'}
    with matplotlib.rc_context(settings):
        figure.savefig(stream, format='svg', metadata={'Date': None, 'Creator': None})
    return stream.getvalue()


def draw_trial(
    path: Path,
    time_s: Floats,
    volts: Floats,
    config: ChainConfig,
    groups: Mapping[str, Bools],
    slip: Bools,
    motion_s: tuple[float, float] | None,
) -> None:
    """Draw a trial like the paper's Figs. 5 and 6: channels by group, and the decisions.

    Parameters
    ----------
    path
        The picture to write.
    time_s : ndarray, shape (n,)
        When the samples were taken.
    volts : ndarray, shape (n, c)
        The samples.
    config
        Names and groups of the channels.
    groups
        Decision of each group, arrays of shape (n,).
    slip : ndarray of bool, shape (n,)
        The global decision.
    motion_s
        When the plate started and stopped; None where nothing moves.
    """
    figure = Figure(figsize=(9, 2.2 * len(groups) + 1), layout='constrained')
    heights = [3, 1] * len(groups) + [1.2]
    axes = figure.subplots(len(heights), sharex=True, height_ratios=heights)
    for raw, decision, (name, on) in zip(axes[::2], axes[1::2], groups.items(), strict=False):
        raw.set_prop_cycle(color=COLORS)
        for channel in config.groups[name]:
            raw.plot(time_s, volts[:, channel - 1], linewidth=0.7, label=f'{channel}')
        raw.set_ylabel(f'{name} [V]')
        raw.legend(title='channel', loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize=8)
        draw_decision(decision, time_s, on, COLORS[0], name)
    draw_decision(axes[-1], time_s, slip, COLORS[1], 'slip')
    axes[-1].set(xlabel='time [s]', xlim=(time_s[0], time_s[-1]))
    if motion_s:
        for axis in axes:
            axis.axvspan(*motion_s, color='0.92', zorder=0)
            axis.axvline(motion_s[0], color='k', linestyle='--', linewidth=1)
        axes[0].set_title('grey: the plate moves', fontsize=9, loc='left')
    save_picture(figure, path)


def draw_decision(axis: Axes, time_s: Floats, on: Bools, color: str, name: str) -> None:
    """Draw when a signal is ON."""
    axis.fill_between(time_s, on.astype(float), step='post', color=color, alpha=0.6, linewidth=0)
    axis.set(ylabel=name, ylim=(-0.1, 1.2))
    axis.set_yticks([0, 1], ['OFF', 'ON'])


def latency_figure(outcomes: Sequence[ReplayOutcome]) -> Figure:
    """Draw the latencies of detected slips and the ROC curve.

    Slips that are labelled by hand are left out, as their latencies are not exact.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> rows = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.arange(380) >= 190)
    >>> figure = latency_figure([Replay(ChainConfig()).run([rows])])
    >>> figure.axes[0].get_title()
    '0 detected, 1 missed (of those with exact labels)'
    """
    slips = [s for one in outcomes for s in one.slips if not (s.settling or s.accuracy_s)]
    figure = Figure(figsize=(10 if slips else 5, 4.2), layout='constrained')
    *latencies, roc = figure.subplots(1, 2 if slips else 1, squeeze=False)[0]
    for axis in (*latencies, roc):
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    for axis in latencies:
        known_ms = [slip.latency_s * 1e3 for slip in slips if slip.latency_s is not None]
        axis.hist(known_ms, bins=min(40, max(10, len(known_ms) // 5)), color=COLORS[0])
        axis.set(xlabel='latency of the global signal [ms]', ylabel='slips')
        counts = f'{len(known_ms)} detected, {len(slips) - len(known_ms)} missed'
        axis.set_title(f'{counts} (of those with exact labels)')
    scores = ScoreCounts.pooled([one.scores for one in outcomes])
    for name, kinds in (('all other rows', range(SLIP)), ('rows of motion', (MOTION,))):
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
