"""Which received change belongs to which sample."""

import pytest

from benchmarks.soak.latency import latencies_of_changes_ns

STAMPS_NS = [0, 100, 200, 300]


STATES = [True, False, True, False]


@pytest.mark.parametrize(
    ('received', 'wanted'),
    [
        ([(5, True), (106, False), (207, True), (308, False)], [5, 6, 7, 8]),
        # A stall: all arrive, the first ones after the next ones were sent.
        ([(290, True), (291, False), (292, True), (308, False)], [290, 191, 92, 8]),
        # Lost changes go in pairs: the one back is no change to who missed the one there.
        ([(207, True), (308, False)], [None, None, 7, 8]),
        ([(5, True), (308, False)], [5, None, None, 8]),
        ([(5, True), (106, False)], [5, 6, None, None]),
        ([], [None, None, None, None]),
    ],
)
def test_each_receipt_is_matched_to_its_sample(received, wanted):
    assert latencies_of_changes_ns(STAMPS_NS, STATES, received) == wanted
