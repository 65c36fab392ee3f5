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

"""Where channels, settings and scratch memory of a chain are in its plan."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.compiled import COMPILED, compiled
from slip_detector.chain.filters import design
from slip_detector.chain.lanes import LANES
from slip_detector.chain.plan import (
    CHUNK_WORDS,
    parts_of,
    plan_of,
)
from slip_detector.parameters.detector import ChainConfig
from support.tiled_chains import configs, enabled_of

SECTIONS = design(ChainConfig())


@compiled
def _parts_for_python(plan):
    return parts_of(plan)


def plan_and_parts(config, votes=()):
    plan = plan_of(config, SECTIONS, votes)
    # Parts are no references: the plan has to stay.
    return plan, *_parts_for_python(plan)


@given(configs())
def test_each_enabled_channel_has_one_seat_in_the_tile_that_holds_it(config):
    _plan, settings, ranges, _, _, layout, scratch = plan_and_parts(config)
    enabled = enabled_of(config)
    assert layout.columns.tolist() == enabled
    assert len(set(layout.seats.tolist())) == len(enabled) == settings.enabled
    for channel, seat in zip(layout.columns, layout.seats, strict=True):
        tile, lane = divmod(int(seat), LANES)
        assert layout.bases[tile] + lane == channel
        assert ranges[tile, :, lane].tolist() == [-3.0, 4.0]
        assert layout.flag_seats[channel] == seat
    disabled = np.array(config.disabled_channels, int) - 1
    # Theirs is beyond all tiles, where no row is ever ON.
    assert (layout.flag_seats[disabled] == scratch.on.shape[1] - 1).all()
    assert scratch.on.shape == scratch.valid.shape
    assert scratch.on.shape[1] == LANES * layout.bases.size + 1


@given(configs())
def test_a_lane_without_a_channel_that_takes_part_takes_no_sample(config):
    _plan, _, ranges, _, _, layout, _ = plan_and_parts(config)
    for tile, lane in np.ndindex(layout.bases.size, LANES):
        if layout.bases[tile] + lane not in enabled_of(config):
            low, high = ranges[tile, :, lane]
            assert low > high


@given(configs())
def test_groups_are_their_enabled_members_one_after_the_other(config):
    _plan, _, _, _, _, layout, _ = plan_and_parts(config)
    seat_of = dict(zip(layout.columns.tolist(), layout.seats.tolist(), strict=True))
    for i, channels in enumerate(config.groups.values()):
        members = layout.members[layout.bounds[i] : layout.bounds[i + 1]]
        assert members.tolist() == [seat_of[c - 1] for c in channels]
    assert layout.places[layout.members].tolist() == list(range(layout.members.size))
    assert (layout.places >= 0).sum() == layout.members.size


@given(configs())
def test_each_channel_has_its_own_least_floor_in_decibels(config):
    _plan, _, _, least_db, _, layout, _ = plan_and_parts(config)
    if config.decision == 'mean':
        assert least_db.shape == (0, LANES)
        return
    for channel, seat in zip(layout.columns.tolist(), layout.seats.tolist(), strict=True):
        wanted = 20 * np.log10(config.noise_floors[channel])
        assert least_db[seat // LANES, seat % LANES] == pytest.approx(wanted, abs=1e-9)


@given(configs(), st.lists(st.sampled_from(['all', 'mean', 1, 2, 3]), max_size=4))
def test_the_parts_of_a_plan_fill_it_and_none_overlaps_another(config, votes):
    plan, settings, ranges, least_db, sections, layout, scratch = plan_and_parts(config, votes)
    np.testing.assert_array_equal(sections, SECTIONS)
    assert settings.threshold == config.threshold
    assert settings.votes == layout.votes.size == len(votes)
    arrays = [ranges, least_db, sections, *layout, *scratch]
    bounds = sorted((part.ctypes.data, part.nbytes) for part in arrays if part.size)
    for (begin, size), (following, _) in itertools.pairwise(bounds):
        assert begin + size <= following
    if COMPILED:
        assert bounds[0][0] == plan.ctypes.data + len(settings) * 8
        assert sum(bounds[-1]) == plan.ctypes.data + plan.nbytes
    assert scratch.block.ctypes.data % 64 == 0
    # There is none for what is not wanted.
    assert bool(scratch.deviations.size) == (config.common_mode != 'none')
    assert bool(scratch.levels.size) == (config.vote == 'mean' or bool(votes))
    evidence = config.decision == 'evidence'
    assert len(least_db) == evidence * layout.bases.size
    assert bool(scratch.steps.size) == (evidence and config.impact_v > 0)
    assert scratch.held.shape == (len(scratch.on),)
    # Levels are those of one word.
    assert len(scratch.on) == len(scratch.common_v) == (1 if scratch.levels.size else CHUNK_WORDS)
