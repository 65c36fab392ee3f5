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

"""The votes of groups, and the number that a vote compares with the threshold."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from chain.chain_cases import noise
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.votes import NO_VOTE, find_statistics, vote_numbers
from slip_detector.vectors import LANES
from support.random_chains import configs, recordings

VOTES = ('all', 'mean', 1, 2, 3, 4)

levels_of_a_row = st.lists(
    st.one_of(
        st.floats(1e-300, 1e300),
        st.floats(1e-3, 1e3),
        st.sampled_from([np.inf, 1e-200, 0.0, 1.0]),
        st.just(NO_VOTE),
    ),
    min_size=1,
    max_size=9,
)


def numbers_of(levels):
    """Return the number of one group by each vote, the same in all rows of a vector."""
    of_rows = np.repeat(np.array(levels, float)[:, None], LANES, axis=1)
    statistics = np.full((len(VOTES), LANES), np.nan)
    members, bounds = np.arange(len(levels)), np.array([0, len(levels)])
    with np.errstate(all='ignore'):
        find_statistics(of_rows, members, bounds, LANES, vote_numbers(VOTES), statistics)
    assert (statistics == statistics[:, :1]).all()
    return dict(zip(VOTES, statistics[:, 0].tolist(), strict=True))


@given(levels_of_a_row)
def test_all_takes_the_least_and_a_count_the_largest_of_that_rank(levels):
    numbers = numbers_of(levels)
    voting = sorted((level for level in levels if level >= 0), reverse=True)
    assert numbers['all'] == (voting[-1] if voting else 0.0)
    for count in (1, 2, 3, 4):
        assert numbers[count] == (voting[count - 1] if count <= len(voting) else 0.0)


@given(levels_of_a_row)
def test_mean_takes_the_geometric_mean(levels):
    mean = numbers_of(levels)['mean']
    voting = [level for level in levels if level >= 0]
    if not voting or min(voting) == 0.0:
        assert mean == 0.0
    elif max(voting) == np.inf:
        assert mean == np.inf
    else:
        assert min(voting) <= mean <= max(voting)
        # Exact: the product of the levels is within a few roundings of the power of their mean.
        product = np.prod([Fraction(level) for level in voting])
        off = abs(Fraction(mean) - Fraction(np.nextafter(mean, 0.0)))
        below, above = Fraction(mean) - 4 * off, Fraction(mean) + 4 * off
        assert max(below, Fraction(0)) ** len(voting) <= product <= above ** len(voting)


@pytest.mark.parametrize('members', [1, 2, 3, 7, 515])
@pytest.mark.parametrize('level', [0.3, 1e-200, 1e200, 5e-324, np.finfo(float).max])
def test_the_mean_of_equal_levels_is_that_level(members, level):
    assert numbers_of([level] * members)['mean'] == level


@given(st.data(), st.booleans(), st.floats(0.0, 1.0))
def test_each_statistic_says_of_any_threshold_where_a_chain_with_that_vote_is_on(
    data, evidence, share
):
    unit = data.draw(configs(threshold=1.0))
    if evidence:
        floors = {'noise_floor': 1e-4, 'noise_floor_learnt': True}
        unit = dataclasses.replace(unit, decision='evidence', **floors)
    volts = data.draw(recordings(unit))
    enabled = [len({*members} - {*unit.disabled_channels}) for members in unit.groups.values()]
    votes = ('all', 'mean', *range(1, min(*enabled, 4) + 1))
    together = SlipChain(unit).update(volts, votes=votes).vote_statistic
    assert together.shape == (len(volts), len(votes))
    for v, vote in enumerate(votes):
        # A number that occurs is the hardest threshold.
        rank = int(share * (len(volts) - 1))
        threshold = min(max(float(np.sort(together[:, v])[rank]), 1e-30), 1.29)
        chain = SlipChain(dataclasses.replace(unit, vote=vote, threshold=threshold))
        result = chain.update(volts, votes=[vote])
        np.testing.assert_array_equal(result.vote_statistic[:, 0] > 1.0, result.slip)
        np.testing.assert_array_equal(together[:, v] > threshold, result.slip)


@pytest.mark.parametrize('vote', ['most', 0, -1, 1.5, True, None])
def test_a_vote_that_is_none_is_refused(vote):
    with pytest.raises(ValueError, match='allowed: all, mean, or a whole number from 1'):
        SlipChain().update(noise(1, 5, 16), votes=[vote])
