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

"""The counterparts of the paper's Figs. 2, 4, 5, 6 and 7."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from benchmarks.paper.protocol import PAPER_DELAY_MS, PAPER_FALSE_POSITIVE_PERCENT
from slip_detector.chain.samples import Floats, Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.replay import only_filters
from slip_detector.parameters import ChainConfig
from slip_detector.report.pictures import COLORS, draw_decision, draw_trial, save_picture

#: The time about the start of the motion that is shown enlarged.
ENLARGED_S = (-0.04, 0.16)


def stage_signals(trial: Samples, config: ChainConfig, channel: int) -> dict[str, Floats]:
    """Return the signals of a channel, counted from 1, after each stage of the chain (Eq. 1-8).

    Returns
    -------
    dict
        Arrays of shape (n,), by the name and unit of the signal, in the order of the stages. The
        last one is compared with the threshold.

    Examples
    --------
    >>> volts = 4.3 + 0.02 * np.sin(np.arange(760.0))[:, np.newaxis] * np.ones(16)
    >>> trial = Samples.evenly(volts, 380.0, np.arange(760) > 380)
    >>> {signal.shape for signal in stage_signals(trial, ChainConfig(), channel=1).values()}
    {(760,)}
    """
    at, sharp = channel - 1, only_filters(config)
    half = dataclasses.replace(sharp, exponent=1, rectify='half', valid_range_v=(-1e9, 1e9))
    above, below, powered = (
        SlipChain(chain).update(volts).envelope[:, at]
        for chain, volts in ((half, trial.volts), (half, -trial.volts), (sharp, trial.volts))
    )
    result = SlipChain(config).update(trial.volts)
    unit = 'V' if config.exponent == 1 else f'V$^{config.exponent}$'
    last = f'mean of the\nenvelope [{unit}]' if config.decision == 'mean' else 'evidence\n[dB s]'
    return {
        'raw [V]': trial.volts[:, at],
        f'filtered,\ntimes {config.gain:g} [V]': above - below,
        f'rectified,\nto the power\nof {config.exponent} [{unit}]': powered,
        f'RMS envelope\n[{unit}]': result.envelope[:, at],
        last: result.level[:, at],
    }


def draw_protocol(
    folder: Path,
    plates: Mapping[str, Sequence[Samples]],
    config: ChainConfig,
    result: Mapping[str, Any],
) -> list[Path]:
    """Draw the counterparts of the paper's Figs. 2, 4, 5, 6 and 7.

    Parameters
    ----------
    folder
        An existing folder for the pictures.
    plates
        The trials of each plate. Figs. 2 and 5 show the first trial of the first plate.
    config
        The parameters of the chain.
    result
        The figures of these trials, from :func:`benchmarks.paper.protocol.run_protocol`.

    Returns
    -------
    list of Path
        The pictures.

    Raises
    ------
    ValueError
        When a picture cannot be written; names it.
    """
    trial, *_ = next(iter(plates.values()))
    decided = SlipChain(config).update(trial.volts)
    paths = {number: folder / f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)}
    _draw_variants(paths[4], result['windows'], 'both windows\n[ms]')
    groups = dict(zip(config.groups, decided.groups.T, strict=True))
    times_s, motion_s = _times_s(trial)
    channel = next(c for c in range(1, config.channels + 1) if c not in config.disabled_channels)
    signals = stage_signals(trial, config, channel)
    figure, axes = _panels(trial, [1.0] * len(signals) + [0.5])
    for column in axes.T:
        for axis, values in zip(column, signals.values(), strict=False):
            axis.plot(times_s, values, color=COLORS[0], linewidth=0.9)
        label = f'threshold {config.threshold:g}'
        column[-2].axhline(config.threshold, color=COLORS[1], linestyle='--', label=label)
        draw_decision(column[-1], times_s, decided.channels[:, channel - 1], COLORS[0], '')
    for axis, name in zip(axes[:, 0], [*signals, 'decision'], strict=True):
        axis.set_ylabel(name)
    axes[-2, 0].legend(loc='upper left')
    save_picture(figure, paths[2])
    draw_trial(paths[5], times_s, trial.volts, config, groups, decided.slip, motion_s)
    # A row of bars is a trial; a bar shows that slip is ON.
    figure, axes = _panels(trial, [1.35] * len(plates))
    for (plate, trials), color, panels in zip(plates.items(), COLORS, axes, strict=False):
        for number, one in enumerate(trials, start=1):
            slip = SlipChain(config).update(one.volts, envelope=False, level=False).slip
            for axis in panels:
                bar = _times_s(one)[0], number - 0.35, number + 0.35, slip
                axis.fill_between(*bar, color=color, linewidth=0)
        panels[0].set(ylabel=f'{plate} µm\ntrial', ylim=(len(trials) + 0.7, 0.3))
        panels[0].yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    save_picture(figure, paths[6])
    bands = {'as configured': result, **result['bands']}
    _draw_variants(paths[7], bands, 'band [Hz], no\nhigh stop-band')
    return list(paths.values())


def _times_s(trial: Samples) -> tuple[Floats, tuple[float, float]]:
    """Return when each row was taken, and from when to when the plate moves."""
    times_s = np.asarray(trial.stamps_ns * 1e-9)
    moving_s = times_s[trial.truth]
    return times_s, (moving_s[0], moving_s[-1])


def _panels(trial: Samples, heights: Sequence[float]) -> tuple[Figure, Any]:
    """Return a figure with whole trials on the left, the start of the motion on the right."""
    times_s, motion_s = _times_s(trial)
    figure = Figure(figsize=(11, 1.35 * sum(heights) + 1), layout='constrained')
    axes = figure.subplots(len(heights), 2, sharex='col', sharey='row', height_ratios=heights)
    for axis in axes.flat:
        axis.axvspan(*motion_s, color='0.92', zorder=0)
    axes[0, 0].set(title='whole trials (grey: the plate moves)', xlim=(0.0, times_s[-1]))
    begin_s, end_s = (motion_s[0] + s for s in ENLARGED_S)
    axes[0, 1].set(title='the start of the motion', xlim=(begin_s, end_s))
    for axis in axes[-1]:
        axis.set_xlabel('time [s]')
    return figure, axes


def _draw_variants(path: Path, variants: Mapping[str, Mapping[str, Any]], title: str) -> None:
    """Draw delay and false positives of variants of the chain beside those of the paper."""
    figure = Figure(figsize=(11, 4.2), layout='constrained')
    delay, share = figure.subplots(1, 2)
    plates = list(next(iter(variants.values()))['plates'])
    places = np.arange(len(plates))
    keys = 'mean_delay_ms', 'sd_delay_ms', 'false_positive_percent'
    for v, ((name, part), color) in enumerate(zip(variants.items(), COLORS, strict=False)):
        # NaN where a figure is not defined.
        mean_ms, sd_ms, false_percent = np.array(
            [[part['plates'][plate][key] for plate in plates] for key in keys], np.float64
        )
        at, style = places + 0.15 * v, {'fmt': 'o', 'capsize': 4, 'color': color}
        delay.errorbar(at, mean_ms, np.nan_to_num(sd_ms), **style)
        share.plot(at, false_percent, 'o', color=color, label=name)
    paper_ms, paper_sd_ms = zip(*(PAPER_DELAY_MS[plate] for plate in plates), strict=True)
    paper = {'fmt': 'D', 'capsize': 4, 'color': 'k', 'label': 'the paper'}
    delay.errorbar(places - 0.15, paper_ms, paper_sd_ms, **paper)
    share.axhline(PAPER_FALSE_POSITIVE_PERCENT, color='k', linestyle='--', label='the paper')
    delay.legend()
    for axis, unit in ((delay, 'mean delay ± sd [ms]'), (share, 'ON while the plate stands [%]')):
        axis.set(ylabel=unit, ylim=(0.0, None))
        axis.set_xticks(places, [f'{plate} µm' for plate in plates])
        axis.grid(axis='y', color='0.9', linewidth=0.5)
    share.legend(title=title, loc='center left', bbox_to_anchor=(1.0, 0.5), frameon=False)
    save_picture(figure, path)
