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

"""The figures of the tuner as text."""

from typing import Any

from benchmarks.verdicts import verdict_in_words
from slip_detector.report.text_table import number_text, text_table

MEANINGS = {
    'evaluate.ratio': 'evaluating an hour from npz, against copy and threshold',
    'read.times_real_time': 'reading an hour of MCAP, times real time',
    'search.speedup': 'a search, times faster than around SciPy and NumPy',
    'report.bytes': 'report of an hour, bytes',
    'report.ready_ms': 'report of an hour, until it is drawn [ms]',
    'families.better': 'families better in latency, time ON and recall',
    'sensor.total_s': 'a new sensor, until its configuration is there [s]',
    'onset.mean_delay_ms': 'onset.yaml, mean delay on the plates [ms]',
    'onset.detected_percent': 'onset.yaml, slides detected [%]',
    'onset.false_time_percent': 'onset.yaml, ON while a plate is at rest [% of the time]',
    'onset.taps_percent': 'onset.yaml, ON in taps [% of the time]',
    'onset.rolling_percent': 'onset.yaml, ON in rolling [% of the time]',
    'onset.fast_detected_percent': 'onset.yaml, slides at 40 and 80 mm/s detected [%]',
}

ONSET_FIGURES = {
    'mean_delay_ms': 'delay of slip, mean over the plates [ms]',
    'mean_channel_delay_ms': 'the same, mean over the channels (Eq. 10) [ms]',
    'detected_percent': 'slides detected [%]',
    'false_time_percent': 'ON at rest [%]',
    'false_positive_percent': 'ON without slip, with what is left of a slip [%]',
    'taps_percent': 'ON in taps [%]',
    'rolling_percent': 'ON in rolling [%]',
    'tremor_hum_percent': 'ON with tremor and hum [%]',
    'fast_detected_percent': 'slides at 40 and 80 mm/s detected [%]',
}
PLATE_FIGURES = {
    'mean_delay_ms': 'delay, mean [ms]',
    'worst_delay_ms': 'delay, worst [ms]',
    'mean_channel_delay_ms': 'delay over the channels (Eq. 10) [ms]',
}


def tuning_table(figures_by_part: dict[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.tune.measure.measure_tuning` as text."""
    claims = [('What', 'measured', 'wanted', '')]
    for claim, entry in figures_by_part['wanted'].items():
        value = number_text(entry['value'], '.4g')
        claims.append((MEANINGS[claim], value, entry['bound'], verdict_in_words(entry)))
    lines = [text_table(claims, '<>><', indent=0)]
    if 'jobs' in figures_by_part:
        jobs = figures_by_part['jobs']
        lines += ['', 'Hours of recording evaluated in a second, by number of jobs:']
        for ending in ('npz', 'mcap'):
            one = jobs[ending]
            speeds = ', '.join(f'{k}: {speed:.2f}' for k, speed in one['hours_per_s'].items())
            lines.append(
                f'  {ending:<5} {speeds} ({one["processor_s_per_hour"]:.2f} s of a core and '
                f'{one["bytes_per_hour"] / 1e6:.0f} MB an hour)'
            )
        lines.append(f'  at most {jobs["memory_mib"]:.0f} MiB a process')
    if 'families' in figures_by_part:
        lines += [
            '',
            'Held-out seeds, given -> tuned: latency of all and of those detected [ms], '
            'false alarms a minute, time ON without slip [%], recall, sooner than chance',
        ]
        for name, one in figures_by_part['families']['by_name'].items():
            both = ' -> '.join(_in_short(one[which]) for which in ('given', 'tuned'))
            lines.append(f'  {name:<32} {both}' + (f' ({one["kept"]})' if one['kept'] else ''))
    if 'sensor' in figures_by_part:
        sensor = figures_by_part['sensor']
        told = 'told' if sensor['taps_told'] else 'NOT told'
        lines += [
            '',
            f'A new sensor, {sensor["recording_s"] / 60.0:.3g} min of recordings: '
            f'{sensor["quiet_s"]:.1f} s for --quiet, {sensor["taps_s"]:.1f} s for --taps (knocks '
            f'{told} from slips), {sensor["search_s"]:.1f} s for the search',
            f'  {_in_short(sensor["given"])} -> {_in_short(sensor["tuned"])}',
        ]
    if 'onset' in figures_by_part:
        lines += ['', *_onset_lines(figures_by_part['onset'])]
    return '\n'.join(lines)


def _onset_lines(onset: dict[str, Any]) -> list[str]:
    """Return the figures of the configurations side by side."""
    seeds, columns = onset['seeds'], (onset, onset['sure'], onset['paper'])
    rows = [
        (
            f'Simulated scenes, seeds {seeds[0]} to {seeds[-1]}',
            'onset.yaml',
            'sure.yaml',
            "paper's",
        ),
        *(
            (meaning, *(number_text(one[name], '.3f') for one in columns))
            for name, meaning in ONSET_FIGURES.items()
        ),
    ]
    for plate in onset['plates']:
        rows += [
            (
                f'{plate} um: {meaning}',
                *(number_text(one['plates'][plate][name], '.1f') for one in columns),
            )
            for name, meaning in PLATE_FIGURES.items()
        ]
    return text_table(rows, indent=0).splitlines()


def _in_short(figures: dict[str, Any]) -> str:
    forms = {
        'latency_median_all_ms': '.1f',
        'latency_median_ms': '.1f',
        'false_alarms_per_minute': '.1f',
        'false_time_percent': '.2f',
        'recall': '.2f',
        'sooner_than_chance': '.2f',
    }
    return ', '.join(number_text(figures[name], form) for name, form in forms.items())
