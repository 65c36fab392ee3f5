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

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.protocol import PAPER_DELAY_MS, PAPER_FALSE_POSITIVE_PERCENT
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.pictures import COLORS, draw_trial, save_picture
from slip_detector.report.tables import number_text, text_table, verdict_cells


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


def draw_protocol(
    folder: Path,
    plates: Mapping[str, Sequence[Samples]],
    config: ChainConfig,
    result: Mapping[str, Any],
) -> list[Path]:
    """Draw the counterparts of the paper's Figs. 4, 5 and 7.

    Parameters
    ----------
    folder
        An existing folder for the pictures.
    plates
        The trials of each plate. Fig. 5 shows the first trial of the first plate.
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
    paths = {number: folder / f'paper_fig{number}.png' for number in (4, 5, 7)}
    _draw_variants(paths[4], result['windows'], 'both windows\n[ms]')
    groups = dict(zip(config.groups, decided.groups.T, strict=True))
    times_s = np.asarray(trial.stamps_ns * 1e-9)
    motion_s = tuple(times_s[trial.truth][[0, -1]].tolist())
    draw_trial(paths[5], times_s, trial.volts, config, groups, decided.slip, motion_s)
    bands = {'as configured': result, **result['bands']}
    _draw_variants(paths[7], bands, 'band [Hz], no\nhigh stop-band')
    return list(paths.values())


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
