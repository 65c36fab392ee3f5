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

"""The picture of the grasp."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from slip_detector.grasp.comparison import AT_LIMIT, CONTROLLER, PAPER, UNCONTROLLED
from slip_detector.grasp.loop import GraspTrial
from slip_detector.report.pictures import COLORS, save_picture

Floats = NDArray[np.float64]

#: Colour of each condition.
CONDITION_COLORS = {
    CONTROLLER: COLORS[0],
    PAPER: COLORS[4],
    UNCONTROLLED: COLORS[1],
    AT_LIMIT: COLORS[2],
}
LABELS = {
    CONTROLLER: 'controller',
    PAPER: "controller,\npaper's detector",
    UNCONTROLLED: 'no controller',
    AT_LIMIT: 'always\nat the limit',
}
NEEDED_COLOR = '0.55'

#: Height of the displacement panel, as a multiple of the object's slide under the controller.
SHOWN_SLIDES = 4.0

#: Up to this slide the axis of slides is linear.
LINEAR_TO_MM = 0.1

#: Height at which dropped objects are drawn, as a multiple of the longest slide.
HEADROOM = 1.35


def draw_grasp(
    path: Path,
    trials: Mapping[str, GraspTrial],
    figures: Mapping[str, Mapping[str, Any]],
    limit_n: float,
    live: Mapping[str, Floats],
    wanted_mm: float,
) -> None:
    """Draw one object under each condition, and the figures over all objects.

    Parameters
    ----------
    path
        The picture to write.
    trials
        The trial of one object under each condition.
    figures
        The figures under each condition, from
        :func:`slip_detector.grasp.comparison.grasp_figures`.
    limit_n
        The largest grip force.
    live
        The same object through the nodes: ``position`` and ``command``, arrays of shape (n, 2)
        with times in their first columns; empty where it was not played.
    wanted_mm
        Upper bound of the worst slide under the controller.
    """
    figure = plt.figure(figsize=(12.5, 7.2), layout='constrained')
    halves: Any = figure.subfigures(1, 2, width_ratios=[2.1, 1.0])
    left, right = halves
    force, decision, place = left.subplots(3, 1, sharex=True, height_ratios=[3.0, 0.8, 2.6])
    controlled = trials[CONTROLLER]
    _draw_force(force, controlled, limit_n, live.get('command'))
    _draw_slip(decision, controlled)
    _draw_place(place, trials, live.get('position'))
    begin_s = controlled.time_s[np.argmax(controlled.needed_n > 0.0)]
    for axis in (force, decision, place):
        for onset_s in controlled.onsets_s[controlled.onsets_s >= begin_s]:
            axis.axvline(
                onset_s, color=CONDITION_COLORS[CONTROLLER], linewidth=0.8, alpha=0.35, zorder=0
            )
        axis.spines[['top', 'right']].set_visible(False)
    place.set(xlabel='time [s]', xlim=(controlled.time_s[0], controlled.time_s[-1]))
    left.suptitle('One object: gripped, lifted, filled', fontsize=11)
    slides, spent = right.subplots(2, 1)
    _draw_slides(slides, figures, wanted_mm)
    _draw_spent(spent, figures)
    count = figures[CONTROLLER]['trials']
    right.suptitle(f'All {count} objects', fontsize=11)
    save_picture(figure, path)


def _draw_force(axis: Axes, trial: GraspTrial, limit_n: float, command: Floats | None) -> None:
    axis.fill_between(
        trial.time_s, trial.needed_n, color=NEEDED_COLOR, alpha=0.3, linewidth=0,
        label='just enough to hold it',
    )  # fmt: skip
    axis.axhline(limit_n, color=CONDITION_COLORS[AT_LIMIT], linestyle='--', linewidth=1.2)
    axis.annotate(
        'limit', (0.995, limit_n), xycoords=('axes fraction', 'data'), xytext=(0, -3),
        textcoords='offset points', ha='right', va='top', fontsize=9,
        color=CONDITION_COLORS[AT_LIMIT],
    )  # fmt: skip
    axis.plot(trial.time_s, trial.command_n, color='k', linewidth=0.9, label='commanded')
    axis.plot(
        trial.time_s,
        trial.force_n,
        color=CONDITION_COLORS[CONTROLLER],
        linewidth=2.0,
        label='grip',
    )
    if command is not None:
        axis.plot(*command.T, color='k', linestyle=':', linewidth=1.6, label='commanded, live')
    axis.set(ylabel='force [N]', ylim=(0.0, 1.06 * limit_n))
    axis.legend(loc='upper left', bbox_to_anchor=(0.0, 0.93), fontsize=9, frameon=False)
    # The weight grows twice: when the object is lifted and when it is filled.
    grows = np.diff(trial.needed_n) > 0.0
    edges = np.flatnonzero(np.diff(grows.astype(int), prepend=0, append=0))
    for word, first, last in zip(('lifted', 'filled'), edges[::2], edges[1::2], strict=False):
        axis.annotate(
            word, (0.5 * (trial.time_s[first] + trial.time_s[last]), 0.15), ha='center',
            fontsize=9, color='0.25',
        )  # fmt: skip


def _draw_slip(axis: Axes, trial: GraspTrial) -> None:
    for row, (on, color) in enumerate(
        ((trial.sliding, '0.35'), (trial.slip, CONDITION_COLORS[CONTROLLER]))
    ):
        edges = np.flatnonzero(np.diff(on.astype(int), prepend=0, append=0))
        period_s = trial.time_s[1] - trial.time_s[0]
        spans = [(trial.time_s[0] + a * period_s, (b - a) * period_s)
                 for a, b in zip(edges[::2], edges[1::2], strict=True)]  # fmt: skip
        axis.broken_barh(spans, (row - 0.35, 0.7), color=color)
    axis.set(ylim=(-0.6, 1.6))
    axis.set_yticks([0, 1], ['it slides', '/slip'])


def _draw_place(axis: Axes, trials: Mapping[str, GraspTrial], position: Floats | None) -> None:
    # An object that slides further leaves the panel; the legend says how far it slides.
    most_mm = max(SHOWN_SLIDES * float(trials[CONTROLLER].position_m[-1]) * 1e3, 0.1)
    for name in (UNCONTROLLED, PAPER, CONTROLLER):
        trial = trials[name]
        end = ': dropped' if trial.dropped else f': {trial.position_m[-1] * 1e3:.2f} mm'
        axis.plot(
            trial.time_s, trial.position_m * 1e3, color=CONDITION_COLORS[name],
            linewidth=2.0 if name == CONTROLLER else 1.3,
            label=LABELS[name].replace('\n', ' ') + end,
        )  # fmt: skip
    if position is not None:
        label = f'controller, live: {position[-1, 1] * 1e3:.2f} mm'
        axis.plot(position[:, 0], position[:, 1] * 1e3, 'k:', linewidth=1.6, label=label)
    axis.set(ylabel='displacement [mm]', ylim=(-0.03 * most_mm, most_mm))
    axis.legend(loc='upper left', fontsize=9, frameon=False)


def _draw_slides(axis: Axes, figures: Mapping[str, Mapping[str, Any]], wanted_mm: float) -> None:
    names = (CONTROLLER, PAPER, UNCONTROLLED)
    known = [
        slide_mm
        for name in names
        for slide_mm in figures[name]['slide_mm']
        if slide_mm is not None
    ]
    dropped_mm = HEADROOM * max([wanted_mm, *known])
    for place, name in enumerate(names):
        slides = [dropped_mm if s is None else s for s in figures[name]['slide_mm']]
        spread = np.linspace(-0.28, 0.28, len(slides)) if len(slides) > 1 else np.zeros(1)
        axis.plot(
            place + spread, slides, 'o', color=CONDITION_COLORS[name], markersize=4, alpha=0.8
        )
        mean_mm = figures[name]['mean_slide_mm']
        if mean_mm is not None:
            axis.hlines(mean_mm, place - 0.36, place + 0.36, color='k', linewidth=1.5)
            axis.text(place + 0.38, mean_mm, f'{mean_mm:.2f}', va='center', fontsize=9)
    axis.axhline(wanted_mm, color='0.4', linestyle='--', linewidth=1)
    axis.axhline(dropped_mm, color='0.8', linewidth=0.8, zorder=0)
    axis.text(-0.45, dropped_mm, 'dropped', va='bottom', fontsize=9, color='0.4')
    axis.text(-0.45, wanted_mm, 'wanted', va='bottom', fontsize=9, color='0.4')
    axis.set_xticks(range(len(names)), [LABELS[name] for name in names])
    # Logarithmic from LINEAR_TO_MM on: the slides differ by a factor of a thousand.
    axis.set_yscale('symlog', linthresh=LINEAR_TO_MM)
    axis.set(ylabel='slide of each, and mean [mm]', xlim=(-0.5, len(names) - 0.3),
             ylim=(0.0, 1.5 * dropped_mm))  # fmt: skip
    axis.yaxis.set_major_formatter('{x:g}')
    axis.spines[['top', 'right']].set_visible(False)


def _draw_spent(axis: Axes, figures: Mapping[str, Mapping[str, Any]]) -> None:
    names = (CONTROLLER, PAPER, UNCONTROLLED, AT_LIMIT)
    shares = [figures[name]['force_percent'] for name in names]
    bars = axis.bar(
        range(len(names)), shares, 0.65, color=[CONDITION_COLORS[name] for name in names]
    )
    axis.bar_label(bars, [f'{share:.0f}' for share in shares], padding=2, fontsize=9)
    needed = figures[CONTROLLER]['needed_percent']
    axis.axhline(needed, color='k', linestyle=':', linewidth=1.4)
    axis.text(2.0, needed, 'just enough', ha='center', va='bottom', fontsize=9)
    axis.set_xticks(range(len(names)), [LABELS[name] for name in names], fontsize=8)
    axis.set(ylabel='mean grip [% of the limit]', ylim=(0.0, 115.0))
    axis.spines[['top', 'right']].set_visible(False)
