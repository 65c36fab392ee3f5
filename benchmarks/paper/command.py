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

"""The paper's protocol on three plates: its Table 2 beside ours, and pictures like its figures.

Keys of ``python -m benchmarks paper --json``:

``trials``
    ``seeds`` of the trials of each plate, and ``scenes``, the scene of each plate. A plate is
    named by its spatial period in micrometres (``400``, ``440``, ``480``).
``paper``
    What the paper reports: ``mean_delay_ms`` and ``sd_delay_ms`` of each plate under ``plates``,
    and ``false_positive_percent``.
``plates``
    For each plate: ``trial_delays_ms``, the delay of each trial. It is the mean over the channels
    (Eq. 10) of the time from the last sample at which the plate still stood (Eq. 9) to the first
    ON of the channel before the plate stands again. ``mean_delay_ms`` and ``sd_delay_ms`` (n - 1)
    of the trials; ``detected``, the number of trials whose global decision is ON while the plate
    moves, out of ``trials``, and ``success_percent``, their share; ``false_positive_percent``, the
    share of the time at which the plate stands in which the global decision is ON;
    ``channels_without_on``, how many channels in all trials have no such ON and are left out of
    the means. A figure that is not defined is null.
``all``
    The same figures over the trials of all plates.
``windows``
    ``plates`` and ``all`` by the length of both windows in milliseconds (``20``, ``30``, ``40``).
``bands``
    ``plates`` and ``all`` by the edges of the band-pass in Hz (``10-100``, ``10-150``), without
    the stop-bands above the configured band.
``claims``
    The figures that are wanted; see :data:`benchmarks.paper.protocol.WANTED`.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.measurement import shared_options
from benchmarks.paper.protocol import (
    PAPER_DELAY_MS,
    PAPER_FALSE_POSITIVE_PERCENT,
    SCENES,
    WANTED,
    run_protocol,
    simulate_trials,
)
from slip_detector.parameters import ChainConfig
from slip_detector.report.texts import number_text, text_table

__all__ = ['WANTED', 'as_table', 'measure', 'options']

#: Trials on each plate (Section 3), and with ``--quick``.
TRIALS, QUICK_TRIALS = 10, 2


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'paper',
        "Simulate the paper's protocol on plates of 400, 440 and 480 um, and the same trials with "
        'other windows and bands of the chain.',
    )
    parser.add_argument('--config', metavar='FILE', help='parameters of the chain, as YAML')
    parser.add_argument('--seed', type=int, default=0, help='seed of the first trial (default: 0)')
    parser.add_argument(
        '--plot', type=Path, metavar='FOLDER', help='draw Figs. 2, 4, 5, 6 and 7 to this folder'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Simulate the trials and run them through the chains."""
    config = ChainConfig.from_yaml(words.config) if words.config else ChainConfig()
    seeds = list(range(words.seed, words.seed + (QUICK_TRIALS if words.quick else TRIALS)))
    plates = {plate: simulate_trials(scene, seeds) for plate, scene in SCENES.items()}
    result = run_protocol(plates, config)
    if words.plot:
        from benchmarks.paper.pictures import draw_protocol

        draw_protocol(words.plot, plates, config, result)
    delays = {
        plate: {'mean_delay_ms': mean, 'sd_delay_ms': sd}
        for plate, (mean, sd) in PAPER_DELAY_MS.items()
    }
    return {
        'trials': {'seeds': seeds, 'scenes': dict(SCENES)},
        'paper': {'plates': delays, 'false_positive_percent': PAPER_FALSE_POSITIVE_PERCENT},
        **result,
    }


def as_table(result: Mapping[str, Any]) -> str:
    """Return the figures as text: the paper's beside ours."""
    plates, seeds = result['plates'], result['trials']['seeds']
    bands = {'as configured': result, **result['bands']}
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
    ]
    return '\n\n'.join(blocks)


def _delays(result: Mapping[str, Any]) -> list[list[str]]:
    """Return the delays of the single trials and the figures of all, by plate."""
    plates, paper = result['plates'], result['paper']
    columns = [*plates.values(), result['all']]
    rows = [['', *(f'{plate} um' for plate in plates), 'all']]

    def add(head: str, values: Iterable[Any], form: str = '.2f') -> None:
        rows.append([head, *(number_text(value, form) for value in values)])

    for k, seed in enumerate(result['trials']['seeds']):
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
