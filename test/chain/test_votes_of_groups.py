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

"""Votes of the groups, disabled channels, and any number of channels."""

import numpy as np
import pytest

from slip_detector.chain.lanes import LANES
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from support.chain_cases import FAST, VOTES, noise, sine

# --- votes ---------------------------------------------------------------------------------


NAN = float('nan')

# Levels as multiples of the threshold (powers of 2, so exact), the vote, ON, able to vote.
VOTE_CASES = [
    ((2, 2, 2), 'all', True, True),
    ((2, 2, 0.5), 'all', False, True),
    ((2, 2, 1), 'all', False, True),
    ((2, 2, 0), 'all', False, True),
    ((2, 2, NAN), 'all', True, True),
    ((2, NAN, NAN), 'all', True, True),
    ((0.5, NAN, NAN), 'all', False, True),
    ((NAN, NAN, NAN), 'all', False, False),
    ((2, 0.5, 0.5), 1, True, True),
    ((0.5, 0.5, 0.5), 1, False, True),
    ((2, NAN, NAN), 1, True, True),
    ((NAN, NAN, NAN), 1, False, False),
    ((2, 2, 0.5), 2, True, True),
    ((2, 0.5, 0.5), 2, False, True),
    ((2, 2, NAN), 2, True, True),
    ((2, 0.5, NAN), 2, False, True),
    ((2, NAN, NAN), 2, False, False),
    ((2, 2, 2), 3, True, True),
    ((2, 2, 0.5), 3, False, True),
    ((2, 2, NAN), 3, False, False),
    ((4, 0.5, 1), 'mean', True, True),
    ((4, 0.125, 1), 'mean', False, True),
    ((0.5, 0.5, 8), 'mean', True, True),
    ((0.5, 0.5, 2), 'mean', False, True),
    ((1, 1, 1), 'mean', False, True),
    ((1024, 1024, 0), 'mean', False, True),
    ((4, 0.5, NAN), 'mean', True, True),
    ((4, 0.125, NAN), 'mean', False, True),
    ((2, NAN, NAN), 'mean', True, True),
    ((NAN, NAN, NAN), 'mean', False, False),
]


def volts_of_levels(levels, n=100):
    """Return rows at whose end the FAST chain's levels are these multiples of the first value."""
    return sine(n)[:, None] * np.array(levels, dtype=float)


def threshold_of_one(n=100):
    config = ChainConfig(**FAST | {'channels': 1})
    return float(SlipChain(config).update(volts_of_levels([1.0], n)).level[-1, 0])


@pytest.mark.parametrize(('levels', 'vote', 'on', 'able'), VOTE_CASES)
def test_the_valid_channels_of_a_group_vote(levels, vote, on, able):
    threshold = threshold_of_one()
    assert threshold > 0.1
    config = ChainConfig(**FAST | {'channels': 3, 'vote': vote, 'threshold': threshold})
    result = SlipChain(config).update(volts_of_levels(levels))
    known = np.nan_to_num(np.array(levels, dtype=float))
    assert np.array_equal(result.level[-1], known * threshold)
    assert np.array_equal(result.channels[-1], known > 1)
    assert np.array_equal(result.valid[-1], ~np.isnan(levels))
    assert (bool(result.groups[-1, 0]), bool(result.can_vote[-1, 0])) == (on, able)
    assert bool(result.slip[-1]) == on


@pytest.mark.parametrize('vote', ['all', 1, 2, 'mean'])
def test_one_bad_row_takes_a_channel_from_the_vote_for_that_row_only(vote):
    config = ChainConfig(**FAST | {'channels': 2, 'vote': vote, 'threshold': 0.1})
    volts = volts_of_levels((1, 1))
    volts[70, 1] = np.nan
    result = SlipChain(config).update(volts)
    assert np.array_equal(np.flatnonzero(~result.valid[:, 1]), [70])
    # Its level holds on, so the channel's own output does too.
    assert result.channels[60:80].all()
    others = np.arange(len(volts)) != 70
    assert result.can_vote[others].all()
    assert result.slip[60:70].all()
    assert result.slip[71:80].all()
    assert bool(result.can_vote[70, 0]) == bool(result.slip[70]) == (vote != 2)


@pytest.mark.parametrize('vote', VOTES)
def test_a_group_without_a_valid_channel_is_off_and_the_others_decide(vote):
    groups = {'dead': (2, 4), 'alive': (5, 1), 'calm': (3, 6)}
    config = ChainConfig(
        **FAST | {'channels': 6, 'groups': groups, 'vote': vote, 'threshold': 0.1}
    )
    volts = volts_of_levels((1, NAN, 2**-10, NAN, 1, 2**-10))
    result = SlipChain(config).update(volts)
    assert result.groups[-1].tolist() == [False, True, False]
    assert result.can_vote[-1].tolist() == [False, True, True]
    assert result.slip[-1]
    assert not result.groups[:, 0].any()


@pytest.mark.parametrize('vote', VOTES)
def test_slip_is_on_while_any_group_is(vote):
    groups = {'a': (1, 2), 'b': (3, 4)}
    config = ChainConfig(
        **FAST | {'channels': 4, 'groups': groups, 'vote': vote, 'threshold': 0.05}
    )
    volts = np.zeros((400, 4))
    volts[50:150, :2] = sine(100)[:, None]
    volts[220:320, 2:] = sine(100)[:, None]
    result = SlipChain(config).update(volts)
    first, second = result.groups.T
    assert first[100]
    assert second[270]
    assert not (first & second).any()
    assert np.array_equal(result.slip, first | second)
    assert not result.slip[200]


def test_the_default_groups_are_those_of_table_1():
    config = ChainConfig(**FAST | {'threshold': 0.1})
    levels = np.zeros(16)
    levels[np.array([1, 3, 8, 6]) - 1] = 1.0
    result = SlipChain(config).update(volts_of_levels(levels))
    assert list(config.groups) == ['TP', 'TD', 'LR', 'LU']
    assert result.groups[-1].tolist() == [False, True, False, False]


# --- disabled channels ---------------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_disabled_channels_show_nothing_and_change_nothing(common_mode, vote):
    shared = {'common_mode': common_mode, 'vote': vote, 'threshold': 0.01}
    config = ChainConfig(
        channels=7,
        disabled_channels=(7, 1, 4),
        groups={'a': (2, 6, 4), 'b': (3, 5), 'off': (1, 7)},
        **shared,
    )
    small = ChainConfig(channels=4, groups={'a': (1, 4), 'b': (2, 3)}, **shared)
    volts = 3 + 0.1 * noise(23, 150, 7)
    volts[:, [0, 3, 6]] = [np.nan, 1e7, np.inf]
    volts[50:60, 1] = np.nan
    enabled, disabled = [1, 2, 4, 5], [0, 3, 6]
    wide, narrow = SlipChain(config).update(volts), SlipChain(small).update(volts[:, enabled])
    for name in ('channels', 'valid', 'level', 'envelope'):
        assert not getattr(wide, name)[:, disabled].any(), name
        assert getattr(wide, name)[:, enabled].tobytes() == getattr(narrow, name).tobytes(), name
    for name in ('groups', 'can_vote'):
        assert np.array_equal(getattr(wide, name)[:, :2], getattr(narrow, name)), name
        assert not getattr(wide, name)[:, 2].any(), name
    assert np.array_equal(wide.slip, narrow.slip)
    assert wide.slip.any()


@pytest.mark.parametrize(('envelope', 'level'), [(True, False), (False, True), (False, False)])
def test_disabled_channels_are_zero_whatever_is_kept(envelope, level):
    config = ChainConfig(channels=4, disabled_channels=(2,))
    volts = noise(24, 60, 4)
    whole = SlipChain(config).update(volts)
    part = SlipChain(config).update(volts, envelope=envelope, level=level)
    assert np.array_equal(part.flags, whole.flags)
    for name, kept in (('envelope', envelope), ('level', level)):
        if kept:
            assert np.array_equal(getattr(part, name), getattr(whole, name))
            assert not getattr(part, name)[:, 1].any()


# --- tiles ---------------------------------------------------------------------------------


@pytest.mark.parametrize('channels', [LANES, LANES + 1, 40, 100])
def test_many_channels_give_the_bits_of_each_channel_alone(channels):
    volts = np.linspace(-3, 4, channels) + noise(25, 90, channels)
    volts[noise(26, 90, channels) > 2] = np.nan
    together = SlipChain(ChainConfig(channels=channels, flat_after_s=0.02)).update(volts)
    alone = SlipChain(ChainConfig(channels=1, flat_after_s=0.02))
    for c in range(channels):
        alone.reset()
        single = alone.update(volts[:, c : c + 1])
        for name in ('level', 'envelope', 'channels', 'valid'):
            column = getattr(together, name)[:, c]
            assert column.tobytes() == getattr(single, name).tobytes(), (c, name)


@pytest.mark.parametrize('common_mode', ['mean', 'median'])
def test_the_common_mode_is_shared_by_all_tiles(common_mode):
    config = ChainConfig(channels=70, common_mode=common_mode)
    # Exact sums, so that a motion that all share is removed exactly.
    volts = np.arange(70.0) / 8 + np.round(noise(27, 80, 1) * 2**20) / 2**20
    assert not SlipChain(config).update(volts).level.any()
    volts[:, 69] += sine(80, 22.0, 380.0)
    result = SlipChain(config).update(volts)
    assert result.level[-1].argmax() == 69


def test_a_group_over_two_tiles_votes_as_one():
    n = 100
    config = ChainConfig(
        **FAST | {'channels': 70, 'threshold': 0.1, 'groups': {'even': range(2, 71, 2),
                                                                 'odd': range(1, 71, 2)}}
    )  # fmt: skip
    levels = np.ones(70)
    assert SlipChain(config).update(volts_of_levels(levels, n)).groups[-1].all()
    levels[68] = 0.0
    assert SlipChain(config).update(volts_of_levels(levels, n)).groups[-1].tolist() == [
        True,
        False,
    ]


@pytest.mark.parametrize('vote', VOTES)
def test_a_bad_channel_of_any_tile_leaves_its_group_vote(vote):
    groups = {'odd': range(1, 71, 2), 'even': range(2, 71, 2)}
    config = ChainConfig(
        **FAST | {'channels': 70, 'threshold': 0.1, 'groups': groups, 'vote': vote}
    )
    for seat in (0, LANES, 69):
        levels = np.full(70, 1 / 1024)
        levels[seat] = 1024.0
        alone = levels.copy()
        # Its group is ON only by the one channel, and only while that is valid.
        alone[seat % 2 :: 2] = np.nan
        alone[seat] = 1024.0
        dead = levels.copy()
        dead[seat] = np.nan
        group = seat % 2
        result = SlipChain(config).update(volts_of_levels(alone))
        assert result.groups[-1, group] == (vote != 2), seat
        assert not result.groups[-1, 1 - group], seat
        assert not SlipChain(config).update(volts_of_levels(dead)).groups.any(), seat
