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

"""The number that a vote holds against the threshold."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.lanes import LANES
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.chain.votes import (
    FACTORS,
    FEW,
    NO_VOTE,
    raise_to_votes,
    vote_numbers,
)
from slip_detector.parameters.detector import ChainConfig
from support.chain_cases import noise
from support.interpreted import interpreted_chain

VOTES = ('all', 'mean', 1, 2, 3, 4)
ROWS = LANES

levels_of_a_row = st.lists(
    st.one_of(
        st.floats(0.0, allow_subnormal=True),
        st.floats(1e-3, 1e3),
        st.sampled_from([1e200, 1e-200, 5e-324, 0.0, 1.0]),
        st.just(NO_VOTE),
    ),
    min_size=1,
    max_size=9,
)


def numbers_of(levels, votes=VOTES):
    """Return the number of one group by each vote, the same in all rows of a vector."""
    of_rows = np.repeat(np.array(levels, float)[:, None], ROWS, axis=1)
    statistics = np.zeros((len(votes), ROWS))
    with np.errstate(all='ignore'):
        raise_to_votes(of_rows, np.array([0, len(levels)]), ROWS, vote_numbers(votes), statistics)
    assert (statistics == statistics[:, :1]).all()
    return dict(zip(votes, statistics[:, 0].tolist(), strict=True))


def volts_of(config, seed, n=300):
    volts = 4.0 + 0.02 * noise(seed, n, config.channels)
    rng = np.random.default_rng(seed)
    volts[rng.random(volts.shape) < 0.05] = np.nan
    volts[100:180, : config.channels // 2] = np.nan
    return volts


@st.composite
def configs(draw):
    channels = draw(st.integers(1, 20))
    order = draw(st.permutations(range(1, channels + 1)))
    count = draw(st.integers(1, min(channels, 4)))
    groups = {f'g{i}': tuple(order[i::count]) for i in range(count)}
    vote = draw(
        st.one_of(st.sampled_from(['all', 'mean']), st.integers(1, min(map(len, groups.values()))))
    )
    exponent = draw(st.integers(1, 6))
    return ChainConfig(channels=channels, groups=groups, vote=vote, exponent=exponent)


@given(levels_of_a_row)
def test_all_takes_the_least_and_a_count_the_largest_of_that_rank(levels):
    numbers = numbers_of(levels)
    able = sorted((level for level in levels if level >= 0), reverse=True)
    assert numbers['all'] == (able[-1] if able else 0.0)
    for count in (1, 2, 3, 4):
        assert numbers[count] == (able[count - 1] if count <= len(able) else 0.0)


@given(levels_of_a_row)
def test_mean_takes_the_geometric_mean_whatever_the_size_of_the_levels(levels):
    mean = numbers_of(levels)['mean']
    able = [level for level in levels if level >= 0]
    if not able or min(able) == 0.0:
        assert mean == 0.0
    elif max(able) == np.inf:
        assert mean == np.inf
    else:
        assert min(able) <= mean <= max(able)
        # Exact: the product of the levels is within a few roundings of the power of their mean.
        product = np.prod([Fraction(level) for level in able])
        off = abs(Fraction(mean) - Fraction(np.nextafter(mean, np.inf)))
        below, above = Fraction(mean) - 4 * off, Fraction(mean) + 4 * off
        assert max(below, Fraction(0)) ** len(able) <= product <= above ** len(able)


@st.composite
def groups_of_rows(draw):
    """Draw the levels of several groups in each row of some vectors."""
    kinds = st.sampled_from(['usual', 'extreme', 'some are not valid'])
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    groups = []
    for size in draw(st.lists(st.sampled_from([1, 3, 4, FEW + 1]), min_size=2, max_size=4)):
        levels, kind = random.uniform(0.1, 10.0, (size, 2 * LANES)), draw(kinds)
        if kind == 'extreme':
            levels **= 200.0
        elif kind == 'some are not valid':
            levels[random.random(levels.shape) < 0.3] = NO_VOTE
        groups.append(levels)
    return groups


def together_and_apart(groups):
    """Return the statistics of groups in one call, and the largest of a call for each of them."""
    numbers, rows = vote_numbers(VOTES), groups[0].shape[1]
    together, apart = np.zeros((2, len(VOTES), rows))
    bounds = np.cumsum([0, *map(len, groups)])
    raise_to_votes(np.concatenate(groups), bounds, rows, numbers, together)
    for levels in groups:
        own = np.zeros_like(apart)
        raise_to_votes(levels.copy(), np.array([0, len(levels)]), rows, numbers, own)
        apart = np.maximum(apart, own)
    return together, apart


@given(groups_of_rows())
def test_of_several_groups_each_vote_takes_the_largest_number_to_the_bit(groups):
    with np.errstate(all='ignore'):
        together, apart = together_and_apart(groups)
    assert together.tobytes() == apart.tobytes()


@pytest.mark.parametrize('members', [3, 4])
def test_of_groups_that_nearly_agree_the_largest_mean_is_taken_not_the_largest_product(members):
    random = np.random.default_rng(0)
    rows = (512 if COMPILED else 16) * LANES
    levels = np.tile(random.uniform(0.1, 10.0, rows), (2, members, 1))
    # By some last bits: the mean of the larger product may be rounded to the smaller number.
    levels[1] *= 1.0 + 2.0**-52 * random.integers(-4, 5, levels[1].shape)
    together, apart = together_and_apart(list(levels))
    assert together.tobytes() == apart.tobytes()


@pytest.mark.parametrize('members', [1, 2, 3, 4, 7, FACTORS + 3])
@pytest.mark.parametrize('level', [0.3, 1e-200, 1e200, 5e-324, np.finfo(float).max])
def test_the_mean_of_equal_levels_is_that_level(members, level):
    assert numbers_of([level] * members)['mean'] == level


def test_a_mean_over_the_whole_range_of_numbers_is_right():
    assert numbers_of([1e200, 1e-200])['mean'] == pytest.approx(1.0, rel=1e-15)
    assert numbers_of([1e300] * 700 + [1e-300] * 700)['mean'] == pytest.approx(1.0, rel=1e-12)
    assert numbers_of([1e300, 1e-300, 1e-300])['mean'] == pytest.approx(1e-100, rel=1e-14)


@given(configs(), st.integers(0, 1000), st.floats(0.0, 1.0))
def test_a_chain_decides_as_its_statistic_says(config, seed, share):
    volts = volts_of(config, seed)
    plain = dataclasses.replace(config, threshold=1.0)
    in_volts = SlipChain(plain).update(volts, votes=[config.vote]).vote_statistic[:, 0]
    # A number that occurs is the hardest threshold.
    rank = int(share * (len(in_volts) - 1))
    threshold = max(float(np.sort(in_volts)[rank]), 1e-30)
    chain = SlipChain(dataclasses.replace(config, threshold=threshold))
    result = chain.update(volts, votes=[config.vote])
    np.testing.assert_array_equal(result.vote_statistic[:, 0] > 1.0, result.slip)
    np.testing.assert_array_equal(in_volts > threshold, result.slip)


@given(configs(), st.integers(0, 1000))
def test_each_vote_has_the_statistic_that_a_chain_with_that_vote_has(config, seed):
    volts = volts_of(config, seed)
    counts = range(1, min(map(len, config.groups.values())) + 1)
    votes = ('all', 'mean', *counts)
    together = SlipChain(config).update(volts, votes=votes).vote_statistic
    assert together.shape == (len(volts), len(votes))
    for i, vote in enumerate(votes):
        own = SlipChain(dataclasses.replace(config, vote=vote)).update(volts, votes=[vote])
        np.testing.assert_array_equal(together[:, i], own.vote_statistic[:, 0])
        np.testing.assert_array_equal(together[:, i] > 1.0, own.slip)


def test_the_statistic_is_the_same_however_the_rows_are_cut_and_whatever_else_is_kept():
    config = ChainConfig(disabled_channels=(3,))
    volts = volts_of(config, 1)
    whole = SlipChain(config).update(volts, votes=VOTES)
    chain = SlipChain(config)
    parts = [
        chain.update(piece, envelope=i % 2 == 0, level=i % 3 == 0, votes=VOTES)
        for i, piece in enumerate(np.split(volts, [1, 1, 2, 9, 70, 134, 250]))
    ]
    found = np.concatenate([part.vote_statistic for part in parts])
    assert found.tobytes() == np.ascontiguousarray(whole.vote_statistic).tobytes()
    assert np.concatenate([part.flags for part in parts]).tobytes() == whole.flags.tobytes()
    with pytest.raises(ValueError, match='level was not kept'):
        _ = parts[1].level


def test_no_vote_asked_for_is_no_statistic():
    assert SlipChain().update(noise(1, 5, 16)).vote_statistic.shape == (5, 0)
    assert SlipChain().update(noise(1, 0, 16), votes=['all']).vote_statistic.shape == (0, 1)


def test_a_count_beyond_the_group_is_never_reached():
    config = ChainConfig(channels=3)
    result = SlipChain(config).update(noise(1, 200, 3), votes=[3, 4])
    assert result.vote_statistic[:, 0].any()
    assert not result.vote_statistic[:, 1].any()


@pytest.mark.parametrize('vote', ['most', 0, -1, 1.5, True, None])
def test_a_vote_that_is_none_is_refused(vote):
    with pytest.raises(ValueError, match='allowed: all, mean or a count of 1 or more'):
        SlipChain().update(noise(1, 5, 16), votes=[vote])


@pytest.mark.skipif(not COMPILED, reason='there is nothing compiled to compare with')
def test_the_interpreted_statistic_has_the_bits_of_the_compiled_one():
    config = ChainConfig(channels=10, groups={'a': (1, 2, 3, 4), 'b': (5, 6, 7, 8, 9, 10)})
    volts = volts_of(config, 2, 60)
    compiled = SlipChain(config).update(volts, votes=VOTES).vote_statistic
    plain = interpreted_chain(config).update(volts, votes=VOTES).vote_statistic
    assert plain.tobytes() == compiled.tobytes()
