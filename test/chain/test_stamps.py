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

"""Stamps of incoming samples: what is next, what is missing, what does not fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.stamp_rules import DROPPED, NEW_STRETCH
from slip_detector.chain.stamps import StampGrid

#: In place of the number of missing samples before a sample.
NEXT = 0

PERIOD_NS = 2_500_000  # 400 Hz
PERIOD_S = 0.0025
MAX_GAP_S = 0.1
MAX_GAP_SAMPLES = 40
START_NS = 1_750_000_000 * 10**9  # A stamp of today: floats no longer tell nanoseconds apart.


def arrivals_of(stamps, max_gap_s=MAX_GAP_S):
    """Let samples arrive by their stamps."""
    grid = StampGrid(PERIOD_S, max_gap_s)
    return [grid.arrive(int(stamp)) for stamp in stamps]


def arrivals(samples, jitter_ns=None, max_gap_s=MAX_GAP_S):
    """Let samples arrive by their numbers."""
    jitter_ns = jitter_ns or [0] * len(samples)
    stamps = [START_NS + k * PERIOD_NS + j for k, j in zip(samples, jitter_ns, strict=True)]
    return arrivals_of(stamps, max_gap_s)


@given(st.lists(st.integers(1, MAX_GAP_SAMPLES), max_size=30))
def test_bridged_gaps_make_up_for_every_missing_sample(steps):
    samples = [sum(steps[:i]) for i in range(len(steps) + 1)]
    verdicts = arrivals([*samples, samples[-1] + 1])
    # The sample after a gap is taken, and the one after it tells that there was one.
    assert verdicts == [NEXT, NEXT, *(step - 1 for step in steps)]


@given(st.integers(MAX_GAP_SAMPLES + 1, 10**12))
def test_a_gap_too_long_to_bridge_begins_a_new_stretch(step):
    verdicts = arrivals([0, *(step + k for k in (0, 1, 2, 3, 4, 6, 7))])
    assert verdicts == [NEXT, *[DROPPED] * 3, NEW_STRETCH, NEXT, NEXT, 1]


#: Stamps of about as many samples, each off by a little.
JITTERS = st.lists(st.integers(-PERIOD_NS // 10, PERIOD_NS // 10), min_size=2, max_size=80)


@given(JITTERS, st.data(), st.sampled_from([0.0, MAX_GAP_S, 60.0]))
def test_one_wrong_stamp_among_regular_ones_costs_at_most_its_own_sample(
    jitter_ns, data, max_gap_s
):
    at = data.draw(st.integers(1, len(jitter_ns) - 1))
    near = st.integers(-50 * PERIOD_NS, 50 * PERIOD_NS)
    jitter_ns[at] = data.draw(st.one_of(near, st.integers(-(10**18), 10**18)))
    verdicts = arrivals(range(len(jitter_ns)), jitter_ns, max_gap_s)
    if verdicts[at] == DROPPED:  # A sample is repeated in its place.
        assert verdicts[at + 1 :][:2] in ([], [NEXT], [NEXT, 1])
        verdicts[at : at + 3] = [NEXT] * len(verdicts[at : at + 3])
    assert verdicts == [NEXT] * len(verdicts)


def test_a_first_stamp_that_is_wrong_is_outvoted():
    assert arrivals([10**6, *range(8)]) == [NEXT, *[DROPPED] * 3, NEW_STRETCH, *[NEXT] * 4]


@pytest.mark.parametrize('ahead_s', [100.0, 0.5, 0.05])
@pytest.mark.parametrize('share', [1 / 300, 1 / 100, 1 / 30])
def test_wrong_stamps_now_and_then_make_and_lose_no_rows(ahead_s, share):
    stamps = np.array(line_of(400.0, 20_000, 1e-4))
    wrong = np.random.default_rng(0).random(len(stamps)) < share
    verdicts = arrivals_of(stamps + wrong * round(ahead_s * 1e9))
    assert NEW_STRETCH not in verdicts
    rows = sum(max(verdict, 0) + (verdict != DROPPED) for verdict in verdicts)
    # Where two in a row are wrong by as much, they agree.
    assert rows == pytest.approx(len(stamps), abs=5)


@pytest.mark.parametrize(('share', 'is_bad'), [(0.3, False), (0.7, True)])
def test_it_is_told_when_most_samples_are_dropped(share, is_bad):
    random = np.random.default_rng(0)
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    were_bad = []
    for k in range(1000):
        wrong = k > 100 and random.random() < share
        grid.arrive(START_NS + k * PERIOD_NS + wrong * int(random.integers(-(10**17), 10**17)))
        were_bad.append(grid.mostly_bad)
    assert not any(were_bad[:101])
    assert np.mean(were_bad[600:]) == pytest.approx(float(is_bad), abs=0.01)
    for k in range(1000, 1200):
        grid.arrive(START_NS + k * PERIOD_NS)
    assert not grid.mostly_bad


BURSTS = 38 * (np.arange(7600) // 38)
NOW_S = np.random.default_rng(0).exponential(1e-3, 200)[BURSTS // 38] + 5e-5 * (
    np.arange(7600) - BURSTS
)


@pytest.mark.parametrize(
    ('stamps_s', 'kind'),
    [
        (BURSTS / 400 + NOW_S, 'bunched'),
        (np.arange(7600) // 4 * 0.01, 'coarse'),
        (np.arange(7600) // 2 * 0.005, 'coarse'),
        (np.floor(np.arange(7600) / 380 * 100) / 100, 'coarse'),
        (np.floor(np.arange(7600) / 380 * 1000) / 1000, 'regular'),
    ],
)
def test_where_stamps_are_coarse_or_bunched_rows_are_counted(stamps_s, kind):
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    assert not any(grid.arrive(START_NS + round(s * 1e9)) for s in stamps_s)
    assert grid.kind == kind


@given(st.integers(MAX_GAP_SAMPLES + 10, 10**12))
def test_a_clock_that_was_set_back_begins_a_new_stretch_after_the_longest_gap(back):
    before = list(range(92, 102))
    after = [101 - back + k for k in range(MAX_GAP_SAMPLES + 6)]
    verdicts = arrivals(before + after)
    # The dropped ones must have run forward for longer than the longest gap.
    assert verdicts[10 : 11 + MAX_GAP_SAMPLES] == [DROPPED] * (MAX_GAP_SAMPLES + 1)
    assert verdicts[11 + MAX_GAP_SAMPLES :] == [NEW_STRETCH, NEXT, NEXT, NEXT, NEXT]


def test_late_samples_among_good_ones_never_begin_a_new_stretch():
    # A second source, an hour behind, runs forward all the time; the first is not disturbed.
    hour = 3600 * 400
    samples = [n for k in range(hour, hour + 200) for n in (k, k - hour)]
    verdicts = arrivals(samples)
    assert verdicts[0::2] == [NEXT] * 200
    assert verdicts[1::2] == [DROPPED] * 200


def line_of(rate_hz, n, jitter_s):
    """Return the stamps of n samples, each off by up to the jitter."""
    off_s = np.random.default_rng(0).uniform(-jitter_s, jitter_s, n)
    return [START_NS + round((k / rate_hz + off) * 1e9) for k, off in enumerate(off_s)]


@pytest.mark.parametrize('rate', [0.98, 1.02])
def test_the_period_is_that_of_the_stamps(rate):
    grid = StampGrid(1 / 380, MAX_GAP_S)
    for stamp in line_of(rate * 380.0, 20_000, 1e-3):
        assert grid.arrive(stamp) == NEXT
    assert 1e9 / grid.period_ns == pytest.approx(rate * 380.0, rel=5e-3)


def rows_made_up(before, after, jitter, lost=0.0, streams=100, n=3000):
    """Return how many rows too many are made up of streams whose rate changes, over 380 Hz."""
    made_up = []
    for seed in range(streams):
        random = np.random.default_rng(seed)
        periods = 1.0 / np.where(np.arange(n) < 600, before, after)
        times = np.cumsum(periods) + periods * random.uniform(-jitter, jitter, n)
        kept = random.random(n) >= lost
        kept[[0, -2, -1]] = True
        stamps = START_NS + np.rint(times[kept] * 1e9 / 380).astype(np.int64)
        made_up.append(len(StampGrid(1 / 380, MAX_GAP_S).mend(stamps).places) - n)
    return np.array(made_up)


@pytest.mark.parametrize('before', [0.85, 0.9, 0.95, 1.0, 1.1, 1.15])
def test_a_clock_that_is_off_is_not_taken_for_losses_and_hides_none(before):
    assert not rows_made_up(before, before, 0.0, streams=1).any()
    made_up = rows_made_up(before, before, 0.3)
    assert made_up.mean() < (0.3 if before < 0.9 else 0.1)
    for lost in (0.01, 0.05):  # 30 or 150 rows of each stream
        off = rows_made_up(before, before, 0.3, lost)
        assert np.abs(off).mean() < (2.5 if before < 0.9 else 1.5)


@pytest.mark.parametrize('after', [0.85, 345 / 380, 0.95, 437 / 380])
def test_a_rate_that_changes_is_not_taken_for_losses(after):
    assert not rows_made_up(1.0, after, 0.0, streams=1).any()
    assert rows_made_up(1.0, after, 0.3).mean() < (3.0 if after == 0.85 else 1.0)
    assert np.abs(rows_made_up(1.0, after, 0.3, 0.01)).mean() < 4.0


@given(st.integers(1, 40), st.integers(2, 40), st.data())
def test_batches_come_or_are_missing_as_a_whole(rows, n, data):
    lost = data.draw(st.integers(1, n - 1))
    late_ns = data.draw(st.integers(0, rows * PERIOD_NS // 3))
    grid = StampGrid(PERIOD_S, 1.0)
    for number in range(n + 1):
        if number != lost:
            at_ns = START_NS + number * rows * PERIOD_NS
            arrival = grid.arrive(at_ns + late_ns * (number == 1), rows)
            assert arrival == (rows if number == lost + 2 else 0)


#: Times of publications, in batches: quick ones behind a late one too.
PUBLISHED_NS = st.lists(
    st.one_of(st.integers(1, PERIOD_NS), st.integers(1, 100 * PERIOD_NS)), min_size=1, max_size=80
).map(lambda steps_ns: np.cumsum([START_NS, *steps_ns]).tolist())


@given(PUBLISHED_NS, st.integers(1, 40), st.integers(0, 2**62), st.sampled_from([0.0, MAX_GAP_S]))
def test_numbered_batches_may_be_published_late_at_any_time(at_ns, rows, first, max_gap_s):
    grid = StampGrid(PERIOD_S, max_gap_s)
    verdicts = [grid.arrive(stamp, rows, first + k) for k, stamp in enumerate(at_ns)]
    assert verdicts == [NEXT] * len(verdicts)


@given(PUBLISHED_NS, st.integers(1, 40), st.sets(st.integers(1, 79)))
def test_each_numbered_batch_that_is_lost_is_told_whenever_the_others_come(at_ns, rows, lost):
    grid = StampGrid(PERIOD_S, max_gap_s=1e3)
    came = [number for number in range(len(at_ns)) if number not in lost]
    verdicts = [grid.arrive(at_ns[number], rows, number) for number in came]
    missing = np.diff(came, prepend=-1) - 1
    assert verdicts == (rows * missing).tolist()


@given(st.lists(st.integers(0, 3), min_size=2, max_size=40))
def test_numbered_messages_without_samples_are_not_missing(samples):
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    for number, rows in enumerate(samples):
        if rows:
            assert grid.arrive(START_NS + number * PERIOD_NS, rows, number) == NEXT
        else:
            grid.skip(number)


def test_more_lost_batches_than_are_bridged_begin_a_new_stretch():
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    batch_ns = 10 * PERIOD_NS
    verdicts = [grid.arrive(START_NS + n * batch_ns, 10, n) for n in (0, 1, 5, 9, 14, 15)]
    assert verdicts == [NEXT, NEXT, 30, 30, NEW_STRETCH, NEXT]


@pytest.mark.parametrize(
    ('max_gap_s', 'pause_s', 'verdict'),
    [(0.0, 0.9, NEXT), (0.1, 0.9, NEXT), (0.1, 1.1, NEW_STRETCH), (5.0, 4.9, NEXT)],
)
def test_after_a_long_pause_of_the_source_a_new_stretch_begins(max_gap_s, pause_s, verdict):
    grid = StampGrid(PERIOD_S, max_gap_s)
    grid.arrive(START_NS, 1, 7)
    pause_ns = PERIOD_NS + round(pause_s * 1e9)
    assert grid.arrive(START_NS + pause_ns, 1, 8) == verdict
    assert grid.arrive(START_NS + pause_ns + PERIOD_NS, 1, 9) == NEXT


@given(st.integers(0, 10**12))
def test_numbers_that_go_on_while_the_clock_is_set_back_lose_nothing(back_ns):
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    for number in range(20):
        at_ns = START_NS + number * PERIOD_NS - (back_ns if number >= 10 else 0)
        assert grid.arrive(at_ns, 1, number) == NEXT


def test_a_publisher_that_was_started_again_is_judged_by_its_stamps():
    grid = StampGrid(PERIOD_S, MAX_GAP_S)
    verdicts = [grid.arrive(START_NS + k * PERIOD_NS, 1, 100 + k) for k in range(5)]
    again = (50, 51, 52, 53, 54, 57)
    verdicts += [grid.arrive(START_NS + k * PERIOD_NS, 1, k - 49) for k in again]
    assert verdicts == [*[NEXT] * 5, *[DROPPED] * 3, NEW_STRETCH, NEXT, 2]


@given(
    st.lists(st.integers(-3, 40), max_size=60),
    st.lists(st.integers(0, 60), max_size=5),
)
def test_mended_samples_are_what_their_arrivals_say_however_they_are_cut(steps, cuts):
    stamps = START_NS + PERIOD_NS * np.cumsum(np.array(steps, np.int64))
    grid, rows, wanted = StampGrid(PERIOD_S, MAX_GAP_S), [], []
    for i, stamp in enumerate(stamps.tolist()):
        missing = grid.arrive(stamp)
        if missing == NEW_STRETCH:
            wanted.append(rows)
            rows = []
        if missing != DROPPED:
            rows = [*rows, *rows[-1:] * missing, i]
    wanted.append(rows)

    grid, stretches, last, last_ns = StampGrid(PERIOD_S, MAX_GAP_S), [[]], None, 0
    for piece in np.split(np.arange(len(stamps)), sorted(cuts)):
        mended = grid.mend(stamps[piece])
        assert len(mended.stamps_ns) == len(mended.places)
        for i, of_stretch in enumerate(mended.stretches):
            if i or mended.first_is_new:
                stretches.append([])
                last_ns = 0
            places = mended.places[of_stretch]
            stretches[-1] += [last if at < 0 else int(piece[at]) for at in places]
            stamps_ns = mended.stamps_ns[of_stretch]
            assert (np.diff(stamps_ns, prepend=last_ns) > 0).all()
            last_ns = stamps_ns[-1]
        if len(mended.places):
            last = int(piece[mended.places[-1]])
    assert [part for part in stretches if part] == [part for part in wanted if part]
