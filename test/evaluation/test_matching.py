"""Intervals over any cut, and the matching of slips to alarms."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from slip_detector.evaluation.matching import (
    NONE,
    OnIntervals,
    RowInterval,
    alarm_windows,
    give_alarm,
    is_false,
    match,
    slip_not_over,
    tolerance_rows,
)
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


def belongs(slips, i, rise, early, tail):
    """Whether an alarm can belong to a slip, as the docstring of match says it."""
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


@given(scenes_of_events())
def test_a_slip_has_the_first_alarm_that_rises_in_it(drawn):
    slips, rises, _, tail = drawn
    alarm_of, _ = match(slips, rises, 0, tail)
    for (start, end), alarm in zip(slips, alarm_of, strict=True):
        within = [k for k, rise in enumerate(rises) if start <= rise < end]
        if within:
            assert alarm == within[0]


@pytest.mark.parametrize(
    ('rises', 'alarm_of', 'slip_of'),
    [
        ([], [None, None], []),
        ([99], [None, None], [None]),
        ([100, 110], [0, None], [0, 0]),  # chatter is no second detection
        ([94, 95], [1, None], [None, 0]),
        ([129, 130], [0, None], [0, None]),  # the tail ends
        ([199, 200, 300], [None, 0], [1, 1, None]),
        ([50, 101, 205], [1, 2], [None, 0, 1]),
    ],
)
def test_matches_by_hand(rises, alarm_of, slip_of):
    early = 5 if 94 in rises or 199 in rises else 0
    slips = [RowInterval(100, 120), RowInterval(200, 220)]
    assert match(slips, rises, early, 10) == (alarm_of, slip_of)


def test_what_rises_between_two_slips_is_for_the_first_that_has_none():
    slips = [RowInterval(0, 10), RowInterval(12, 20)]
    assert match(slips, [11], 5, 5) == ([0, None], [0])
    assert match(slips, [3, 11], 5, 5) == ([0, 1], [0, 1])
    assert match(slips, [3, 4, 13], 5, 5) == ([0, 2], [0, 0, 1])


@given(scenes_of_events())
def test_a_window_holds_the_rows_at_which_an_alarm_can_belong_to_its_slip(drawn):
    slips, _, early, tail = drawn
    lows, highs = alarm_windows(slips, early, tail)
    for i in range(len(slips)):
        inside = [row for row in range(-20, 160) if belongs(slips, i, row, early, tail)]
        assert inside == list(range(lows[i], highs[i]))


@given(scenes_of_events())
def test_a_false_alarm_is_one_that_is_given_to_no_slip_with_or_without_alarms(drawn):
    slips, rises, early, tail = drawn
    lows, highs = alarm_windows(slips, early, tail)
    for row in rises:
        slip = slip_not_over(row, 0, highs)
        for taken in (NONE, 1000):
            alarm_of = np.full((len(slips), 1), taken)
            given_to = give_alarm(row, row, slip, lows, alarm_of, 0)
            assert is_false(row, slip, lows) == (given_to == NONE)


def test_tolerances_are_whole_rows_of_the_recording():
    assert tolerance_rows(EvaluationConfig(early_s=0.0, tail_s=0.099), 100.0) == (0, 10)
