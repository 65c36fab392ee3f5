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

"""The figures of the grasp as text, and their picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slip_detector.chain.samples import Floats
from slip_detector.grasp.comparison import CONTROLLER, PAPER, UNCONTROLLED
from slip_detector.grasp.loop import GraspTrial
from slip_detector.report.pictures import COLORS, draw_decision, save_picture
from slip_detector.report.tables import heading, number_text, text_table, verdict_cells

Figures = Mapping[str, Mapping[str, Any]]

#: The figures in the table of conditions.
COLUMNS = (
    'mean_slide_mm', 'worst_slide_mm', 'force_percent', 'most_force_percent', 'onsets',
)  # fmt: skip

#: Name and colour of each condition, in the order in which they are drawn.
LABEL = {
    CONTROLLER: 'controller',
    PAPER: "controller,\npaper's detector",
    UNCONTROLLED: 'no controller',
}
COLOR = dict(zip(LABEL, (COLORS[0], COLORS[4], COLORS[1]), strict=True))

#: Height of the displacement panel, as a multiple of the object's slide under the controller.
SHOWN_SLIDES = 4.0

#: Up to this slide the axis of slides is linear.
LINEAR_TO_MM = 0.1

#: Height at which dropped objects are drawn, as a multiple of the longest slide.
HEADROOM = 1.35


def grasp_table(result: Mapping[str, Any]) -> str:
    """Return the figures as text: conditions, wanted figures, and the trials with the nodes.

    Parameters
    ----------
    result
        The content of ``grasp.json``; see :mod:`slip_detector.nodes.grasp_demo`.

    Examples
    --------
    >>> figures = {'dropped': 0, 'trials': 1, 'mean_slide_mm': 0.2, 'worst_slide_mm': 0.2}
    >>> figures |= {'force_percent': 40.0, 'most_force_percent': 44.0, 'onsets': 2.0}
    >>> figures['needed_percent'] = 30.0
    >>> result = {'seeds': [0], 'transport_ms': 5.0, 'conditions': {CONTROLLER: figures}}
    >>> result['harder'] = {}
    >>> grasp_table({**result, 'wanted': {}, 'nodes': {}}).splitlines()[1]
    'In simulated time, 5 ms from sample to command'
    """
    seeds, parts = result['seeds'], result['conditions']
    rows = [['', '', 'slide [mm]', '', 'grip [% of limit]'],
            ['', 'dropped', 'mean', 'worst', 'mean', 'most', 'onsets']]  # fmt: skip
    for name, part in {**parts, **result['harder']}.items():
        figures = [number_text(part[key], '.2f') for key in COLUMNS]
        rows.append([name, f'{part["dropped"]} of {part["trials"]}', *figures])
    wanted = [
        [condition, heading(name), *verdict_cells(entry)]
        for condition, entries in result['wanted'].items()
        for name, entry in entries.items()
    ]
    needed = parts[CONTROLLER]['needed_percent']
    blocks = [
        f'{len(seeds)} objects (seeds {seeds[0]} to {seeds[-1]}): gripped, lifted and filled '
        'until they are two to three times as heavy\n'
        f'In simulated time, {result["transport_ms"]:g} ms from sample to command',
        text_table(rows),
        f'The smallest grip that would hold the objects: {needed:.1f} % of the limit.',
        'Wanted of the controller',
        text_table(wanted, '<<><'),
    ]
    if result['nodes']:
        rows = [['', 'slide [mm]', '', 'command [% of limit]'],
                ['seed', 'nodes', 'simulated', 'nodes', 'simulated']]  # fmt: skip
        for seed, part in result['nodes'].items():
            both = (part, part['simulated'])
            slides = (number_text(one['slide_mm'], '.2f') for one in both)
            commands = (number_text(one['command_percent'], '.1f') for one in both)
            rows.append([seed, *slides, *commands])
        says, latency = 'undefined, no onset was answered', result['latency_ms']
        if latency:
            says = f'median {latency["median"]:.1f} ms, most {latency["most"]:.1f} ms'
        blocks += [
            'Through driver, detector and controller in real time, beside the same in simulated '
            'time',
            text_table(rows),
            f'From sample to command: {says}',
        ]
    return '\n\n'.join(blocks)


def draw_grasp(
    path: Path,
    trials: Mapping[str, GraspTrial],
    figures: Figures,
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
    figure = Figure(figsize=(12.5, 7.2), layout='constrained')
    axes: dict[str, Axes] = figure.subplot_mosaic(
        [['force', 'slides'], ['decision', 'slides'], ['place', 'slides']],
        width_ratios=[2.1, 1.0], height_ratios=[3.0, 0.8, 2.6],
    )  # fmt: skip
    force, slides, decision, place = axes.values()
    controlled = trials[CONTROLLER]
    _draw_force(force, controlled, limit_n, live.get('command'))
    draw_decision(decision, controlled.time_s, controlled.slip, COLOR[CONTROLLER], '/slip')
    decision.plot(controlled.time_s, controlled.sliding, color='0.35', label='it slides')
    decision.legend(loc='upper left', fontsize=9, frameon=False)
    _draw_place(place, trials, live.get('position'))
    for axis in (force, decision, place):
        axis.set_xlim(controlled.time_s[0], controlled.time_s[-1])
    place.set_xlabel('time [s]')
    force.set_title('One object: gripped, lifted, filled', fontsize=11)
    _draw_slides(slides, figures, wanted_mm)
    slides.set_title(f'All {figures[CONTROLLER]["trials"]} objects', fontsize=11)
    save_picture(figure, path)


def _draw_force(axis: Axes, trial: GraspTrial, limit_n: float, command: Floats | None) -> None:
    time_s, label = trial.time_s, 'just enough to hold it'
    axis.fill_between(time_s, trial.needed_n, color='0.55', alpha=0.3, linewidth=0, label=label)
    axis.axhline(limit_n, color=COLORS[2], linestyle='--', linewidth=1.2, label='limit')
    axis.plot(time_s, trial.command_n, color='k', linewidth=0.9, label='commanded')
    axis.plot(time_s, trial.force_n, color=COLOR[CONTROLLER], linewidth=2.0, label='grip')
    if command is not None:
        axis.plot(*command.T, color='k', linestyle=':', linewidth=1.6, label='commanded, live')
    axis.set(ylabel='force [N]', ylim=(0.0, 1.06 * limit_n))
    axis.legend(loc='upper left', bbox_to_anchor=(0.0, 0.93), fontsize=9, frameon=False)


def _draw_place(axis: Axes, trials: Mapping[str, GraspTrial], position: Floats | None) -> None:
    # An object that slides further leaves the panel; the legend says how far it slides.
    most_mm = max(SHOWN_SLIDES * float(trials[CONTROLLER].position_m[-1]) * 1e3, 0.1)
    for name in reversed(LABEL):
        trial = trials[name]
        end = 'dropped' if trial.dropped else f'{trial.position_m[-1] * 1e3:.2f} mm'
        label = f'{LABEL[name]}: {end}'.replace('\n', ' ')
        axis.plot(trial.time_s, trial.position_m * 1e3, color=COLOR[name], label=label)
    if position is not None:
        label = f'controller, live: {position[-1, 1] * 1e3:.2f} mm'
        axis.plot(position[:, 0], position[:, 1] * 1e3, 'k:', linewidth=1.6, label=label)
    axis.set(ylabel='displacement [mm]', ylim=(-0.03 * most_mm, most_mm))
    axis.legend(loc='upper left', fontsize=9, frameon=False)


def _draw_slides(axis: Axes, figures: Figures, wanted_mm: float) -> None:
    known = [s for name in LABEL for s in figures[name]['slide_mm'] if s is not None]
    dropped_mm = HEADROOM * max([wanted_mm, *known])
    for place, name in enumerate(LABEL):
        slides = [dropped_mm if s is None else s for s in figures[name]['slide_mm']]
        spread = np.linspace(-0.3, 0.3, len(slides))
        axis.plot(place + spread, slides, 'o', color=COLOR[name], markersize=4, alpha=0.8)
        mean_mm = figures[name]['mean_slide_mm']
        if mean_mm is not None:
            axis.hlines(mean_mm, place - 0.4, place + 0.4, color='k', linewidth=1.5)
    axis.axhline(dropped_mm, color='0.6', linestyle=':', zorder=0, label='dropped')
    axis.axhline(wanted_mm, color='0.6', linestyle='--', zorder=0, label='wanted of the worst')
    axis.legend(loc='lower right', fontsize=9, frameon=False)
    axis.set_xticks(range(len(LABEL)), list(LABEL.values()))
    # Logarithmic from LINEAR_TO_MM on: the slides differ by a factor of a thousand.
    axis.set_yscale('symlog', linthresh=LINEAR_TO_MM)
    axis.set(ylabel='slide of each, and mean [mm]', ylim=(0.0, 1.5 * dropped_mm))
