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

"""The fastest method for an error."""

import math

import pytest

from benchmarks.scenes.front import front_ratio


def run_at(method, error, run_time, said=''):
    return {
        'method': method, 'voltage_error': error, 'run_time_per_s': run_time, 'said': said,
    }  # fmt: skip


LIVE = [run_at('live', 1e-2, 1.0), run_at('live', 1e-4, 10.0)]


def test_ahead_of_all_is_below_one():
    verdict = front_ratio([*LIVE, run_at('BDF', 1e-2, 2.0), run_at('BDF', 1e-4, 20.0)])
    assert verdict['ratio'] == pytest.approx(0.5)


def test_one_faster_rival_is_found():
    verdict = front_ratio([*LIVE, run_at('BDF', 1e-2, 2.0), run_at('LSODA', 1e-3, 1.0)])
    assert verdict['ratio'] == pytest.approx(math.sqrt(10.0))
    assert verdict['against'] == 'LSODA at 1.0e-03'


def test_a_rival_s_line_counts_where_it_crosses_the_bound():
    verdict = front_ratio([*LIVE, run_at('BDF', 1e-2, 5.0), run_at('BDF', 1e-6, 5.5)])
    assert verdict['against'] == 'BDF at 1.0e-03'


def test_rivals_below_the_bound_and_those_that_gave_up_do_not_count():
    rivals = [run_at('BDF', 1e-6, 100.0), run_at('RK45', None, None, 'RK45: given up')]
    assert front_ratio([*LIVE, *rivals])['ratio'] < 0.1


def test_a_rival_that_the_live_stepper_cannot_match_is_infinitely_ahead():
    assert front_ratio([run_at('live', 1e-1, 1.0), run_at('BDF', 1e-3, 9.0)])['ratio'] == math.inf
