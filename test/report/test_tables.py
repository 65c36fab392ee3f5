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

"""Tables of text, and the texts of figures."""

from slip_detector.grasp.loop import UNCONTROLLED, grasp_figures
from slip_detector.report.pictures import grasp_table
from slip_detector.report.texts import (
    COMPARABLE,
    LEGEND,
    TABLES,
    compared,
    evaluation_tables,
)
from support import grasp_trials


def evaluated(value, **figures):
    names = [name for figures in TABLES.values() for name in figures]
    return {**dict.fromkeys(names, value), 'labelled': True, **figures}


def test_only_what_says_something_is_in_the_tables():
    slips = evaluated(None, slips=2, missed=0, recall=1.0, rest_s=30.0, onsets=2)
    rest = evaluated(None, slips=0, missed=0, rest_s=60.0, false_time_percent=0.0)
    sets = {'a': {**slips, 'recordings': {'1.npz': slips}}, 'b': {'recordings': {'2.npz': rest}}}
    report = {'answer': ['Good.'], 'sets': sets, 'all': slips}
    sets['b'] |= rest
    assert [line.split() for line in evaluation_tables(report).splitlines() if line] == [
        ['Good.'],
        ['slips', 'slips', 'share', 'found'],
        *([*name.split(), '2', '1.000'] for name in ('a/1.npz', 'all of a', 'all recordings')),
        ['rest', '[s]', 'ON', 'without', 'slip', '[%]'],
        ['a/1.npz', '30.0', '-'],
        ['b/2.npz', '60.0', '0.00'],
        *(f'{of} {s}'.split() for of, s in (('all of a', '30.0 -'), ('all of b', '60.0 0.00'))),
        ['all', 'recordings', '30.0', '-'],
        LEGEND.split(),
    ]
    assert '\ndecisions ' in evaluation_tables(report, verbose=True)


def test_without_labels_it_says_when_it_is_on_and_how_to_label():
    one = evaluated(None, labelled=False, on_intervals_s=[[0.5, 1.25]])
    two = {**one, 'on_intervals_s': []}
    whole = {**one, 'recordings': {'a': one, 'b': two}}
    report = {'answer': [], 'sets': {'x': whole}, 'all': whole, 'note': 'how to label'}
    lines = ['a: ON from 0.500 to 1.250 s', 'b: never ON', 'how to label']
    assert evaluation_tables(report).splitlines() == lines


def test_two_sets_of_figures_are_beside_each_other_and_better_or_worse_as_a_search_decides():
    known = dict.fromkeys(COMPARABLE, 1.0) | {'latency_accuracy_ms': 0.0}
    before = {**known, 'recall': 0.5, 'press_on_percent': 30.0, 'coverage': 0.996}
    after = {**known, 'recall': 0.75, 'press_on_percent': None, 'latency_worst_ms': -120.0}
    assert compared(before, after) == [
        ('share found', '0.500', '0.750', 'better'),
        # A search takes these for equal.
        ('ON during slips', '0.996', '1.000', ''),
        ('latency worst [ms]', '1.0', 'ON 120.0 before', ''),
        ('ON in presses [%]', '30.00', '-', 'worse'),
    ]


def test_the_table_of_the_grasp_has_conditions_and_the_nodes():
    parts = {name: grasp_figures(mine, 10.0) for name, mine in grasp_trials.by_condition().items()}
    simulated = {'slide_mm': 0.5, 'command_percent': 49.0}
    result = {
        'seeds': [5000],
        'conditions': parts,
        'transport_ms': 4.0,
        'nodes': {'5000': {'slide_mm': None, 'command_percent': 50.0, 'simulated': simulated}},
        'latency_ms': None,
    }
    lines = [' '.join(line.split()) for line in grasp_table(result).splitlines()]
    assert any(line.startswith(f'{UNCONTROLLED} 1 of 1 - -') for line in lines)
    assert '5000 - 0.50 50.0 49.0' in lines
    assert 'From sample to command: undefined, no onset was answered' in lines
