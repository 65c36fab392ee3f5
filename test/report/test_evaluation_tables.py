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

"""The figures of an evaluation as tables of text."""

from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.evaluation_tables import TABLE_SECTIONS, evaluation_tables


def test_what_was_lost_of_a_recording_is_said():
    figures = figures_of_merit([Replay(ChainConfig()).run([])])
    counts = dict.fromkeys(['bad_samples', 'gaps', 'bridged_rows', 'long_gaps', 'dropped'], 0)
    whole = {**figures, **counts}
    recordings = {
        'a.mcap': {**whole, 'lost': 'is cut off at byte 9', 'doubts': ''},
        'b.mcap': {**whole, 'lost': '', 'doubts': ''},
        'c.mcap': {**whole, 'lost': '', 'doubts': 'has no checksums'},
    }
    report = {'sets': {'x': {**whole, 'recordings': recordings}}, 'all': whole}
    lines = evaluation_tables(report).splitlines()
    assert 'a.mcap: is cut off at byte 9' in lines
    assert 'c.mcap: has no checksums' in lines
    assert not any(line.startswith('b.mcap:') for line in lines)


def test_a_table_without_gaps_needs_no_legend():
    names = [name for section in TABLE_SECTIONS for name in section.columns]
    whole = dict.fromkeys(names, 1)
    report = {'sets': {'x': {**whole, 'recordings': {}}}, 'all': whole}
    assert 'not defined' not in evaluation_tables(report)
    report['sets']['x']['auc_all'] = None
    assert evaluation_tables(report).endswith('the motion is not recorded)')


def test_what_there_is_nothing_to_tell_of_is_left_out():
    names = [name for section in TABLE_SECTIONS for name in section.columns]
    whole = dict.fromkeys(names, 0)
    report = {'sets': {'x': {**whole, 'recordings': {}}}, 'all': whole}
    assert 'missed slips' not in evaluation_tables(report)
    report['sets']['x']['missed_at_vote'] = 1
    assert 'missed slips, lost at' in evaluation_tables(report)
