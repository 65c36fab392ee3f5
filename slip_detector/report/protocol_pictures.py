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

"""The counterparts of the paper's figures, drawn from the trials of its protocol."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain.filters import design
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.evaluation.protocol import (
    PAPER_DELAY_MS,
    PAPER_FALSE_POSITIVE_PERCENT,
    PlateTrial,
    band_name,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.pictures import COLORS, save_picture
from slip_detector.report.trial_pictures import ENLARGED_S, draw_stages, draw_trial

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MARKERS = ('o', 's', '^', 'D')


def stage_signals(trial: PlateTrial, config: ChainConfig, channel: int) -> dict[str, Floats]:
    """Return the signals of one channel after each stage of the chain (Eq. 1-8).

    Parameters
    ----------
    trial
        A trial without bad samples.
    config
        The parameters of the chain.
    channel
        An enabled channel, counted from 1.

    Returns
    -------
    dict
        Arrays of shape (n,), by the name and unit of the signal, in the order of the stages. The
        last signals come from the chain itself: the envelope, with evidence also noise floor and
        excess, and the level, which is compared with the threshold.

    Raises
    ------
    ValueError
        When the chain cannot be built.

    Examples
    --------
    >>> from slip_detector.evaluation.protocol import plate_trial
    >>> time_s = np.arange(760) / 380.0
    >>> volts = 4.3 + 0.02 * np.sin(2 * np.pi * 25.0 * time_s)[:, np.newaxis] * np.ones(16)
    >>> trial = plate_trial(volts, np.clip(time_s - 1.0, 0.0, 0.5), 380.0)
    >>> {signal.shape for signal in stage_signals(trial, ChainConfig(), channel=1).values()}
    {(760,)}
    """
    evidence = config.decision == 'evidence'
    result = SlipChain(config).update(trial.volts, floor=evidence, excess=evidence)
    # Like the chain, filter the deviations from the first row, the baseline.
    deviations = trial.volts - trial.volts[0]
    volts = deviations[:, channel - 1]
    if config.common_mode != 'none':
        enabled = [c for c in range(config.channels) if c + 1 not in config.disabled_channels]
        volts = volts - getattr(np, config.common_mode)(deviations[:, enabled], axis=1)
    if config.mains_rows:
        before = volts[: -config.mains_rows]
        volts = np.concatenate([np.zeros(config.mains_rows), volts[config.mains_rows :] - before])
    filtered = signal.sosfilt(design(config), volts)
    rectified = np.abs(filtered) if config.rectify == 'full' else np.maximum(filtered, 0.0)
    unit = 'V' if config.exponent == 1 else f'V$^{config.exponent}$'
    at = channel - 1
    decided = {f'mean of the\nenvelope [{unit}]': result.level[:, at]}
    if evidence:
        decided = {
            'noise floor\n[dB]': result.floor[:, at],
            'excess,\n0 after an\nimpact [dB]': result.excess[:, at],
            'evidence\n[dB s]': result.level[:, at],
        }
    return {
        'raw [V]': trial.volts[:, channel - 1],
        f'filtered,\ntimes {config.gain:g} [V]': filtered,
        f'rectified,\nto the power\nof {config.exponent} [{unit}]': rectified**config.exponent,
        f'RMS envelope\n[{unit}]': result.envelope[:, channel - 1],
        **decided,
    }


def draw_protocol(
    folder: Path,
    plates: Mapping[str, Sequence[PlateTrial]],
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
        The figures of these trials, from :func:`slip_detector.evaluation.protocol.run_protocol`.

    Returns
    -------
    list of Path
        The pictures.

    Raises
    ------
    ValueError
        When a picture cannot be written; names it.
    """
    chain = SlipChain(config)
    decisions = {
        plate: np.array([_decisions(trial, chain).slip for trial in trials])
        for plate, trials in plates.items()
    }
    first_plate, (trial, *_) = next(iter(plates.items()))
    decided = _decisions(trial, chain)
    channel = next(c for c in range(1, config.channels + 1) if c not in config.disabled_channels)
    of_trial = f'plate of {first_plate} µm, trial with the seed {result["seeds"][0]}'
    paths = {number: folder / f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)}
    draw_stages(
        paths[2],
        trial.time_s,
        stage_signals(trial, config, channel),
        decided.channels[:, channel - 1],
        config.threshold,
        trial.motion_s,
        f'{config.names[channel - 1]} from stage to stage; {of_trial}',
    )
    draw_windows(paths[4], _by_plate(result['windows']), PAPER_FALSE_POSITIVE_PERCENT)
    draw_trial(
        paths[5],
        trial.time_s,
        trial.volts,
        config,
        dict(zip(config.groups, decided.groups.T, strict=True)),
        decided.slip,
        trial.motion_s,
        f'Channels by group, decisions of the groups and of all; {of_trial}',
    )
    _draw_decisions(
        paths[6],
        {plate: trials[0].time_s for plate, trials in plates.items()},
        {plate: trials[0].position_m for plate, trials in plates.items()},
        decisions,
        {plate: trials[0].motion_s for plate, trials in plates.items()},
    )
    draw_bands(
        paths[7],
        _by_plate(
            {
                'as configured': result,
                **{band_name(name): part for name, part in result['bands'].items()},
            }
        ),
        PAPER_DELAY_MS,
    )
    return list(paths.values())


def _decisions(trial: PlateTrial, chain: SlipChain) -> SlipResult:
    """Run a trial through a chain from its first row."""
    chain.reset()
    return chain.update(trial.volts, envelope=False, level=False)


def _by_plate(variants: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the figures of each plate, by plate and then by variant of the chain."""
    plates = next(iter(variants.values()))['plates']
    return {
        plate: {name: part['plates'][plate] for name, part in variants.items()} for plate in plates
    }


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
        The false positives that the paper reports for its windows.

    Examples
    --------
    >>> import tempfile
    >>> one = {'mean_delay_ms': 39.0, 'sd_delay_ms': None, 'false_positive_percent': 0.5}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'windows.png'
    ...     draw_windows(path, {'400': {'40': one}}, paper_percent=1.01)
    ...     path.is_file()
    True
    """
    figure, (delay, share) = plt.subplots(1, 2, figsize=(9, 3.8), layout='constrained')
    spread = np.linspace(-0.3, 0.3, len(figures))  # so that equal figures hide none
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
    save_picture(figure, path)


def _draw_decisions(
    path: Path,
    time_s: Mapping[str, Floats],
    position_m: Mapping[str, Floats],
    on: Mapping[str, Bools],
    motion_s: Mapping[str, tuple[float, float]],
) -> None:
    """Draw the global decision beside the motion, counterpart of the paper's Fig. 6.

    The whole trials are on the left, the start of the motion on the right. A row of bars is a
    trial.

    Parameters
    ----------
    path
        The picture to write.
    time_s, position_m
        Times of the samples and positions of the platform for each plate, arrays of shape (n,).
    on
        The decisions for each plate, arrays of shape (trials, n).
    motion_s
        When each plate started and stopped.
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
    save_picture(figure, path)


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
        The paper's figures are drawn beside the first band.
    paper
        The paper's mean and standard deviation in milliseconds, by plate.

    Examples
    --------
    >>> import tempfile
    >>> one = {'mean_delay_ms': 39.0, 'sd_delay_ms': 2.0}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'bands.png'
    ...     draw_bands(path, {'400': {'[7, 50] Hz': one}}, {'400': (36.0, 3.9)})
    ...     path.is_file()
    True
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
    save_picture(figure, path)


def _column(parts: Mapping[str, Mapping[str, Any]], key: str) -> Floats:
    """Return one figure of each part; NaN where it is not defined."""
    values = [part[key] for part in parts.values()]
    return np.array([np.nan if value is None else value for value in values])
