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

"""Knocks told from slips by the step from one sample to the next."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.impacts import common_steps_v, impact_step, knocks_v
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import CHAIN, RATE_HZ, track


def recording(volts, name='knocks', slip=False):
    return track_of(name, [LabelledRows(volts, np.full(len(volts), slip))], RATE_HZ)


def with_knocks(step_v, many=20, seed=3):
    volts = 0.05 * np.random.default_rng(seed).standard_normal((1000 * many, 4))
    for k in range(many):
        shape = np.exp(-np.arange(60) / 10.0) * np.cos(np.arange(60))
        volts[500 + 1000 * k : 560 + 1000 * k] += step_v * shape[:, np.newaxis]
    return recording(volts)


@given(
    channels=st.integers(1, 4),
    which=st.integers(1, 4),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_step_is_what_so_many_channels_exceed(channels, which, seed):
    random = np.random.default_rng(seed)
    volts = random.standard_normal((30, channels))
    volts[random.random((30, channels)) < 0.2] = np.nan
    which = min(which, channels)
    chain = ChainConfig(channels=channels, impact_channels=which)
    expected = [0.0]
    last = volts[0].copy()
    for row in volts[1:]:
        sizes = np.sort(np.nan_to_num(np.abs(row - last)))[::-1]
        expected.append(sizes[which - 1])
        last = np.where(np.isnan(row), last, row)
    assert common_steps_v(chain, recording(volts)).tolist() == pytest.approx(expected)


def test_a_gap_and_a_disabled_channel_make_no_step():
    volts = np.zeros((20, 4))
    volts[10:] = 5.0
    truth = np.zeros(10, bool)
    pieces = [LabelledRows(volts[:10], truth), LabelledRows(volts[10:], truth, new_stretch=True)]
    assert not common_steps_v(CHAIN, track_of('gap', pieces, RATE_HZ)).any()
    assert common_steps_v(CHAIN, recording(volts)).max() == 5.0
    one = np.zeros((20, 4))
    one[10:, :2] = 5.0
    assert common_steps_v(CHAIN, recording(one)).max() == 5.0
    disabled = dataclasses.replace(CHAIN, disabled_channels=(1,))
    assert common_steps_v(disabled, recording(one)).max() == 0.0


def test_each_knock_counts_once_however_long_it_rings():
    steps_v = knocks_v(CHAIN, with_knocks(20.0))
    assert steps_v.size == 20
    assert steps_v.min() > 15.0
    assert knocks_v(CHAIN, recording(np.zeros((100, 4)))).size == 0


def test_the_chain_holds_the_knocks_and_no_slip_at_the_step_that_is_found():
    slips = track(1)
    found = impact_step(CHAIN, with_knocks(20.0), [slips])
    assert found.knocks == 20
    assert found.slip_v < found.impact_v < found.knock_v
    chain = dataclasses.replace(
        CHAIN, decision='evidence', noise_floor=(1e-3,), impact_v=found.impact_v
    )
    for knocked, volts in ((False, slips.volts), (True, with_knocks(20.0).volts)):
        held = dataclasses.replace(chain, impact_v=0.0)
        with_impacts, without = (
            SlipChain(one).update(volts, excess=True).excess for one in (chain, held)
        )
        assert (with_impacts != without).any() == knocked


def test_knocks_like_slips_are_said_to_be_with_the_numbers():
    line = (
        r'knocks: its knocks cannot be told from slips: 90 % of 20 knocks have a step above '
        r'0\.\d+ V, slips of up to 0\.\d+ V, allowed: 1\.5 times as much'
    )
    with pytest.raises(ValueError, match=line):
        impact_step(CHAIN, with_knocks(0.6), [track(1)])
    with pytest.raises(ValueError, match='seed 1: has no step with slip, allowed: labelled'):
        impact_step(CHAIN, with_knocks(20.0), [track(1, slips=False)])
    still = recording(np.zeros((100, 4)))
    with pytest.raises(ValueError, match='knocks: has no step of 4 times its noise on 2 channels'):
        impact_step(CHAIN, still, [track(1)])


def test_the_last_digit_of_a_converter_is_no_knock():
    digit_v = 1e-3
    volts = np.zeros((4000, 4))
    volts[100::400] = digit_v  # seldom, and back in the next row
    assert knocks_v(CHAIN, recording(volts)).size == 0
    volts[200::800] = 50.0 * digit_v
    assert knocks_v(CHAIN, recording(volts)).tolist() == pytest.approx([50.0 * digit_v] * 5)
