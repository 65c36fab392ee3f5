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

"""A chain that takes over the filters, or the noise floors, of another."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain import stages
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

CONFIG = ChainConfig(
    sample_rate_hz=400.0,
    channels=5,
    passband_hz=(20.0, 100.0),
    stopbands_hz=((45.0, 55.0),),
    valid_range_v=(-10.0, 10.0),
    envelope_window_s=0.02,
    decision_window_s=0.03,
)
ONE_SAMPLE = {'envelope_window_s': 1 / 400.0, 'decision_window_s': 1 / 400.0}


@given(
    st.integers(0, 150),
    st.sampled_from(['none', 'mean', 'median']),
    st.sampled_from([(), (2,)]),
    st.integers(0, 2**32 - 1),
)
def test_it_goes_on_as_if_it_had_seen_all_rows(at, common_mode, disabled, seed):
    rng = np.random.default_rng(seed)
    volts = 4.3 + rng.normal(size=(200, 5)).cumsum(axis=0) * 0.1
    volts[rng.random(volts.shape) < 0.02] = np.nan
    config = dataclasses.replace(
        CONFIG, common_mode=common_mode, disabled_channels=disabled, groups={}
    )
    long, short = SlipChain(config), SlipChain(dataclasses.replace(config, **ONE_SAMPLE))
    long.update(volts[:at])
    # What it did before does not matter.
    short.update(rng.normal(size=(30, 5)))
    short.take_filters(long)
    found = short.update(volts[at:])
    whole = SlipChain(short.config).update(volts)
    np.testing.assert_array_equal(found.envelope, whole.envelope[at:])
    np.testing.assert_array_equal(found.flags, whole.flags[at:])


def test_its_windows_are_empty():
    rng = np.random.default_rng(0)
    volts = rng.normal(size=(100, 5))
    first, second = SlipChain(CONFIG), SlipChain(CONFIG)
    first.update(volts)
    before = first.state.copy()
    second.take_filters(first)
    np.testing.assert_array_equal(first.state, before)
    more = rng.normal(size=(50, 5))
    filtered = SlipChain(dataclasses.replace(CONFIG, **ONE_SAMPLE)).update(
        np.concatenate([volts, more])
    )
    padded = np.concatenate([np.zeros((7, 5)), filtered.envelope[100:]]) ** 2
    mean = np.array([padded[k : k + 8].mean(axis=0) for k in range(50)])
    np.testing.assert_allclose(second.update(more).envelope, np.sqrt(mean), rtol=1e-9)


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'channels': 6, 'groups': {}}, 'has channels = 5, allowed: 6'),
        ({'disabled_channels': (1,), 'groups': {}}, r'has disabled_channels = \(\)'),
        ({'valid_range_v': (0.0, 5.0)}, 'has valid_range_v = '),
        ({'common_mode': 'mean'}, 'has common_mode = none, allowed: mean'),
        ({'passband_hz': (20.0, 90.0)}, 'has other filters'),
        ({'stopbands_hz': ()}, 'has other filters'),
        ({'gain': 1.0}, 'has other filters'),
    ],
)
def test_a_chain_of_other_channels_or_filters_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        SlipChain(dataclasses.replace(CONFIG, **changes)).take_filters(SlipChain(CONFIG))


EVIDENCE = dataclasses.replace(
    CONFIG, stopbands_hz=(), mains_hz=50.0, decision='evidence', noise_floor=0.01, threshold=0.1
)


@given(st.integers(0, 100), st.booleans())
def test_with_evidence_the_window_is_full_before_anything_counts(at, mains):
    config = dataclasses.replace(EVIDENCE, mains_hz=50.0 * mains, noise_floor_learnt=True)
    volts = np.random.default_rng(0).normal(size=(160, 5))
    first, second = SlipChain(config), SlipChain(config)
    first.update(volts[:at])
    second.take_filters(first)
    found = second.update(volts[at:], excess=True, floor=True)
    window = config.samples(config.envelope_window_s)
    begin = max(config.mains_rows - at, 0) + window
    assert (found.excess[:begin] == 0).all()
    assert (found.floor[:begin] == -40).all()
    assert (found.excess[begin] != 0).all()
    whole = SlipChain(config).update(volts)
    wanted = whole.envelope[at + window :]
    np.testing.assert_allclose(found.envelope[window:], wanted, rtol=1e-12)


def test_the_filters_of_a_chain_without_evidence_will_do_but_not_of_other_mains():
    mean = SlipChain(dataclasses.replace(EVIDENCE, decision='mean'))
    volts = np.random.default_rng(0).normal(size=(160, 5))
    mean.update(volts[:100])
    chain = SlipChain(EVIDENCE)
    chain.take_filters(mean)
    whole = SlipChain(EVIDENCE).update(volts)
    found = chain.update(volts[100:]).envelope
    np.testing.assert_allclose(found[8:], whole.envelope[108:], rtol=1e-12)
    with pytest.raises(ValueError, match=r'has mains_hz = 50.0, allowed: 0.0'):
        SlipChain(dataclasses.replace(EVIDENCE, mains_hz=0.0)).take_filters(mean)


def test_noise_floors_are_taken_over_by_channel():
    config = dataclasses.replace(
        EVIDENCE,
        channels=40,
        groups={},
        noise_floor_rate_db_s=300.0,
        noise_floor_range_db=300.0,
        disabled_channels=(3,),
    )
    other = dataclasses.replace(config, disabled_channels=tuple(range(5, 21)), groups={})
    volts = np.random.default_rng(0).normal(size=(400, 40)) * np.geomspace(0.1, 10, 40)
    chain, its = SlipChain(config), SlipChain(other)
    mine = chain.update(volts[:200], floor=True).floor[-1]
    taken = its.update(volts[::-1], floor=True).floor[-1]
    chain.take_floors(its)
    chain.state[:, stages.AGE] = 0.0  # so that no floor moves
    found = chain.update(volts[200:201], floor=True).floor[0]
    kept = np.zeros(40, dtype=bool)
    kept[4:20] = True
    assert np.array_equal(found[kept], mine[kept])
    enabled = np.arange(40) != 2
    assert np.array_equal(found[~kept & enabled], taken[~kept & enabled])
    assert (found != mine)[~kept & enabled].all()


def test_noise_floors_are_taken_only_of_the_same_channels_and_of_evidence():
    chain = SlipChain(EVIDENCE)
    for values in ({'decision': 'mean'}, {'channels': 6, 'groups': {}}):
        with pytest.raises(ValueError, match='allowed: decision: evidence in both'):
            chain.take_floors(SlipChain(dataclasses.replace(EVIDENCE, **values)))
