"""Stamps of incoming samples: what is next, what is missing, what runs backwards."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slip_detector.timeline import BACKWARDS, NEW_STRETCH, NEXT, Timeline

PERIOD_NS = 2_500_000  # 400 Hz
PERIOD_S = 0.0025
MAX_GAP_S = 0.1
MAX_GAP_SAMPLES = 40
START_NS = 1_750_000_000 * 10**9  # A stamp of today: floats no longer tell nanoseconds apart.


def arrivals(samples, jitter_ns=None, max_gap_s=MAX_GAP_S):
    """Let samples arrive by their numbers."""
    timeline = Timeline(PERIOD_S, max_gap_s)
    jitter_ns = jitter_ns or [0] * len(samples)
    return [
        timeline.arrive(START_NS + k * PERIOD_NS + j)
        for k, j in zip(samples, jitter_ns, strict=True)
    ]


@given(
    st.lists(st.integers(-PERIOD_NS // 5, PERIOD_NS // 5), min_size=1, max_size=50),
    st.sampled_from([0.0, MAX_GAP_S]),
)
def test_jitter_of_the_stamps_is_no_gap(jitter_ns, max_gap_s):
    judged = arrivals(range(len(jitter_ns)), jitter_ns, max_gap_s)
    assert judged == [NEXT] * len(jitter_ns)


@given(st.lists(st.integers(1, MAX_GAP_SAMPLES), max_size=30))
def test_bridged_gaps_make_up_for_every_missing_sample(steps):
    samples = [sum(steps[:i]) for i in range(len(steps) + 1)]
    judged = arrivals(samples)
    assert all(a.accepted and not a.reset for a in judged)
    assert [a.missing for a in judged[1:]] == [step - 1 for step in steps]


@given(
    st.integers(2, MAX_GAP_SAMPLES),
    st.integers(-PERIOD_NS // 5, PERIOD_NS // 5),
    st.integers(-PERIOD_NS // 5, PERIOD_NS // 5),
)
def test_jitter_does_not_change_how_many_samples_are_missing(step, first, second):
    assume(step * PERIOD_NS + second - first <= MAX_GAP_S * 1e9)
    assert arrivals([0, step], [first, second])[1].missing == step - 1


@given(st.integers(MAX_GAP_SAMPLES + 1, 10**12))
def test_a_gap_too_long_to_bridge_begins_a_new_stretch(step):
    judged = arrivals([0, step, step + 1, step + 3])
    assert judged == [NEXT, NEW_STRETCH, NEXT, (True, 1, False)]


def test_without_bridging_every_gap_begins_a_new_stretch():
    assert arrivals([0, 1, 3, 4], max_gap_s=0.0) == [NEXT, NEXT, NEW_STRETCH, NEXT]


@given(st.integers(0, 10**12))
def test_a_stamp_that_is_not_after_the_last_one_is_dropped_and_forgotten(back):
    assert arrivals([10, 11, 11 - back, 12]) == [NEXT, NEXT, BACKWARDS, NEXT]


def test_repeated_stamps_are_dropped_however_many():
    assert arrivals([5] * 200 + [6]) == [NEXT] + [BACKWARDS] * 199 + [NEXT]


@given(st.integers(MAX_GAP_SAMPLES + 10, 10**12))
def test_a_clock_that_was_set_back_begins_a_new_stretch_after_the_longest_gap(back):
    before = [100, 101]
    after = [101 - back + k for k in range(MAX_GAP_SAMPLES + 6)]
    judged = arrivals(before + after)
    # The dropped ones must have run forward for longer than the longest gap.
    assert judged[2 : 3 + MAX_GAP_SAMPLES] == [BACKWARDS] * (MAX_GAP_SAMPLES + 1)
    assert judged[3 + MAX_GAP_SAMPLES :] == [NEW_STRETCH, NEXT, NEXT, NEXT, NEXT]


def test_a_clock_that_was_set_back_twice_is_followed_from_the_second_time_on():
    judged = arrivals([1000, *range(500, 530), *range(100, 142)])
    assert judged[:-1] == [NEXT] + [BACKWARDS] * (30 + MAX_GAP_SAMPLES + 1)
    assert judged[-1] == NEW_STRETCH


def test_late_samples_among_good_ones_never_begin_a_new_stretch():
    # A second source, an hour behind, runs forward all the time; the first is not disturbed.
    hour = 3600 * 400
    samples = [n for k in range(hour, hour + 200) for n in (k, k - hour)]
    judged = arrivals(samples)
    assert judged[0::2] == [NEXT] * 200
    assert judged[1::2] == [BACKWARDS] * 200


@given(st.lists(st.integers(-200, 400), max_size=80))
def test_accepted_stamps_rise_within_a_stretch_and_only_there_rows_are_bridged(samples):
    last = None
    for sample, arrival in zip(samples, arrivals(samples), strict=True):
        if not arrival.accepted:
            assert sample <= last
            assert arrival == BACKWARDS
            continue
        if last is not None and not arrival.reset:
            assert last + 1 + arrival.missing == sample
        if arrival.reset:
            assert arrival.missing == 0
            assert sample - last > MAX_GAP_SAMPLES or sample <= last
        last = sample


@pytest.mark.parametrize('rate_hz', [59.7, 380.0, 2012.5])
def test_a_period_that_is_no_whole_number_of_nanoseconds_gathers_no_error(rate_hz):
    timeline = Timeline(1 / rate_hz, MAX_GAP_S)
    stamps = [START_NS + round(k * 1e9 / rate_hz) for k in range(5000)]
    assert all(timeline.arrive(stamp) == NEXT for stamp in stamps)
