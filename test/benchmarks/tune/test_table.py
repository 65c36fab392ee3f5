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

from benchmarks.tune.measure import WANTED
from benchmarks.tune.table import MEANINGS, ONSET_FIGURES, tuning_table
from benchmarks.verdicts import verdicts


def test_each_claim_has_a_line_with_its_meaning_and_verdict():
    values = dict.fromkeys(WANTED) | {'read.times_real_time': 301.0, 'search.speedup': 7.0}
    lines = tuning_table({'wanted': verdicts(WANTED, values)}).splitlines()
    assert len(lines) == 1 + len(WANTED)
    verdict_of = {line[:56].rstrip(): line[56:].split() for line in lines}
    assert verdict_of[MEANINGS['read.times_real_time']] == ['301', '>=', '200', 'met']
    assert verdict_of[MEANINGS['search.speedup']] == ['7', '>=', '10', 'NOT', 'met']
    assert verdict_of[MEANINGS['families.better']] == ['-', '>=', '4', 'not', 'measured']


def test_jobs_have_a_line_for_each_format():
    one = {
        'hours_per_s': {'1': 1.5, '2': 2.75},
        'processor_s_per_hour': 0.6,
        'bytes_per_hour': 175e6,
    }
    text = tuning_table({'wanted': {}, 'jobs': {'npz': one, 'mcap': one, 'memory_mib': 250.0}})
    assert text.count('1: 1.50, 2: 2.75 (0.60 s of a core and 175 MB an hour)') == 2
    assert 'at most 250 MiB a process' in text


def test_families_and_real_recordings_have_lines_of_their_own():
    one = {
        'latency_median_all_ms': 40.0, 'latency_median_ms': None, 'false_alarms_per_minute': 1.25,
        'false_time_percent': 0.125, 'recall': 0.5, 'sooner_than_chance': 0.25,
    }  # fmt: skip
    area = {'auc_moving': 0.91, 'auc_moving_by_threshold': 0.85}
    scored = {
        'auc_moving': 0.93, 'matched': 3, 'slips': 4, 'settling_slips': 1, 'false_alarms': 2,
        'false_time_percent': None,
    }  # fmt: skip
    choice = {**scored, 'settings': 180, 'median_auc_moving': 0.89, 'given': scored}
    text = tuning_table(
        {
            'wanted': {},
            'families': {'by_name': {'plates': {'given': one, 'tuned': one, 'kept': 'no better'}}},
            'real': {'recordings': 3, 'given': area, 'seeds': {'0': area}, 'choice': choice},
        }
    )
    assert 'plates' in text
    assert '40.0, -, 1.2, 0.12, 0.50, 0.25 -> 40.0, -, 1.2, 0.12, 0.50, 0.25 (no better)' in text
    assert text.count('AUC against motion 0.910 (by thresholds 0.850)') == 2
    assert 'of 180 settings beside the given one half have an AUC below 0.890' in text
    assert text.count('0.930, 3 of 4 slips detected (1 while settling), 2 false alarms') == 2


def test_the_presets_stand_beside_the_papers_parameters():
    plate = {'mean_delay_ms': 12.5, 'worst_delay_ms': None, 'mean_channel_delay_ms': 15.0}
    one = {**dict.fromkeys(ONSET_FIGURES, 0.5), 'plates': {'400': plate}}
    sure = {**one, 'taps_percent': None}
    result = {'wanted': {}, 'onset': {**one, 'seeds': [3, 4, 5], 'sure': sure, 'paper': one}}
    lines = [line.split() for line in tuning_table(result).splitlines()]
    heading = [
        'Simulated',
        'scenes,',
        'seeds',
        '3',
        'to',
        '5',
        'onset.yaml',
        'sure.yaml',
        "paper's",
    ]
    assert heading in lines
    assert ['ON', 'in', 'taps', '[%]', '0.500', '-', '0.500'] in lines
    assert ['400', 'um:', 'delay,', 'mean', '[ms]', '12.5', '12.5', '12.5'] in lines
    assert ['400', 'um:', 'delay,', 'worst', '[ms]', '-', '-', '-'] in lines
