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

"""Decisions that do not depend on slip are no better than chance, however they are made."""

import numpy as np
from evaluation.test_matching import intervals
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.evaluation.events import recall_by_chance, saved_by_chance_s, sooner_than_chance
from slip_detector.evaluation.matching import NONE, RowInterval, ScoredRows
from slip_detector.parameters.evaluation import EvaluationConfig

RATE_HZ = 100.0


@st.composite
def rings(draw):
    """Draw decisions that repeat, and a slip within their second turn."""
    on = np.array(draw(st.lists(st.booleans(), min_size=8, max_size=40), label='on'), bool)
    n = len(on)
    edges = st.lists(st.integers(n, 2 * n), unique=True, min_size=2, max_size=2).map(sorted)
    slip = RowInterval(*draw(edges, label='slip'))
    config = EvaluationConfig(
        early_s=draw(st.integers(0, 3)) / RATE_HZ,
        tail_s=draw(st.integers(0, 3)) / RATE_HZ,
        off_before_s=draw(st.integers(0, 6)) / RATE_HZ,
    )
    return on, slip, config


@settings(max_examples=20)
@given(rings(), st.floats(0.0, 0.5))
def test_alarms_shifted_to_every_time_are_on_average_no_better_than_chance(drawn, most_s):
    on, slip, config = drawn
    n = len(on)
    latencies_s, alarms = [], set()
    for shift in range(n):
        # In the first turn the chain settles; in the second each alarm of a turn begins once.
        turns = np.tile(np.roll(on, shift), 2)
        rows = ScoredRows([slip], [RowInterval(0, 2 * n)], n, config, RATE_HZ)
        rises = [alarm.start for alarm in rows.alarms(intervals(turns, [(0, 2 * n)]))]
        ((alarm,), _) = rows.match(rises)
        latencies_s.append(np.nan if alarm == NONE else (rises[alarm] - slip.start) / RATE_HZ)
        alarms.add(int((~rows.settling(rises)).sum()))
    (in_a_turn,) = alarms
    rate_hz = in_a_turn / n * RATE_HZ
    leads_s, windows_s = np.resize(rows.leads_s, n), np.resize(rows.windows_s, n)
    found = np.isfinite(latencies_s).mean()
    assert found <= recall_by_chance(windows_s, rate_hz) + 1e-9
    assert sooner_than_chance(latencies_s, leads_s, windows_s, rate_hz) <= 1e-9
    late_s = np.clip(np.fmin(latencies_s, most_s), 0.0, most_s)
    saved_s = saved_by_chance_s(rows.leads_s, rows.windows_s, rate_hz, most_s)
    # Between two rows the bound of what is saved is a straight line, and the law a step.
    within_a_row = rate_hz / RATE_HZ**2
    assert late_s.mean() + saved_s >= most_s - within_a_row - 1e-12
