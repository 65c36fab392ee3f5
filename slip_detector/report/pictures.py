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

"""Pictures of trials and grasps, and the table of a grasp."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slip_detector.chain.samples import Bools, Floats
from slip_detector.grasp.loop import CONTROLLER, PAPER, UNCONTROLLED, GraspTrial
from slip_detector.parameters import ChainConfig, whole_file
from slip_detector.report.texts import number_text, text_table

#: Colours that colour-blind readers can distinguish (Okabe and Ito): blue, vermilion, green,
#: purple, orange, sky blue, black.
COLORS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')

#: The figures in the table of conditions.
COLUMNS = (
    'mean_slide_mm', 'worst_slide_mm', 'force_percent', 'most_force_percent', 'onsets',
)  # fmt: skip

#: Colour of each condition that is drawn, the last one on top.
COLOR_OF = {UNCONTROLLED: COLORS[1], PAPER: COLORS[4], CONTROLLER: COLORS[0]}

#: Height of the displacement panel, as a multiple of the object's slide under the controller.
PANEL_SLIDES = 4.0


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure to a file, in the format that the ending names.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.
    """
    with whole_file(path) as new:
        figure.savefig(new, dpi=120)


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


def grasp_table(result: Mapping[str, Any]) -> str:
    """Return the content of ``grasp.json`` as text: conditions, and the trials with the nodes."""
    seeds, parts = result['seeds'], result['conditions']
    rows = [['', '', 'slide [mm]', '', 'grip [% of limit]'],
            ['', 'dropped', 'mean', 'worst', 'mean', 'most', 'onsets']]  # fmt: skip
    for name, part in parts.items():
        figures = [number_text(part[key], '.2f') for key in COLUMNS]
        rows.append([name, f'{part["dropped"]} of {part["trials"]}', *figures])
    needed = parts[CONTROLLER]['needed_percent']
    blocks = [
        f'{len(seeds)} objects (seeds {seeds[0]} to {seeds[-1]}): gripped, lifted and filled '
        'until they are two to three times as heavy\n'
        f'In simulated time, {result["transport_ms"]:g} ms from sample to command',
        text_table(rows),
        f'The smallest grip that would hold the objects: {needed:.1f} % of the limit.',
    ]
    if result['nodes']:
        rows = [['', 'slide [mm]', '', 'command [% of limit]'],
                ['seed', 'nodes', 'simulated', 'nodes', 'simulated']]  # fmt: skip
        for seed, part in result['nodes'].items():
            both = (part, part['simulated'])
            slides = (number_text(trial['slide_mm'], '.2f') for trial in both)
            commands = (number_text(trial['command_percent'], '.1f') for trial in both)
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
    path: Path, trials: Mapping[str, GraspTrial], limit_n: float, live: Mapping[str, Floats]
) -> None:
    """Draw one object: the grip and the decisions, and where it is under each condition.

    Parameters
    ----------
    path
        The picture to write.
    trials
        The trial of the object under each condition.
    limit_n
        The largest grip force.
    live
        The same object through the nodes: ``position`` and ``command``, arrays of shape (n, 2)
        with times in their first columns; empty where it was not played.
    """
    figure = Figure(figsize=(9, 7.2), layout='constrained')
    force, decision, place = figure.subplots(3, sharex=True, height_ratios=[3.0, 0.8, 2.6])
    held = trials[CONTROLLER]
    time_s, needed = held.time_s, 'just enough to hold it'
    force.fill_between(time_s, held.needed_n, color='0.55', alpha=0.3, linewidth=0, label=needed)
    force.axhline(limit_n, color=COLORS[2], linestyle='--', linewidth=1.2, label='limit')
    force.plot(time_s, held.command_n, color='k', linewidth=0.9, label='commanded')
    force.plot(time_s, held.force_n, color=COLOR_OF[CONTROLLER], linewidth=2.0, label='grip')
    force.set(ylabel='force [N]', ylim=(0.0, 1.06 * limit_n))
    force.set_title('One object: gripped, lifted, filled', fontsize=11)
    draw_decision(decision, time_s, held.slip, COLOR_OF[CONTROLLER], '/slip')
    decision.plot(time_s, held.sliding, color='0.35', label='it slides')
    # An object that slides further leaves the panel; the legend says how far it slides.
    most_mm = max(PANEL_SLIDES * float(held.position_m[-1]) * 1e3, 0.1)
    for name, color in COLOR_OF.items():
        trial = trials[name]
        end = 'dropped' if trial.dropped else f'{trial.position_m[-1] * 1e3:.2f} mm'
        place.plot(time_s, trial.position_m * 1e3, color=color, label=f'{name}: {end}')
    place.set(ylabel='displacement [mm]', ylim=(-0.03 * most_mm, most_mm), xlabel='time [s]')
    if live:
        dotted: Any = {'color': 'k', 'linestyle': ':', 'linewidth': 1.6}
        force.plot(*live['command'].T, **dotted, label='commanded, live')
        position_s, position_m = live['position'].T
        label = f'{CONTROLLER}, live: {position_m[-1] * 1e3:.2f} mm'
        place.plot(position_s, position_m * 1e3, **dotted, label=label)
    for axis in (force, decision, place):
        axis.set_xlim(time_s[0], time_s[-1])
        axis.legend(loc='best', fontsize=9, frameon=False)
    save_picture(figure, path)
