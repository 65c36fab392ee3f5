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

"""The figures of a search as text."""

from slip_detector.report.tuning_table import FIGURES, comparison_table


def test_given_and_tuned_stand_beside_each_other_and_what_is_not_defined_is_a_dash():
    given = {**dict.fromkeys(FIGURES, 1), 'recall': 0.5, 'latency_median_ms': None}
    lines = comparison_table(given, {**given, 'recall': 0.75}).splitlines()
    assert lines[0].split() == ['given', 'tuned']
    assert '  recall' in lines[2]
    assert lines[2].split() == ['recall', '0.500', '0.750']
    assert [line.split()[-2:] for line in lines if 'of those detected' in line] == [['-', '-']]
    assert len(lines) == 1 + len(FIGURES)


def test_the_area_over_rows_of_motion_is_left_out_where_nobody_says_what_moves():
    figures = dict.fromkeys(FIGURES, 1)
    assert 'rows of motion' in comparison_table(figures, figures)
    assert 'rows of motion' not in comparison_table({**figures, 'auc_moving': None}, figures)


def test_a_latency_below_zero_says_that_slip_was_on_before():
    figures = {**dict.fromkeys(FIGURES, 1), 'latency_worst_ms': -120.0, 'recall': -1}
    lines = comparison_table(figures, {**figures, 'latency_worst_ms': 0.0}).splitlines()
    (worst,) = [line for line in lines if 'worst' in line]
    assert worst.split('  ')[-3:] == ['ON 120.0 before', '', ' 0.0']
    assert [line.split()[-1] for line in lines if line.startswith('  recall')] == ['-1.000']
