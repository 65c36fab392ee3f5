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

"""Pictures of trials, their colours, and how they are saved."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slip_detector.chain.samples import Bools, Floats
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
