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

"""The figures of the grasp as text."""

from collections.abc import Mapping
from typing import Any

from slip_detector.grasp.comparison import CONTROLLER
from slip_detector.report.text_table import number_text, text_table

#: Headings of the figures that have a bound.
WANTED_FIGURES = {
    'dropped': 'objects dropped',
    'mean_slide_mm': 'mean slide [mm]',
    'worst_slide_mm': 'worst slide [mm]',
    'force_percent': 'mean grip [% of the limit]',
}


def grasp_table(result: Mapping[str, Any]) -> str:
    """Return the figures as text: conditions, wanted figures, and the trials with the nodes.

    Parameters
    ----------
    result
        The content of ``grasp.json``; see :mod:`slip_detector.nodes.grasp_demo`.

    Examples
    --------
    >>> figures = {'dropped': 0, 'trials': 1, 'mean_slide_mm': 0.2, 'worst_slide_mm': 0.2}
    >>> figures |= {'force_percent': 40.0, 'most_force_percent': 44.0, 'onsets': 2.0}
    >>> figures['needed_percent'] = 30.0
    >>> result = {'seeds': [0], 'transport_ms': 5.0, 'conditions': {CONTROLLER: figures}}
    >>> result['harder'] = {}
    >>> grasp_table({**result, 'wanted': {}, 'nodes': {}}).splitlines()[1]
    'In simulated time, 5 ms from sample to command'
    """
    seeds, parts = result['seeds'], result['conditions']
    rows = [['', '', 'slide [mm]', '', 'grip [% of limit]', '', ''],
            ['', 'dropped', 'mean', 'worst', 'mean', 'most', 'onsets']]  # fmt: skip
    for name, part in {**parts, **result['harder']}.items():
        figures = [
            number_text(part[key], form)
            for key, form in (
                ('mean_slide_mm', '.2f'),
                ('worst_slide_mm', '.2f'),
                ('force_percent', '.1f'),
                ('most_force_percent', '.1f'),
                ('onsets', '.1f'),
            )
        ]
        rows.append([name, f'{part["dropped"]} of {part["trials"]}', *figures])
    needed = parts[CONTROLLER]['needed_percent']
    lines = [
        f'{len(seeds)} objects (seeds {seeds[0]} to {seeds[-1]}): gripped, lifted and filled '
        'until they are two to three times as heavy',
        f'In simulated time, {result["transport_ms"]:g} ms from sample to command',
        '',
        text_table(rows),
        '',
        f'The smallest grip that would hold the objects: {needed:.1f} % of the limit.',
        '',
        'Wanted of the controller',
        '',
        text_table(
            [
                [
                    condition,
                    WANTED_FIGURES[name],
                    number_text(entry['value'], '.2f'),
                    f'wanted {entry["bound"]}',
                    'met' if entry['met'] else 'NOT met',
                ]
                for condition, entries in result['wanted'].items()
                for name, entry in entries.items()
            ],
            '<<><',
        ),
    ]
    if result['nodes']:
        lines += ['', *_through_nodes(result)]
    return '\n'.join(lines)


def _through_nodes(result: Mapping[str, Any]) -> list[str]:
    rows = [['', 'slide [mm]', '', 'command [% of limit]', ''],
            ['seed', 'nodes', 'simulated', 'nodes', 'simulated']]  # fmt: skip
    for seed, part in result['nodes'].items():
        both = (part, part['simulated'])
        slides = (number_text(one['slide_mm'], '.2f') for one in both)
        commands = (number_text(one['command_percent'], '.1f') for one in both)
        rows.append([seed, *slides, *commands])
    latency = result['latency_ms']
    says = 'undefined, no onset was answered'
    if latency:
        says = f'median {latency["median"]:.1f} ms, most {latency["most"]:.1f} ms'
    return [
        'Through driver, detector and controller in real time, beside the same in simulated time',
        '',
        text_table(rows),
        '',
        f'From sample to command: {says}',
    ]
