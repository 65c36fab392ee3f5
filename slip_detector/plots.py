"""Figures; the only file that imports a plotting library."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use('Agg')  # files only: a robot has no screen

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from slip_detector.config import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def draw_trial(
    path: Path,
    time_s: Floats,
    volts: Floats,
    config: ChainConfig,
    groups: Mapping[str, Bools],
    slip: Bools,
    motion_s: tuple[float, float],
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
        When the plate started and stopped.
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
        for channel in config.groups[name]:
            raw.plot(time_s, volts[:, channel - 1], linewidth=0.7, label=f'{channel}')
        raw.set_ylabel(f'{name} [V]')
        raw.legend(title='channel', loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize=8)
        _draw_decision(decision, time_s, on, 'C0')
        decision.set_ylabel(name)
    _draw_decision(axes[-1], time_s, slip, 'C3')
    axes[-1].set_ylabel('slip')
    axes[-1].set_xlabel('time [s]')
    axes[-1].set_xlim(time_s[0], time_s[-1])
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
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_decision(axis: Axes, time_s: Floats, on: Bools, color: str) -> None:
    axis.fill_between(time_s, on.astype(float), step='post', color=color, alpha=0.6, linewidth=0)
    axis.set_ylim(-0.1, 1.2)
    axis.set_yticks([0, 1], ['OFF', 'ON'])
