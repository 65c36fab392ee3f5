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

"""The figures of the paper's protocol as text."""

from collections.abc import Mapping
from typing import Any

from slip_detector.evaluation.protocol import SCENES, band_name
from slip_detector.report.text_table import number_text, text_table

#: Headings of the wanted figures.
MEANINGS = {
    'detected_percent': 'trials detected [%]',
    **{
        f'mean_delay_ms.{plate}': f'mean delay, {plate} um, within the sd of the paper [ms]'
        for plate in SCENES
    },
    'least_rise_ms': 'least rise of the mean delay from plate to plate [ms]',
    'worst_false_positive_percent': 'false positives, worst plate [% of the time without slip]',
    'windows.20.false_positive_percent_more': 'false positives, windows of 20 ms less 40 ms [%]',
    'windows.30.false_positive_percent_more': 'false positives, windows of 30 ms less 40 ms [%]',
    'bands.10-100.least_shortening_ms': 'delay saved by [10, 100] Hz, least of the plates [ms]',
    'bands.10-150.least_shortening_ms': 'delay saved by [10, 150] Hz, least of the plates [ms]',
}


def protocol_table(result: Mapping[str, Any]) -> str:
    """Return the figures as text: the paper's beside ours, and at the end the wanted ones.

    Parameters
    ----------
    result
        As :func:`slip_detector.evaluation.protocol.run_protocol` returns it.
    """
    plates, seeds = result['plates'], result['seeds']
    blocks = [
        f"The paper's protocol: {len(plates)} plates, {len(seeds)} trials on each, "
        f'seeds {seeds[0]} to {seeds[-1]}\n'
        'Delay [ms] from the start of the plate to the first ON, mean over the channels (Eq. 10)',
        text_table(_delays(result)),
        "False positives: share of the time at which the plate stands. The paper's delays of the "
        'single trials are not known.',
        'Mean delay [ms] by the length of both windows (as Fig. 4)',
        text_table(
            _variants(result, {f'{name} ms': part for name, part in result['windows'].items()})
        ),
        'Mean delay [ms] by band (as Fig. 7)',
        text_table(
            _variants(
                result,
                {
                    'as configured': result,
                    **{band_name(name): part for name, part in result['bands'].items()},
                },
            )
        ),
        'Wanted',
        text_table(
            [
                [
                    MEANINGS[name],
                    number_text(entry['value'], '.2f'),
                    f'wanted {entry["bound"]}',
                    'met' if entry['met'] else 'NOT met',
                ]
                for name, entry in result['wanted'].items()
            ]
        ),
    ]
    if result['plots']:
        blocks.append(f'Written: {", ".join(result["plots"])}')
    return '\n\n'.join(blocks)


def _delays(result: Mapping[str, Any]) -> list[list[str]]:
    """Return the delays of the single trials and the figures of all, by plate."""
    plates, paper = result['plates'], result['paper']
    columns = [*plates.values(), result['all']]

    def row(head: str, key: str, form: str = '.2f') -> list[str]:
        return [head, *(number_text(column[key], form) for column in columns)]

    def paper_row(head: str, key: str) -> list[str]:
        return [head, *(number_text(paper['plates'][plate][key], '.2f') for plate in plates), '']

    trials = [
        [
            f'seed {seed}',
            *(number_text(one['trial_delays_ms'][k], '.2f') for one in plates.values()),
            '',
        ]
        for k, seed in enumerate(result['seeds'])
    ]
    paper_false_percent = number_text(paper['false_positive_percent'], '.2f')
    return [
        ['', *(f'{plate} um' for plate in plates), 'all'],
        *trials,
        row('mean', 'mean_delay_ms'),
        paper_row('mean, paper', 'mean_delay_ms'),
        row('sd', 'sd_delay_ms'),
        paper_row('sd, paper', 'sd_delay_ms'),
        ['detected', *map(_detected, columns)],
        row('success [%]', 'success_percent', '.1f'),
        row('false positives [%]', 'false_positive_percent'),
        ['false positives, paper [%]', *([''] * len(plates)), paper_false_percent],
        row('channels without ON', 'channels_without_on', 'd'),
    ]


def _variants(
    result: Mapping[str, Any], variants: Mapping[str, Mapping[str, Any]]
) -> list[list[str]]:
    """Return the mean delays and false positives of variants of the chain, by their names."""
    heads = ['', *(f'{plate} um' for plate in result['plates']), 'detected', 'false positives [%]']
    return [
        heads,
        *(
            [
                name,
                *(number_text(one['mean_delay_ms'], '.2f') for one in part['plates'].values()),
                _detected(part['all']),
                number_text(part['all']['false_positive_percent'], '.2f'),
            ]
            for name, part in variants.items()
        ),
    ]


def _detected(part: Mapping[str, Any]) -> str:
    return f'{part["detected"]} of {part["trials"]}'
