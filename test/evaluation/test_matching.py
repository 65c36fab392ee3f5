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

"""Intervals over any cut, and the matching of slips to alarms."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

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


# Matching.


@st.composite
def scenes_of_events(draw):
    edges = draw(st.lists(st.integers(0, 120), unique=True, max_size=12).map(sorted))
    slips = [RowInterval(*pair) for pair in zip(edges[::2], edges[1::2], strict=False)]
    rises = draw(st.lists(st.integers(0, 150), unique=True, max_size=12).map(sorted))
    return slips, rises, draw(st.integers(0, 15)), draw(st.integers(0, 15))


def match(slips, rises, early, tail):
    """Match in a recording at 100 Hz that was settled long before its row 0."""
    config = EvaluationConfig(early_s=early / 100.0, tail_s=tail / 100.0, off_before_s=0.0)
    return ScoredRows(slips, [RowInterval(-99, 999)], 0, config, 100.0).match(rises)


def belongs(slips, i, rise, early, tail):
    """Whether an alarm can belong to a slip, as the docstring of ScoredRows says it."""
    start, end = slips[i]
    in_previous = i > 0 and rise < slips[i - 1].end
    in_next = i + 1 < len(slips) and rise >= slips[i + 1].start
    return start - early <= rise < end + tail and not in_previous and not in_next


@given(scenes_of_events())
def test_the_matching_is_one_to_one_and_none_has_more_pairs(drawn):
    slips, rises, early, tail = drawn
    alarm_of, slip_of = match(slips, rises, early, tail)
    assert (len(alarm_of), len(slip_of)) == (len(slips), len(rises))
    matched = [alarm for alarm in alarm_of if alarm is not None]
    assert len(set(matched)) == len(matched)
    able = np.array(
        [[belongs(slips, i, rise, early, tail) for rise in rises] for i in range(len(slips))], bool
    ).reshape(len(slips), len(rises))
    for i, alarm in enumerate(alarm_of):
        assert alarm is None or (able[i, alarm] and slip_of[alarm] == i)
    for alarm, i in enumerate(slip_of):
        assert (i is None) == (not able[:, alarm].any())
        assert i is None or able[i, alarm]
    most = able[linear_sum_assignment(able, maximize=True)].sum()
    assert len(matched) == most


@pytest.mark.parametrize(
    ('rises', 'alarm_of', 'slip_of'),
    [
        ([110, 111], [0, None], [0, 0]),  # chatter is no second detection
        ([94, 95, 149, 150], [1, 2], [None, 0, 1, None]),  # early and tail
        ([125, 126], [0, 1], [0, 1]),  # between both: the first that has no alarm
        ([99, 124, 126], [0, 2], [0, 0, 1]),
    ],
)
def test_matches_by_hand(rises, alarm_of, slip_of):
    slips = [RowInterval(100, 120), RowInterval(130, 140)]
    assert match(slips, rises, 5, 10) == (alarm_of, slip_of)


# What is scored.


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
    config = EvaluationConfig(
        early_s=draw(st.integers(0, 4), label='early') / 100.0,
        tail_s=draw(st.integers(0, 4), label='tail') / 100.0,
        off_before_s=draw(st.integers(0, 5), label='off before') / 100.0,
    )
    return stretches, truth, on, draw(st.integers(0, 12), label='settling'), config


def intervals(signal, stretches):
    """Return where a signal is True; what goes on after a gap begins once more."""
    found = OnIntervals()
    for start, end in stretches:
        found.add(signal[start:end], start)
        found.close(end)
    return found.closed()


@given(recorded())
def test_an_alarm_begins_after_the_decision_was_off_for_long_enough(drawn):
    stretches, _, on, settling, config = drawn
    rows = ScoredRows([], stretches, settling, config, 100.0)
    off_rows = round(100 * config.off_before_s)
    begun = []
    for start, end in stretches:
        last_on = -1000  # a chain that starts is OFF
        for row in range(start, end):
            rises = on[row] and (row == start or not on[row - 1])
            if rises and row - last_on > off_rows:
                begun.append(row)
            if on[row]:
                last_on = row
    alarms = rows.alarms(intervals(on, stretches))
    assert [alarm.start for alarm in alarms] == begun
    # Whatever is ON is in an alarm, which ends with an ON.
    covered = {row for start, end in alarms for row in range(start, end)}
    assert covered >= {row for start, end in stretches for row in range(start, end) if on[row]}
    assert all(on[end - 1] for _, end in alarms)
