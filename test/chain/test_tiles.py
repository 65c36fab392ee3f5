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

"""Which columns tiles hold, and arrays with a value for each lane."""

import itertools
import mmap

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.lanes import LANES, LINE
from slip_detector.chain.tiles import REUSED_BYTES, aligned, least_floors_db, tile_bases_of
from support.tiled_chains import configs, enabled_of


@given(configs())
def test_tiles_hold_each_enabled_channel_and_none_is_without(config):
    bases = tile_bases_of(config)
    columns = max(config.channels, LANES)
    assert bases == sorted(set(bases))
    assert bases[0] >= 0
    assert bases[-1] + LANES <= columns
    tiles = [set(range(base, base + LANES)) for base in bases]
    enabled = set(enabled_of(config))
    assert enabled <= set().union(*tiles)
    for before, tile in itertools.pairwise([set(), *tiles]):
        assert (tile - before) & enabled


@given(configs())
def test_each_tile_has_the_least_floors_of_its_channels_in_decibels(config):
    floors = least_floors_db(config)
    if config.decision == 'mean':
        assert floors.shape == (0, LANES)
        return
    for base, tile in zip(tile_bases_of(config), floors, strict=True):
        given_floors = config.noise_floors[base : base + LANES]
        assert tile[: len(given_floors)] == pytest.approx(20 * np.log10(given_floors), abs=1e-9)


@pytest.mark.parametrize('huge_pages', [True, False])
def test_a_large_array_has_memory_of_its_own(huge_pages, monkeypatch):
    if not huge_pages:
        monkeypatch.delattr(mmap, 'MADV_HUGEPAGE', raising=False)
    array = aligned(np.empty, (REUSED_BYTES // 64 + 1, LINE))
    assert array.ctypes.data % mmap.PAGESIZE == 0
    assert not array[[0, -1]].any()
    array[-1] = 1.0
    assert array[-2:].sum() == LINE


@given(st.lists(st.integers(1, 9), min_size=1, max_size=3))
def test_an_aligned_array_begins_where_a_cache_line_does(shape):
    zeros = aligned(np.zeros, tuple(shape))
    assert zeros.shape == tuple(shape)
    assert zeros.ctypes.data % 64 == 0
    assert not zeros.any()
