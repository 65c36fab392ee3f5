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

"""What is kept of a finger: rows in order, columns with their extremes, and spectra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import ChainConfig
from slip_detector.view.track import SET_BACK_NS, LiveTrack, Rows, spectrum

VALUES = st.floats(-1e3, 1e3, width=32) | st.just(np.nan)


@given(
    cuts=st.lists(st.integers(0, 30), max_size=20),
    kept=st.integers(1, 40),
    since=st.integers(0, 400),
)
def test_the_last_rows_are_kept_in_order_however_they_come(cuts, kept, since):
    rows, begin = Rows(kept, level=(np.float32, 2)), 0
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


@given(
    steps=st.lists(st.integers(1, 40), min_size=1, max_size=60),
    values=st.data(),
    width_ns=st.integers(1, 100),
    cut=st.integers(0, 30),
)
def test_a_column_has_the_lowest_and_the_highest_of_its_rows(steps, values, width_ns, cut):
    stamps_ns = np.cumsum(steps)
    volts = values.draw(st.lists(VALUES, min_size=len(steps), max_size=len(steps)))
    rows = Rows(100, volts=(np.float64, 1))
    rows.append(stamps_ns, volts=np.reshape(volts, (-1, 1)))
    first, count = cut, 40
    edges_ns = np.arange(first, first + count + 1) * width_ns
    low, high = rows.columns('volts', edges_ns, np.array([0]), 0)
    for k in range(count):
        inside = (stamps_ns >= (first + k) * width_ns) & (stamps_ns < (first + k + 1) * width_ns)
        there = [v for v in np.array(volts, np.float32)[inside] if not np.isnan(v)]
        if there:
            assert (low[0, k], high[0, k]) == (min(there), max(there))
        else:
            assert np.isnan(low[0, k])
            assert np.isnan(high[0, k])


def test_a_clock_that_is_set_back_begins_a_new_track_and_a_late_message_does_not():
    track = LiveTrack(ChainConfig(channels=2))
    volts, at_ns = np.zeros((2, 2)), 10**18
    track.add_samples(Samples(volts, np.array([at_ns, at_ns + 5])))
    track.add_levels(np.array([at_ns]), volts[:1], volts[:1], volts[:1, 0])
    track.add_samples(Samples(volts, np.array([at_ns - SET_BACK_NS + 5, at_ns + 9])))
    assert (track.beginnings, len(track.samples)) == (0, 3)
    back_ns = at_ns - 2 * SET_BACK_NS
    track.add_samples(Samples(volts, np.array([back_ns, back_ns + 1])))
    assert (track.beginnings, len(track.samples), len(track.levels)) == (1, 2, 0)


def power_v2(found):
    return np.sum(10.0 ** (found.density_db / 10.0), axis=1) * found.step_hz


@pytest.mark.parametrize('rate_hz', [20.0, 380.0, 20_000.0])
def test_the_power_over_all_frequencies_is_the_variance(rate_hz):
    volts = 1e-6 * np.random.default_rng(1).normal(size=(5000, 2))
    found = spectrum(volts, rate_hz)
    assert power_v2(found) == pytest.approx(np.full(2, 1e-12), rel=0.4)
    assert found.density_db.shape[1] * found.step_hz == pytest.approx(rate_hz / 2, rel=0.05)


def test_values_that_are_no_numbers_are_replaced_by_the_mean_of_their_channel():
    volts = np.random.default_rng(1).normal(size=(2000, 3))
    filled = volts.copy()
    filled[700:704, 1] = np.delete(volts[:, 1], range(700, 704)).mean()
    filled[0, 2] = volts[1:, 2].mean()
    volts[700:704, 1], volts[0, 2] = (np.nan, np.inf, np.nan, -np.inf), np.nan
    volts[9, 0] = 1e300  # Its square is infinite, which is of its own channel only.
    found, wanted = (spectrum(each, 380.0).density_db[1:] for each in (volts, filled))
    assert found == pytest.approx(wanted, abs=1e-3)
    assert spectrum(volts[:20], 380.0) is None
