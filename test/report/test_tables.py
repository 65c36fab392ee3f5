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
from slip_detector.report.grasp import grasp_table
from slip_detector.report.tables import (
    MAIN_FIGURES,
    TABLES,
    compared,
    evaluation_tables,
    heading,
)
from support import grasp_trials


def evaluated(value, **figures):
    names = [name for figures in TABLES.values() for name in figures]
    defaults = {'lost': '', 'doubts': '', 'warnings': [], 'invalid_percent': {}, 'labelled': True}
    return {**dict.fromkeys(names, value), **defaults, **figures}


def test_damage_of_a_recording_and_figures_that_are_not_defined_are_explained():
    recordings = {
        'a.mcap': evaluated(1, lost='is cut off at byte 9'),
        'b.mcap': evaluated(1),
        'c.mcap': evaluated(1, doubts='without checksums'),
    }
    whole = {**evaluated(1), 'recordings': recordings}
    report = {'sets': {'x': whole}, 'all': whole}
    lines = evaluation_tables(report).splitlines()
    assert lines[-2:] == ['a.mcap: is cut off at byte 9', 'c.mcap: without checksums']
    whole['auc_all'] = None
    assert evaluation_tables(report).endswith('or no record of motion)')


def test_tables_of_missed_slips_and_faults_are_left_out_where_there_are_none():
    report = {'sets': {'x': {**evaluated(0), 'recordings': {}}}, 'all': evaluated(0)}
    text = evaluation_tables(report)
    assert 'missed slips' not in text
    assert text.endswith('x: no bad samples, no gaps, no rows dropped')
    report['sets']['x']['missed_at_vote'] = 1
    assert 'missed slips, lost at' in evaluation_tables(report)


def test_without_labels_there_are_decisions_and_how_to_label_but_no_scores():
    decided = dict.fromkeys(('rows', *TABLES['decisions'], *TABLES['faults']), 1)
    a = {'labelled': False, 'on_intervals_s': [[0.5, 1.25]], 'invalid_percent': {'ch3': 12.5}}
    a = evaluated(None, **decided, **a)
    b = {**a, 'on_intervals_s': [], 'invalid_percent': {}}
    whole = {**a, 'recordings': {'a': a, 'b': b}}
    text = evaluation_tables({'sets': {'x': whole}, 'all': whole, 'note': 'how to label'})
    blocks = [block.split()[0] for block in text.split('\n\n')]
    assert blocks == ['x', 'decisions', 'faults', 'a:']
    assert text.splitlines()[-4:] == [
        'a: not valid: ch3 12.5 % of the time', 'a: ON from 0.500 to 1.250 s', 'b: never ON',
        'how to label',
    ]  # fmt: skip


def test_kinds_are_shown_where_they_were_recorded():
    kinds = dict.fromkeys(TABLES['kinds']) | {'auc_press': 0.75, 'press_on_percent': 0.0}
    one = {**evaluated(0), **kinds}
    report = {'sets': {'x': {**one, 'recordings': {'a': one}}}}
    lines = evaluation_tables({**report, 'all': one}).splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith('kinds'))
    assert ' '.join(lines[at].split()) == 'kinds AUC press press ON [%]'
    assert lines[at + 1].split() == ['a', '0.750', '0.00']


def test_two_sets_of_figures_are_beside_each_other():
    known = dict.fromkeys(MAIN_FIGURES, 1) | {'latency_median_ms': None}
    before = {**known, 'recall': 0.5, 'press_on_percent': 30.0}
    after = {**known, 'recall': 0.75, 'press_on_percent': None, 'latency_worst_ms': -120.0}
    rows = compared(before, after)
    assert ('recall', '0.500', '0.750', 'better') in rows
    assert ('press ON [%]', '30.00', '-', '') in rows
    # Slip was ON before its label.
    assert ('latency worst [ms]', '1', 'ON 120.0 before', '') in rows
    # What is undefined for both is left out.
    assert len(rows) == len(MAIN_FIGURES) - 1


def changes_between(before, after):
    """Return by heading what is said of a change of figures."""
    return {row[0]: row[3] for row in compared(before, after)}


def test_of_what_finds_no_slip_or_was_on_before_nothing_is_better():
    before = {**dict.fromkeys(MAIN_FIGURES, 1.0), 'latency_p90_ms': 90.0}
    never = {**dict.fromkeys(MAIN_FIGURES, 0.0), 'latency_p90_ms': None}
    assert {*changes_between(before, never).values()} == {'worse', ''}
    fewer = {**before, 'recall': 0.5, 'latency_p90_ms': 50.0}
    assert changes_between(before, fewer)[heading('latency_p90_ms')] == ''
    early = {**before, 'latency_median_ms': -96.3, 'latency_p90_ms': 80.0}
    changes = changes_between(early, before)
    assert changes[heading('latency_median_ms')] == ''
    assert changes[heading('latency_p90_ms')] == 'worse'


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
