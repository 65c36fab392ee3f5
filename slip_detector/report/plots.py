"""Figures; the only file that imports a plotting library."""

import math
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
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Told apart also by the colour-blind (Okabe and Ito): blue, vermilion, green, purple, orange,
#: sky blue, black.
COLORS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
MARKERS = ('o', 's', '^', 'D')
RATE_MARKERS = ('o', 's', '^', 'D', 'v', 'P')

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


def draw_chain_precision(path: Path, precision: Mapping[str, Any]) -> None:
    """Draw the error of the chain and of its rivals against run time and against low edges.

    Parameters
    ----------
    path
        The picture to write.
    precision
        Of :func:`benchmarks.chain_precision.measure`.
    """
    figure, (work, low) = plt.subplots(ncols=2, figsize=(12, 5.2), layout='constrained')
    error_label = 'error of the level / its largest value'
    methods = list(precision['rates'][0]['methods'])
    colors = dict(zip(methods, COLORS, strict=False))

    def drawn(entry: Mapping[str, Any], method: str) -> float:
        # Where no digit is right, how wrong the figures are does not matter.
        figures = entry['methods'][method]
        return 1.0 if figures['state'] else float(figures['error'])

    for method in methods:
        errors = [drawn(entry, method) for entry in precision['rates']]
        times_us = [entry['methods'][method]['ns_per_row'] / 1e3 for entry in precision['rates']]
        name = 'the chain (float64 sections)' if method == 'chain' else method
        work.plot(errors, times_us, color=colors[method], linewidth=0.8, alpha=0.5)
        for error, time_us, marker in zip(errors, times_us, RATE_MARKERS, strict=False):
            work.plot(error, time_us, marker, color=colors[method], markersize=7, alpha=0.85)
        low.plot([], [], color=colors[method], linewidth=3, label=name)
    figure.legend(loc='outside upper center', ncols=len(methods), frameon=False)
    work.set(xscale='log', yscale='log', xlim=(1e-15, 10.0), xlabel=error_label)
    fastest_us, slowest_us = work.get_ylim()
    work.set(ylim=(fastest_us / 2, slowest_us * 2), ylabel='time a row of 16 channels [µs]')
    work.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    work.yaxis.set_major_formatter('{x:g}')
    work.yaxis.set_minor_locator(NullLocator())
    work.set_title('error against run time, by sample rate', fontsize=11)
    for entry, marker in zip(precision['rates'], RATE_MARKERS, strict=False):
        work.plot([], [], marker, color='0.4', label=f'{entry["sample_rate_hz"]:g} Hz')
    work.legend(loc='lower right', fontsize=9)

    networks = list(dict.fromkeys(entry['network'] for entry in precision['edges']))
    handles = []
    for network, style in zip(networks, ('-', '--'), strict=False):
        entries = [entry for entry in precision['edges'] if entry['network'] == network]
        taken = [entry for entry in entries if not entry['refused']]
        shares = [entry['edge_share'] for entry in taken]
        for method in methods:
            errors = [drawn(entry, method) for entry in taken]
            low.plot(shares, errors, style, color=colors[method], marker='o', markersize=4)
        handles += low.plot([], [], style, color='0.4', label=network)
    low.legend(handles=handles, loc='lower right', fontsize=8)
    refused = max(entry['edge_share'] for entry in precision['edges'] if entry['refused'])
    low.set(xscale='log', yscale='log', xlim=(refused / 2.5, 2e-3), ylim=(1e-15, 10.0))
    low.set(xlabel='lowest edge / sample rate', ylabel=error_label)
    low.set_title('error against the lowest edge of the bands', fontsize=11)
    low.axvspan(refused / 10, refused, color='#f3d9cf', zorder=0)
    low.text(refused / 1.6, 1e-8, 'refused before it starts', rotation=90, ha='center')
    work.axvspan(0.1, 10.0, color='0.9', zorder=0)
    low.axhspan(0.1, 10.0, color='0.9', zorder=0)
    work.text(1.0, slowest_us * 1.9, 'lost or\nunstable', ha='center', va='top', fontsize=9)
    low.text(1.9e-3, 3.5, 'lost or unstable', ha='right', va='center', fontsize=9)
    for axis in (work, low):
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    _save(figure, path)


def draw_scenes_precision(path: Path, result: Mapping[str, Any]) -> None:
    """Draw voltage error against run time of each scene, for the live stepper and its rivals.

    Parameters
    ----------
    path
        The picture to write.
    result
        Of :func:`benchmarks.scenes.measure`.
    """
    entries = [entry for entry in result['precision'] if entry['runs']]
    columns = min(3, max(len(entries), 1))
    rows = max(math.ceil(len(entries) / columns), 1)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.2 * rows + 0.6), sharex=True, sharey=True,
        squeeze=False, layout='constrained',
    )  # fmt: skip
    # Black for the one that all others are held against.
    names = ['live', 'LSODA', 'BDF', 'Radau', 'RK45', 'DOP853']
    colors = dict(zip(names, ('k', *COLORS), strict=False))
    markers = dict(zip(names, ('o', 's', '^', 'D', 'v', 'P'), strict=True))
    for axis, entry in zip(axes.flat, entries, strict=False):
        floor = entry['reference']['voltage_error']
        axis.axvspan(1e-12, floor, color='0.9', zorder=0)
        axis.axvline(1e-3, color='0.6', linestyle=':', linewidth=1)
        axis.axhline(1e3, color='0.6', linestyle='--', linewidth=1)
        for name in names:
            runs = [run for run in entry['runs'] if run['method'] == name and not run['said']]
            # Of a stretch only: hollow.
            whole = max((run['over'][1] - run['over'][0] for run in entry['runs']), default=0.0)
            for full in (True, False):
                some = [
                    run for run in runs if (run['over'][1] - run['over'][0] > 0.9 * whole) == full
                ]
                axis.plot(
                    [max(run['voltage_error'], floor) for run in some],
                    [run['run_time_per_s'] * 1e3 for run in some],
                    color=colors[name],
                    marker=markers[name],
                    markersize=5,
                    linewidth=1.6 if name == 'live' else 1.0,
                    linestyle='-' if full else ':',
                    markerfacecolor=colors[name] if full else 'w',
                    zorder=4 if name == 'live' else 3,
                )
        axis.set(xscale='log', yscale='log', xlim=(1e-9, 1.0))
        axis.set_title(entry['scene'], fontsize=10)
        axis.grid(color='0.93', linewidth=0.5)
        axis.set_axisbelow(True)
    for axis in axes.flat[len(entries) :]:
        axis.set_axis_off()
    figure.supxlabel("worst voltage error / range of the volts (grey: below the reference's own)")
    figure.supylabel('run time for a simulated second [ms] (dashed: real time)')
    handles = [
        Line2D(
            [], [], color=colors[name], marker=markers[name],
            label='the live stepper' if name == 'live' else name,
        )
        for name in names
    ]  # fmt: skip
    handles.append(
        Line2D([], [], color='0.4', marker='o', markerfacecolor='w', linestyle=':',
               label='a stretch about the onset')
    )  # fmt: skip
    figure.legend(handles=handles, loc='outside upper center', ncols=len(handles), frameon=False)
    _save(figure, path)
