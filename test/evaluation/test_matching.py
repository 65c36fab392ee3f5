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

"""Intervals over any cut, slips matched to alarms, and decisions no better than chance."""

import itertools

import numpy as np
import pytest
from evaluation.reference_scores import Stretch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from slip_detector.evaluation.events import recall_by_chance, saved_by_chance_s, sooner_than_chance
from slip_detector.evaluation.matching import OnIntervals, RowInterval, ScoredRows
from slip_detector.parameters.evaluation import EvaluationConfig

# Intervals.


@given(st.lists(st.lists(st.booleans(), max_size=8), max_size=6), st.integers(0, 100))
def test_any_cut_of_the_rows_gives_the_same_intervals(pieces, first_row):
    cut, row = OnIntervals(), first_row
    for piece in pieces:
        cut.add(np.array(piece, bool), row)
        row += len(piece)
    cut.close(row)
    on = np.array(list(itertools.chain(*pieces)), bool)
    rows = [first_row + int(k) for k in np.flatnonzero(on)]
    covered = [k for start, end in cut.closed() for k in range(start, end)]
    assert covered == rows
    # Neighbours are one interval, not two.
    edges = [edge for interval in cut.closed() for edge in interval]
    assert edges == sorted(set(edges))


# What is scored.

#: At 100 Hz the times of 0 to 4, and of 0 to 6 rows.
EVALUATIONS = st.builds(
    EvaluationConfig,
    early_s=st.integers(0, 4).map(lambda rows: rows / 100.0),
    tail_s=st.integers(0, 4).map(lambda rows: rows / 100.0),
    off_before_s=st.integers(0, 6).map(lambda rows: rows / 100.0),
)


@st.composite
def recorded(draw):
    """Draw stretches with labels and decisions, row by row, and what counts as detected."""
    cuts = draw(st.lists(st.integers(1, 25), min_size=1, max_size=4), label='rows of stretches')
    gaps = draw(st.lists(st.integers(0, 9), min_size=len(cuts), max_size=len(cuts)), label='gaps')
    row, stretches = 0, []
    for n, gap in zip(cuts, gaps, strict=True):
        stretches.append(RowInterval(row + gap, row + gap + n))
        row = stretches[-1].end
    signal = st.lists(st.booleans(), min_size=row, max_size=row)
    truth, on = (np.array(draw(signal, label=name), bool) for name in ('truth', 'on'))
    settling_rows = draw(st.integers(0, 12), label='settling')
    return stretches, truth, on, settling_rows, draw(EVALUATIONS, label='evaluation')


def intervals(signal, stretches):
    """Return where a signal is True; what goes on after a gap begins once more."""
    found = OnIntervals()
    for start, end in stretches:
        found.add(signal[start:end], start)
        found.close(end)
    return found.closed()


@given(recorded())
def test_alarms_slips_and_rest_are_those_of_an_independent_scorer(drawn):
    stretches, truth, on, settling, config = drawn
    parts = [Stretch(on[a:b], truth[a:b], settling, config, 100.0) for a, b in stretches]
    rows = ScoredRows(intervals(truth, stretches), stretches, settling, config, 100.0)
    alarms, alarm_of, events = rows.match_decision(intervals(on, stretches))
    rises = [round(alarm.start_s * 100.0) for alarm in alarms]
    begun = zip(stretches, parts, strict=True)
    assert rises == [start + row for (start, _), part in begun for row in part.alarms]
    assert all(on[round(alarm.end_s * 100.0) - 1] for alarm in alarms)
    assert [alarm.outcome for alarm in alarms] == [kind for part in parts for kind in part.kinds]
    starts = [start for start, _ in intervals(truth, stretches)]
    latencies = [
        (rises[alarm_of[slip]] - start) / 100.0 if slip in alarm_of else None
        for slip, start in enumerate(starts)
        if rows.scored[slip]
    ]
    assert latencies == [one for part in parts for one in part.latencies_s]
    rest_s, on_s, _ = events.rest[:, 0]
    assert rest_s == pytest.approx(sum(part.rest_s for part in parts))
    assert on_s == pytest.approx(sum(part.on_rest_s for part in parts))
    # One to one, and no other matching has more pairs.
    for part in parts:
        able = np.zeros((part.slips, len(part.alarms)), bool)
        for k, row in enumerate(part.alarms):
            able[part.of_row[row], k] = row >= part.settling_rows
        most = able[linear_sum_assignment(able, maximize=True)].sum()
        assert len(set(part.alarm_of.values())) == len(part.alarm_of) == most


# Decisions that do not depend on slip, however they are made.

RATE_HZ = 100.0


@st.composite
def rings(draw):
    """Draw decisions that repeat, and a slip within their second turn."""
    on = np.array(draw(st.lists(st.booleans(), min_size=8, max_size=40), label='on'), bool)
    n = len(on)
    edges = st.lists(st.integers(n, 2 * n), unique=True, min_size=2, max_size=2).map(sorted)
    slip = RowInterval(*draw(edges, label='slip'))
    return on, slip, draw(EVALUATIONS, label='evaluation')


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
        found, _, events = rows.match_decision(intervals(turns, [(0, 2 * n)]))
        latencies_s += events.latencies_ms[:, 0].tolist()
        alarms.add(sum(alarm.outcome != 'settling' for alarm in found))
    (in_a_turn,) = alarms
    rate_hz = in_a_turn / n * RATE_HZ
    leads_s, windows_s = np.resize(rows.leads_s, n), np.resize(rows.windows_s, n)
    latencies_s = np.array(latencies_s) / 1e3
    assert np.isfinite(latencies_s).mean() <= recall_by_chance(windows_s, rate_hz) + 1e-9
    assert sooner_than_chance(latencies_s, leads_s, windows_s, rate_hz) <= 1e-9
    late_s = np.clip(np.fmin(latencies_s, most_s), 0.0, most_s)
    saved_s = saved_by_chance_s(rows.leads_s, rows.windows_s, rate_hz, most_s)
    # Between two rows the bound of what is saved is a straight line, and the law a step.
    within_a_row = rate_hz / RATE_HZ**2
    assert late_s.mean() + saved_s >= most_s - within_a_row - 1e-12
