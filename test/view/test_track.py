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

"""What is kept of a finger: rows in order, and the lowest and highest of each column."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig
from slip_detector.view.track import KEPT_S, MOST_BYTES, SET_BACK_NS, LiveTrack, Rows

VALUES = st.floats(-1e3, 1e3, width=32) | st.just(np.nan)


def rows_of(stamps_ns, values, kept=100):
    rows = Rows(kept, {'volts': (np.float64, 1)})
    rows.append(np.array(stamps_ns, np.int64), volts=np.reshape(values, (-1, 1)))
    return rows


@given(
    cuts=st.lists(st.integers(0, 30), max_size=20),
    kept=st.integers(1, 40),
    since=st.integers(0, 400),
)
def test_however_the_rows_come_the_last_ones_are_kept_in_order(cuts, kept, since):
    rows, begin = Rows(kept, {'level': (np.float32, 2)}), 0
    for n in cuts:
        which = np.arange(begin, begin + n)
        rows.append(10 * which, level=np.column_stack([which, -which]))
        begin += n
    # Of a call with more rows than are kept only the last ones count.
    assert rows.appended == sum(min(n, kept) for n in cuts)
    assert min(kept, rows.appended) <= len(rows) <= 2 * kept
    stamps_ns, level = rows.stamps_ns(since), rows.field('level', since)
    n = min(len(rows), max(0, rows.appended - since))
    assert len(stamps_ns) == len(level) == n
    if max(cuts, default=0) <= kept:
        assert stamps_ns.tolist() == [10 * k for k in range(begin - n, begin)]
    assert (level[:, 0] * 10 == stamps_ns).all()
    assert (level[:, 1] == -level[:, 0]).all()


@given(stamps=st.lists(st.integers(0, 50), max_size=40))
def test_late_rows_are_left_out(stamps):
    rows = rows_of(stamps, np.arange(len(stamps)))
    kept = rows.stamps_ns().tolist()
    assert kept == sorted(set(kept))
    latest = -1
    wanted = [latest := stamp for stamp in stamps if stamp > latest]
    assert kept == wanted


@given(
    steps=st.lists(st.integers(1, 40), min_size=1, max_size=60),
    values=st.data(),
    width_ns=st.integers(1, 100),
    cut=st.integers(0, 30),
)
def test_a_column_has_the_lowest_and_the_highest_of_its_rows(steps, values, width_ns, cut):
    stamps_ns = np.cumsum(steps)
    volts = values.draw(st.lists(VALUES, min_size=len(steps), max_size=len(steps)))
    rows = rows_of(stamps_ns, volts)
    first, count = cut, 40
    low, high = rows.columns('volts', first, count, width_ns, np.array([0]))
    for k in range(count):
        inside = (stamps_ns >= (first + k) * width_ns) & (stamps_ns < (first + k + 1) * width_ns)
        there = [v for v in np.array(volts, np.float32)[inside] if not np.isnan(v)]
        if there:
            assert (low[0, k], high[0, k]) == (min(there), max(there))
        else:
            assert np.isnan(low[0, k])
            assert np.isnan(high[0, k])


def test_columns_stay_as_they_are_when_the_page_scrolls():
    rng = np.random.default_rng(3)
    stamps_ns = 10**18 + np.cumsum(rng.integers(1, 5_000_000, 400))
    rows = rows_of(stamps_ns, rng.normal(size=400), kept=400)
    width_ns = 11_111_111
    first = int(stamps_ns[0]) // width_ns
    whole, _ = rows.columns('volts', first, 77, width_ns, np.array([0]))
    for begin in range(0, 77, 7):
        part, _ = rows.columns('volts', first + begin, 7, width_ns, np.array([0]))
        assert np.array_equal(part[0], whole[0, begin : begin + 7], equal_nan=True)


def test_values_beyond_float32_are_infinite_and_no_warning():
    rows = rows_of([1, 2, 3], [1e300, -1e300, 1.0])
    low, high = rows.columns('volts', 0, 1, 10, np.array([0]))
    assert (low[0, 0], high[0, 0]) == (-np.inf, np.inf)
    levels = Rows(2, {'level': (np.float32, 1)})
    levels.append(np.array([1]), level=[[1e300]])
    assert levels.field('level').tolist() == [[np.inf]]


def test_a_clock_that_is_set_back_begins_a_new_track_and_a_late_message_does_not():
    track = LiveTrack(ChainConfig(channels=2))
    volts, truth = np.zeros((2, 2)), np.zeros(2)
    at_ns = 10**18
    track.add_samples(np.array([at_ns, at_ns + 5]), volts, truth)
    track.add_levels(np.array([at_ns]), volts[:1], volts[:1], truth[:1])
    track.add_samples(np.array([at_ns - SET_BACK_NS + 5, at_ns + 9]), volts, truth)
    assert (track.beginnings, len(track.samples)) == (0, 3)
    back_ns = at_ns - 2 * SET_BACK_NS
    track.add_samples(np.array([back_ns, back_ns + 1]), volts, truth)
    assert (track.beginnings, len(track.samples), len(track.levels)) == (1, 2, 0)


@pytest.mark.parametrize(('channels', 'rate_hz'), [(16, 380.0), (1000, 380.0), (10**6, 380.0)])
def test_a_minute_is_kept_or_as_much_as_memory_allows(channels, rate_hz):
    track = LiveTrack(ChainConfig(channels=channels, sample_rate_hz=rate_hz))
    size = sum(
        values.nbytes
        for rows in (track.samples, track.levels)
        for values in (rows._stamps_ns, *rows._fields.values())
    )
    assert size <= 1.2 * MOST_BYTES
    if channels == 16:
        assert track.samples._kept == round(KEPT_S * rate_hz)
