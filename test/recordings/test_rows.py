"""Rows: what is taken apart and put together again is the same."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings import RecordedRows


def some(n, truth):
    rng = np.random.default_rng(n)
    slip = rng.random(n) < 0.5
    return RecordedRows(rng.normal(size=(n, 2)), np.arange(n) * 10, slip if truth else None)


@given(st.integers(0, 30), st.integers(0, 30), st.booleans())
def test_parts_of_rows_joined_are_the_rows(n, cut, truth):
    rows = some(n, truth)
    again = rows.take(slice(cut)).then(rows.take(slice(cut, None)))
    for field, of_again in zip(rows, again, strict=True):
        np.testing.assert_array_equal(field, of_again)


@given(st.lists(st.integers(0, 9), max_size=20))
def test_rows_are_taken_by_their_numbers(which):
    rows = some(10, truth=True)
    taken = rows.take(np.array(which, dtype=np.intp))
    np.testing.assert_array_equal(taken.volts, rows.volts[which])
    np.testing.assert_array_equal(taken.stamps_ns, rows.stamps_ns[which])
    np.testing.assert_array_equal(taken.truth, rows.truth[which])


def test_a_truth_that_one_part_lacks_is_not_known_of_both():
    assert some(3, truth=True).then(some(2, truth=False)).truth is None
    assert some(3, truth=False).then(some(2, truth=True)).truth is None
