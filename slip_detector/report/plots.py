"""Figures; the only file that imports a plotting library."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use('Agg')  # files only: a robot has no screen

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Told apart also by the colour-blind (Okabe and Ito): blue, vermilion, green, purple, orange,
#: sky blue, black.
COLORS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
MARKERS = ('o', 's', '^', 'D')

#: How much around the start of the motion is shown enlarged.
ENLARGED_S = (-0.04, 0.16)


def writable_picture(name: str | Path) -> Path:
    """Return the path of a picture that is to be drawn later; its folder is made.

    Raises
    ------
    OSError
        When its folder cannot be made.
    ValueError
        When no picture can be written there.
    """
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ValueError(f'{path}: cannot be written, allowed: a file in a folder of your own')
    kinds = sorted(FigureCanvasAgg.get_supported_filetypes())
    if path.suffix and path.suffix[1:].lower() not in kinds:
        raise ValueError(f'{path}: has the ending {path.suffix}, allowed: .{", .".join(kinds)}')
    return path


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=120)
    plt.close(figure)


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
        What is shown.
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
    _save(figure, path)


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

    To the left the whole trial, to the right the start of the motion.

    Parameters
    ----------
    path
        The picture to write.
    time_s : ndarray, shape (n,)
        When the samples were taken.
    stages
        By name and unit, first the raw signal, last what is held against the threshold: arrays of
        shape (n,).
    on : ndarray of bool, shape (n,)
        The channel's decision.
    threshold
        Of the last stage, in its unit.
    motion_s
        When the plate started and stopped.
    title
        What is shown.
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
    _save(figure, path)


def draw_windows(
    path: Path, figures: Mapping[str, Mapping[str, Mapping[str, Any]]], paper_percent: float
) -> None:
    """Draw delay and false positives against the windows, counterpart of the paper's Fig. 4.

    Parameters
    ----------
    path
        The picture to write.
    figures
        By plate and length of the windows in milliseconds: ``mean_delay_ms``, ``sd_delay_ms`` and
        ``false_positive_percent``; None where one is not defined.
    paper_percent
        What the paper reports for its choice.
    """
    figure, (delay, share) = plt.subplots(1, 2, figsize=(9, 3.8), layout='constrained')
    spread = np.linspace(-0.3, 0.3, len(figures))  # so that equal figures do not hide each other
    styles = zip(figures.items(), spread, COLORS, MARKERS, strict=False)
    for (plate, by_window), shift, color, marker in styles:
        window_ms = np.array([float(name) for name in by_window]) + shift
        style = {'color': color, 'marker': marker, 'label': f'{plate} µm'}
        mean, sd = _column(by_window, 'mean_delay_ms'), _column(by_window, 'sd_delay_ms')
        delay.errorbar(window_ms, mean, np.nan_to_num(sd), capsize=3, **style)
        share.plot(window_ms, _column(by_window, 'false_positive_percent'), **style)
    share.axhline(paper_percent, color='0.4', linestyle='--', label=f'paper: {paper_percent:g} %')
    delay.set(ylabel='mean delay ± sd [ms]', title='Delay from the start of the plate')
    share.set(ylabel='ON while the plate stands [%]', title='False positives')
    for axis in (delay, share):
        axis.set_xlabel('length of both windows [ms]')
        axis.set_xticks([float(name) for name in next(iter(figures.values()))])
        axis.set_ylim(bottom=0.0)
        axis.grid(color='0.9', linewidth=0.5)
    share.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))
    _save(figure, path)


def draw_decisions(
    path: Path,
    time_s: Mapping[str, Floats],
    position_m: Mapping[str, Floats],
    on: Mapping[str, Bools],
    motion_s: Mapping[str, tuple[float, float]],
) -> None:
    """Draw the global decision beside the motion, counterpart of the paper's Fig. 6.

    To the left the whole trials, to the right the start of the motion; a line of bars is a trial.

    Parameters
    ----------
    path
        The picture to write.
    time_s, position_m
        By plate: when the samples were taken and where the platform was, arrays of shape (n,).
    on
        By plate: the decision of each trial, arrays of shape (trials, n).
    motion_s
        By plate: when it started and stopped.
    """
    figure, axes = plt.subplots(
        1 + len(on),
        2,
        sharex='col',
        figsize=(11, 1.8 * (1 + len(on))),
        layout='constrained',
    )
    for p, plate in enumerate(on):
        start_s, end_s = motion_s[plate]
        for column in range(2):
            where, bars = axes[0, column], axes[1 + p, column]
            times = (time_s[plate] - start_s) * 1e3 if column else time_s[plate]
            shown = times <= ENLARGED_S[1] * 1e3 if column else times >= 0.0
            where.plot(times[shown], position_m[plate][shown] * 1e3, color='0.2')
            for trial, decision in enumerate(on[plate], start=1):
                edges = np.flatnonzero(np.diff(decision, prepend=False, append=False))
                turns = np.append(times, times[-1] + times[1] - times[0])[edges]
                spans = np.column_stack([turns[::2], np.diff(turns)[::2]])
                bars.broken_barh(spans, (trial - 0.35, 0.7), color=COLORS[p % len(COLORS)])
            bars.set_ylim(len(on[plate]) + 0.7, 0.3)
            bars.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
            moves = (0.0, (end_s - start_s) * 1e3) if column else (start_s, end_s)
            for axis in (where, bars):
                axis.axvspan(*moves, color='0.92', zorder=0)
        axes[1 + p, 0].set_ylabel(f'{plate} µm\ntrial')
    axes[0, 0].set_ylabel('platform [mm]')
    axes[0, 0].set_title('whole trials (grey: the plate moves; bars: slip is ON)', fontsize=10)
    axes[0, 1].set_title('the start of the motion', fontsize=10)
    axes[-1, 0].set(xlabel='time [s]', xlim=(0.0, max(times[-1] for times in time_s.values())))
    axes[-1, 1].set(
        xlabel='time since the start of the plate [ms]',
        xlim=tuple(edge_s * 1e3 for edge_s in ENLARGED_S),
    )
    _save(figure, path)


def draw_bands(
    path: Path,
    figures: Mapping[str, Mapping[str, Mapping[str, Any]]],
    paper: Mapping[str, tuple[float, float]],
) -> None:
    """Draw the delay with other bands, counterpart of the paper's Fig. 7.

    Parameters
    ----------
    path
        The picture to write.
    figures
        By plate and band: ``mean_delay_ms`` and ``sd_delay_ms``; None where one is not defined.
        The first band is the one that the paper's figures are for.
    paper
        By plate: the paper's mean and standard deviation in milliseconds.
    """
    figure, axis = plt.subplots(figsize=(8, 4.2), layout='constrained')
    bands = list(next(iter(figures.values())))
    width = 0.8 / (len(bands) + 1)
    places = np.arange(len(figures))
    for b, (band, color) in enumerate(zip(bands, COLORS, strict=False)):
        parts = {plate: by_band[band] for plate, by_band in figures.items()}
        mean, sd = _column(parts, 'mean_delay_ms'), _column(parts, 'sd_delay_ms')
        at = places + (b - len(bands) / 2) * width
        axis.bar(at, mean, 0.9 * width, yerr=np.nan_to_num(sd), capsize=3, color=color, label=band)
        for x, value in zip(at, mean, strict=True):
            label = '-' if np.isnan(value) else f'{value:.1f}'
            axis.text(x, 1.0, label, color='w', ha='center', va='bottom', fontsize=9)
    means, deviations = zip(*(paper[plate] for plate in figures), strict=True)
    at = places + len(bands) / 2 * width
    axis.errorbar(
        at, means, deviations, fmt='D', color='k', capsize=4, label='paper, its own band'
    )
    axis.set_xticks(places, [f'{plate} µm' for plate in figures])
    axis.set(xlabel='spatial period of the plate', ylabel='mean delay ± sd [ms]', ylim=(0.0, None))
    axis.grid(axis='y', color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    axis.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    _save(figure, path)


def _column(parts: Mapping[str, Mapping[str, Any]], key: str) -> Floats:
    """Return one figure of each part; NaN where it is not defined."""
    values = [part[key] for part in parts.values()]
    return np.array([np.nan if value is None else value for value in values])
