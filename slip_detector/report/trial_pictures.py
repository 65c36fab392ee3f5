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

"""Pictures of one trial: its channels and decisions, and one channel from stage to stage."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.pictures import COLORS, save_picture

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: The time around the start of the motion that is shown enlarged.
ENLARGED_S = (-0.04, 0.16)


def draw_trial(
    path: Path,
    time_s: Floats,
    volts: Floats,
    config: ChainConfig,
    groups: Mapping[str, Bools],
    slip: Bools,
    motion_s: tuple[float, float] | None,
    title: str = '',
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
    title
        Title of the picture.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector import SlipChain
    >>> config = ChainConfig(channels=2)
    >>> volts = np.full((20, 2), 4.3)
    >>> result = SlipChain(config).update(volts)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.png'
    ...     groups = {'all': result.groups[:, 0]}
    ...     draw_trial(path, np.arange(20) / 380.0, volts, config, groups, result.slip, None)
    ...     path.is_file()
    True
    """
    n_groups = len(groups)
    figure, axes = plt.subplots(
        2 * n_groups + 1,
        sharex=True,
        figsize=(9, 2.2 * n_groups + 1),
        height_ratios=[3, 1] * n_groups + [1.2],
        layout='constrained',
    )
    for g, (name, on) in enumerate(groups.items()):
        raw, decision = axes[2 * g], axes[2 * g + 1]
        raw.set_prop_cycle(color=COLORS)
        for channel in config.groups[name]:
            raw.plot(time_s, volts[:, channel - 1], linewidth=0.7, label=f'{channel}')
        raw.set_ylabel(f'{name} [V]')
        raw.legend(title='channel', loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize=8)
        _draw_decision(decision, time_s, on, COLORS[0])
        decision.set_ylabel(name)
    _draw_decision(axes[-1], time_s, slip, COLORS[1])
    axes[-1].set_ylabel('slip')
    axes[-1].set_xlabel('time [s]')
    axes[-1].set_xlim(time_s[0], time_s[-1])
    if motion_s:
        _mark_motion(axes, motion_s)
    if title:
        figure.suptitle(title)
    save_picture(figure, path)


def draw_stages(
    path: Path,
    time_s: Floats,
    stages: Mapping[str, Floats],
    on: Bools,
    threshold: float,
    motion_s: tuple[float, float],
    title: str,
) -> None:
    """Draw one channel after each stage of the chain, counterpart of the paper's Fig. 2.

    The whole trial is on the left, the start of the motion on the right.

    Parameters
    ----------
    path
        The picture to write.
    time_s : ndarray, shape (n,)
        When the samples were taken.
    stages
        The signals after each stage, arrays of shape (n,), by name and unit: first the raw
        signal, last the level, which is compared with the threshold.
    on : ndarray of bool, shape (n,)
        The channel's decision.
    threshold
        In the unit of the level.
    motion_s
        When the plate started and stopped.
    title
        Title of the picture.

    Examples
    --------
    >>> import tempfile
    >>> time_s, level = np.arange(40) / 380.0, np.linspace(0.0, 1.0, 40)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'stages.png'
    ...     draw_stages(path, time_s, {'level [V]': level}, level > 0.5, 0.5, (0.05, 0.1), 'ch1')
    ...     path.is_file()
    True
    """
    n_rows = len(stages) + 1
    figure, axes = plt.subplots(
        n_rows,
        2,
        sharex='col',
        figsize=(11, 1.35 * n_rows + 1),
        height_ratios=[1.0] * len(stages) + [0.5],
        layout='constrained',
    )
    enlarged = (time_s >= motion_s[0] + ENLARGED_S[0]) & (time_s <= motion_s[0] + ENLARGED_S[1])
    sides = ((time_s, enlarged | True), ((time_s - motion_s[0]) * 1e3, enlarged))
    for column, (times, rows) in enumerate(sides):
        for axis, (name, values) in zip(axes[:-1, column], stages.items(), strict=True):
            axis.plot(times[rows], values[rows], color=COLORS[0], linewidth=0.9)
            axis.grid(color='0.9', linewidth=0.5)
            if not column:
                axis.set_ylabel(name)
        level = axes[-2, column]
        level.axhline(threshold, color=COLORS[1], linestyle='--', label=f'threshold {threshold:g}')
        _draw_decision(axes[-1, column], times[rows], on[rows], COLORS[0])
    axes[-2, 0].legend(loc='upper left')
    axes[-1, 0].set_ylabel('decision')
    axes[0, 0].set_title('the whole trial (grey: the plate moves)', fontsize=10)
    axes[0, 1].set_title('the start of the motion', fontsize=10)
    axes[-1, 0].set(xlabel='time [s]', xlim=(time_s[0], time_s[-1]))
    axes[-1, 1].set(
        xlabel='time since the start of the plate [ms]',
        xlim=tuple(edge_s * 1e3 for edge_s in ENLARGED_S),
    )
    for axis in axes[:, 0]:
        axis.axvspan(*motion_s, color='0.92', zorder=0)
    for axis in axes[:, 1]:
        axis.axvspan(0.0, ENLARGED_S[1] * 1e3, color='0.92', zorder=0)
    figure.suptitle(title)
    save_picture(figure, path)


def _mark_motion(axes: Sequence[Axes], motion_s: tuple[float, float]) -> None:
    for axis in axes:
        axis.axvspan(*motion_s, color='0.92', zorder=0)
        axis.axvline(motion_s[0], color='k', linestyle='--', linewidth=1)
    axes[0].annotate(
        'start of motion',
        (motion_s[0], 1.0),
        xycoords=('data', 'axes fraction'),
        xytext=(-4, 3),
        textcoords='offset points',
        ha='right',
        fontsize=9,
    )
    axes[0].annotate(
        'plate moves',
        (motion_s[0], 1.0),
        xycoords=('data', 'axes fraction'),
        xytext=(4, 3),
        textcoords='offset points',
        color='0.4',
        fontsize=9,
    )


def _draw_decision(axis: Axes, time_s: Floats, on: Bools, color: str) -> None:
    axis.fill_between(time_s, on.astype(float), step='post', color=color, alpha=0.6, linewidth=0)
    axis.set_ylim(-0.1, 1.2)
    axis.set_yticks([0, 1], ['OFF', 'ON'])
