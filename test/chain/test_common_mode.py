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

"""The common mode of rows: the mean or median of its valid channels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.common_mode import COMMON_MODE_NUMBERS, MEAN, MEDIAN, find_common_mode
from slip_detector.chain.lanes import LANES
from slip_detector.chain.stages import COMMON_V, FIRST, FIXED_SLOTS, WORD_ROWS
from slip_detector.parameters.detector import COMMON_MODES

LIMIT_V = 10.0


def common_mode_of(volts, first, kind, before_v=0.0, valid=None):
    """Return the common mode of each row, and the first good samples after them."""
    rows, channels = volts.shape
    tiles_of, columns = -(-channels // LANES), np.arange(channels)
    tiles = np.zeros((tiles_of, FIXED_SLOTS, LANES))
    padded = np.full((rows, tiles_of * LANES), np.nan)
    padded[:, :channels] = volts
    tiles[:, FIRST] = np.nan
    of_lanes = tiles[:, FIRST].reshape(-1)
    of_lanes[:channels] = first
    tiles[:, FIRST] = of_lanes.reshape(tiles_of, LANES)
    tiles[0, COMMON_V, 0] = before_v
    ranges = np.tile(np.array([-LIMIT_V, LIMIT_V])[None, :, None], (tiles_of, 1, LANES))
    valid = np.abs(volts) <= LIMIT_V if valid is None else valid
    words = np.zeros(tiles_of * LANES + 1, np.uint64)
    for row in range(rows):
        words[:channels] |= valid[row].astype(np.uint64) << np.uint64(row)
    found = np.zeros(WORD_ROWS)
    with np.errstate(all='ignore'):
        find_common_mode(
            padded, 0, rows, kind, np.arange(tiles_of) * LANES, columns, columns, ranges, tiles,
            words, np.zeros((channels, WORD_ROWS)), found,
        )  # fmt: skip
    assert tiles[0, COMMON_V, 0] == found[rows - 1]
    return found[:rows], tiles[:, FIRST].reshape(-1)[:channels]


def test_each_value_of_the_parameter_has_a_number_of_its_own():
    assert COMMON_MODE_NUMBERS.keys() == set(COMMON_MODES)
    assert len(set(COMMON_MODE_NUMBERS.values())) == len(COMMON_MODES)


@given(st.integers(1, 40), st.integers(1, WORD_ROWS), st.integers(0, 1000))
def test_of_channels_that_are_all_valid_it_is_that_of_their_deviations(channels, rows, seed):
    rng = np.random.default_rng(seed)
    # Steps of a coarse converter, so that values are equal now and then.
    volts, first = np.round(rng.normal(size=(rows, channels)), 1), rng.normal(size=channels)
    deviations = volts - first
    medians, after = common_mode_of(volts, first, MEDIAN)
    np.testing.assert_array_equal(medians, np.median(deviations, axis=1))
    np.testing.assert_array_equal(after, first)
    means, _ = common_mode_of(volts, first, MEAN)
    np.testing.assert_allclose(means, deviations.mean(axis=1), rtol=1e-12, atol=1e-14)


@given(st.integers(1, 40), st.integers(1, WORD_ROWS), st.integers(0, 1000))
def test_channels_that_do_not_count_leave_it_to_the_others(channels, rows, seed):
    rng = np.random.default_rng(seed)
    volts, first = rng.normal(size=(rows, channels)), rng.normal(size=channels)
    valid = rng.random(volts.shape) < 0.7
    volts[~valid] = rng.choice([np.nan, np.inf, 1e6], size=(~valid).sum())
    wanted, before = np.empty(rows), 0.25
    for row in range(rows):
        counting = volts[row, valid[row]] - first[valid[row]]
        # Where none counts, it is that of the row before.
        before = np.median(counting) if counting.size else before
        wanted[row] = before
    found, _ = common_mode_of(volts, first, MEDIAN, before_v=0.25, valid=valid)
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize('kind', [MEAN, MEDIAN])
def test_a_channel_that_starts_is_taken_to_have_followed_the_others(kind):
    volts = np.array([[1.0, 2.0, np.nan], [1.5, 2.5, 7.0], [2.0, 3.0, 7.5]])
    found, first = common_mode_of(volts, [1.0, 2.0, np.nan], kind)
    assert found.tolist() == [0.0, 0.5, 1.0]
    assert first.tolist() == [1.0, 2.0, 6.5]
