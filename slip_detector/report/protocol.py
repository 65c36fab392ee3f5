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

"""The figures of the paper's protocol as text, and the counterparts of the paper's pictures."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from slip_detector.chain.samples import Bools, Floats, Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.protocol import PAPER_DELAY_MS, PAPER_FALSE_POSITIVE_PERCENT
from slip_detector.evaluation.replay import of_filters
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.pictures import COLORS, draw_decision, draw_trial, save_picture
from slip_detector.report.tables import number_text, text_table, verdict_cells

#: The time about the start of the motion that is shown enlarged.
ENLARGED_S = (-0.04, 0.16)


def protocol_table(result: Mapping[str, Any]) -> str:
    """Return the figures as text: the paper's beside ours, and at the end the wanted ones.

    Parameters
    ----------
    result
        As :func:`slip_detector.evaluation.protocol.run_protocol` returns it.
    """
    plates, seeds = result['plates'], result['seeds']
    bands = {'as configured': result, **result['bands']}
    wanted = [[name, *verdict_cells(one)] for name, one in result['wanted'].items()]
    blocks = [
        f"The paper's protocol: {len(plates)} plates, {len(seeds)} trials on each, "
        f'seeds {seeds[0]} to {seeds[-1]}\n'
        'Delay [ms] from the start of the plate to the first ON, mean over the channels (Eq. 10)',
        text_table(_delays(result)),
        'False positives: share of the time at which the plate stands; in the paper '
        f'{result["paper"]["false_positive_percent"]:.2f} %',
        'Mean delay [ms] by the length of both windows [ms] (as Fig. 4)',
        text_table(_variants(plates, result['windows'])),
        'Mean delay [ms] by band [Hz], without the high stop-band (as Fig. 7)',
        text_table(_variants(plates, bands)),
        'Wanted',
        text_table(wanted),
    ]
    if result['plots']:
        blocks.append(f'Written: {", ".join(result["plots"])}')
    return '\n\n'.join(blocks)


def _delays(result: Mapping[str, Any]) -> list[list[str]]:
    """Return the delays of the single trials and the figures of all, by plate."""
    plates, paper = result['plates'], result['paper']
    columns = [*plates.values(), result['all']]
    rows = [['', *(f'{plate} um' for plate in plates), 'all']]

    def add(head: str, values: Iterable[Any], form: str = '.2f') -> None:
        rows.append([head, *(number_text(value, form) for value in values)])

    for k, seed in enumerate(result['seeds']):
        add(f'seed {seed}', (one['trial_delays_ms'][k] for one in plates.values()))
    for head, key in (('mean', 'mean_delay_ms'), ('sd', 'sd_delay_ms')):
        add(head, (column[key] for column in columns))
        add(f'{head}, paper', (paper['plates'][plate][key] for plate in plates))
    rows.append(['detected', *map(_detected, columns)])
    add('success [%]', (column['success_percent'] for column in columns), '.1f')
    add('false positives [%]', (column['false_positive_percent'] for column in columns))
    add('channels without ON', (column['channels_without_on'] for column in columns), 'd')
    return rows


def _variants(plates: Sequence[str], variants: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Return the mean delays and false positives of variants of the chain, by their names."""
    rows = [['', *(f'{plate} um' for plate in plates), 'detected', 'false positives [%]']]
    for name, part in variants.items():
        delays = (number_text(one['mean_delay_ms'], '.2f') for one in part['plates'].values())
        false_percent = number_text(part['all']['false_positive_percent'], '.2f')
        rows.append([name, *delays, _detected(part['all']), false_percent])
    return rows


def _detected(part: Mapping[str, Any]) -> str:
    return f'{part["detected"]} of {part["trials"]}'


def stage_signals(trial: Samples, config: ChainConfig, channel: int) -> dict[str, Floats]:
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
    >>> time_s = np.arange(760) / 380.0
    >>> volts = 4.3 + 0.02 * np.sin(2 * np.pi * 25.0 * time_s)[:, np.newaxis] * np.ones(16)
    >>> trial = Samples.evenly(volts, 380.0, time_s > 1.0)
    >>> {signal.shape for signal in stage_signals(trial, ChainConfig(), channel=1).values()}
    {(760,)}
    """
    evidence, at = config.decision == 'evidence', channel - 1
    result = SlipChain(config).update(trial.volts, floor=evidence, excess=evidence)
    # With windows of one sample the envelope is the filtered signal, rectified and raised.
    sharp = of_filters(config)
    half = dataclasses.replace(sharp, exponent=1, rectify='half', valid_range_v=(-1e9, 1e9))
    above, below, powered = (
        SlipChain(chain).update(volts).envelope[:, at]
        for chain, volts in ((half, trial.volts), (half, -trial.volts), (sharp, trial.volts))
    )
    unit = 'V' if config.exponent == 1 else f'V$^{config.exponent}$'
    signals = {
        'raw [V]': trial.volts[:, at],
        f'filtered,\ntimes {config.gain:g} [V]': above - below,
        f'rectified,\nto the power\nof {config.exponent} [{unit}]': powered,
        f'RMS envelope\n[{unit}]': result.envelope[:, at],
    }
    if not evidence:
        return {**signals, f'mean of the\nenvelope [{unit}]': result.level[:, at]}
    signals['noise floor\n[dB]'] = result.floor[:, at]
    signals['excess,\n0 after an\nimpact [dB]'] = result.excess[:, at]
    return {**signals, 'evidence\n[dB s]': result.level[:, at]}


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
    trial, *_ = next(iter(plates.values()))
    decided = SlipChain(config).update(trial.volts)
    channel = next(c for c in range(1, config.channels + 1) if c not in config.disabled_channels)
    paths = {number: folder / f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)}
    _draw_stages(paths[2], trial, config, channel, decided.channels[:, channel - 1])
    _draw_variants(paths[4], result['windows'], 'both windows\n[ms]')
    groups = dict(zip(config.groups, decided.groups.T, strict=True))
    times_s, motion_s = _times_s(trial)
    draw_trial(paths[5], times_s, trial.volts, config, groups, decided.slip, motion_s)
    _draw_decisions(paths[6], plates, config)
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
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    axes[0, 0].set_title('whole trials (grey: the plate moves)', fontsize=10)
    axes[0, 1].set_title('the start of the motion', fontsize=10)
    axes[0, 0].set_xlim(0.0, times_s[-1])
    axes[0, 1].set_xlim(motion_s[0] + ENLARGED_S[0], motion_s[0] + ENLARGED_S[1])
    for axis in axes[-1]:
        axis.set_xlabel('time [s]')
    return figure, axes


def _draw_stages(path: Path, trial: Samples, config: ChainConfig, channel: int, on: Bools) -> None:
    """Draw one channel after each stage of the chain, counterpart of the paper's Fig. 2."""
    stages = stage_signals(trial, config, channel)
    figure, axes = _panels(trial, [1.0] * len(stages) + [0.5])
    times_s, _ = _times_s(trial)
    for column in axes.T:
        for axis, values in zip(column, stages.values(), strict=False):
            axis.plot(times_s, values, color=COLORS[0], linewidth=0.9)
        label = f'threshold {config.threshold:g}'
        column[-2].axhline(config.threshold, color=COLORS[1], linestyle='--', label=label)
        draw_decision(column[-1], times_s, on, COLORS[0], '')
    for axis, name in zip(axes[:, 0], [*stages, 'decision'], strict=True):
        axis.set_ylabel(name)
    axes[-2, 0].legend(loc='upper left')
    save_picture(figure, path)


def _draw_decisions(
    path: Path, plates: Mapping[str, Sequence[Samples]], config: ChainConfig
) -> None:
    """Draw the global decision of each trial, counterpart of the paper's Fig. 6.

    A row of bars is a trial; a bar shows that slip is ON.
    """
    figure, axes = _panels(next(iter(plates.values()))[0], [1.35] * len(plates))
    for (plate, trials), color, panels in zip(plates.items(), COLORS, axes, strict=False):
        for number, trial in enumerate(trials, start=1):
            slip = SlipChain(config).update(trial.volts, envelope=False, level=False).slip
            low, high = number - 0.35, number + 0.35
            for axis in panels:
                axis.fill_between(_times_s(trial)[0], low, high, slip, color=color, linewidth=0)
        panels[0].set(ylabel=f'{plate} µm\ntrial', ylim=(len(trials) + 0.7, 0.3))
        panels[0].yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    save_picture(figure, path)


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
