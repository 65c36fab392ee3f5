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

"""What recordings teach of a finger: floors and mains of rest, steps of slips, contact."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters import ChainConfig
from slip_detector.tuning.measuring import (
    contact_level_v,
    find_mains,
    learn_floors,
    learn_noise,
    slip_steps_v,
)
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import EVIDENCE, FLOOR, HIGH, RATE_HZ, slips, track, track_with

PIEZO_HZ = 312.5
PIEZO = ChainConfig(sample_rate_hz=PIEZO_HZ, channels=4, gain=1.0, **HIGH)
NOISE_V = np.array([0.01, 0.03, 0.1, 0.02])


def noise(rows=10_000, seed=0):
    return NOISE_V * np.random.default_rng(seed).standard_normal((rows, 4))


def rest(volts, truth=None, rate_hz=PIEZO_HZ):
    return track_with(volts, truth, 'rest', rate_hz)


def hum(mains_hz, rows, rate_hz, amplitudes):
    time_s = np.arange(rows)[:, np.newaxis] / rate_hz
    return sum(
        amplitude * np.sin(2 * np.pi * harmonic * mains_hz * time_s + harmonic)
        for harmonic, amplitude in amplitudes.items()
    )


@pytest.mark.parametrize('window_rows', [1, 3, 16, 90])
def test_at_the_floors_that_are_learnt_noise_makes_no_evidence(window_rows):
    chain = dataclasses.replace(PIEZO, envelope_window_s=window_rows / PIEZO_HZ)
    floors = learn_floors(chain, [rest(noise(20_000))])
    learnt = {'noise_floor': floors, 'noise_floor_learnt': True, 'noise_floor_range_db': 15.0}
    chain = dataclasses.replace(chain, **FLOOR | learnt, evidence_offset_db=0.5)
    result = SlipChain(chain).update(noise(20_000, seed=1), excess=True)
    excess_db = result.excess[1000:].mean(axis=0)
    assert -5.0 < excess_db.min() <= excess_db.max() < 0.0


def test_slips_and_bad_channels_take_no_part_in_the_floors():
    quiet, loud = noise(), noise()
    truth = np.zeros(len(loud), bool)
    truth[4000:7000] = True
    loud[truth] *= 50.0
    plain = np.array(learn_floors(PIEZO, [rest(quiet)]))
    np.testing.assert_allclose(learn_floors(PIEZO, [rest(loud, truth)]), plain, rtol=0.05)
    quiet[:, 1] = np.nan
    found = learn_floors(PIEZO, [rest(quiet)])
    assert found[1] == pytest.approx(np.median(plain[[0, 2, 3]]), rel=1e-3)
    np.testing.assert_allclose(np.delete(found, 1), np.delete(plain, 1), rtol=1e-9)


@settings(max_examples=15)
@given(
    mains_hz=st.sampled_from([50.0, 60.0]),
    rate_hz=st.sampled_from([90.0, 210.0, 312.5, 380.0, 1000.0]),
    harmonics=st.sampled_from([(1, 3), (1, 2, 4), (1,)]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_mains_is_found_by_its_lines_aliased_or_not(mains_hz, rate_hz, harmonics, seed):
    rows = round(30.0 * rate_hz)
    volts = noise(rows, seed) + hum(mains_hz, rows, rate_hz, dict.fromkeys(harmonics, 0.3))
    found_hz, line = find_mains(PIEZO, rest(volts, rate_hz=rate_hz))
    assert found_hz == mains_hz
    assert all(float(height_db) >= 12.0 for height_db in re.findall(r'\((\d+) dB', line))
    assert all(0.0 < float(hz) <= rate_hz / 2 for hz in re.findall(r'seen at ([\d.]+) Hz', line))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_noise_has_no_mains_nor_has_a_line_that_one_channel_lacks(seed):
    volts = noise(6000, seed)
    assert find_mains(PIEZO, rest(volts))[0] == 0.0
    volts[:, :3] += hum(50.0, 6000, PIEZO_HZ, {1: 0.5})
    assert find_mains(PIEZO, rest(volts))[0] == 0.0
    for nothing in (np.full((6000, 4), 4.3), volts[:2000, :3]):  # flat, and too short
        assert find_mains(PIEZO, rest(nothing))[0] == 0.0
    without = dataclasses.replace(PIEZO, disabled_channels=(4,))
    assert find_mains(without, rest(volts))[0] == 50.0


@pytest.mark.parametrize(('accuracy_s', 'below'), [(0.0, 9), (0.2, 8)])
def test_the_steps_of_slips_are_those_that_nine_in_ten_stay_below_or_eight_of_a_hand(
    accuracy_s, below
):
    volts, truth = np.zeros((2000, 3)), np.arange(2000) % 200 >= 150
    # In each slip one channel steps by 1 to 10 V and another by half as much, over two rows, and
    # one row is lost.
    for k, at in enumerate(range(160, 2000, 200)):
        volts[at : at + 2, :2] = (k * 7 % 10 + 1) * np.array([[0.5, 0.25], [1.0, 0.5]])
        volts[at + 2] = np.nan
    volts[50] = 99.0
    rows = Samples.evenly(volts, RATE_HZ, truth, accuracy_s=accuracy_s)
    tracks = [track_of('a', [rows], RATE_HZ), track_with(volts)]
    largest = np.array([1.0, 0.5, 0.0]) * (below + 1)
    assert slip_steps_v(ChainConfig(channels=3), tracks, rows=2).tolist() == largest.tolist()


def learn(rest_s=60.0, chain=EVIDENCE, mains_hz=60.0, hum_v=0.0):
    """Learn of a recording at rest, with hum."""
    volts, _ = slips(1, duration_s=rest_s, slips=False)
    volts += hum(mains_hz, len(volts), chain.sample_rate_hz, {1: hum_v})
    still = rest(volts, rate_hz=chain.sample_rate_hz)
    learnt, lines = learn_noise(chain, [still], still)
    return learnt, '\n'.join(lines)


def test_rest_teaches_a_floor_for_each_channel_once_its_hum_is_removed():
    parameters, lines = learn()
    floors = list(learn_floors(EVIDENCE, [track(1, duration_s=60.0, slips=False)]))
    learnt = {'noise_floor': floors, 'noise_floor_learnt': True, 'noise_floor_range_db': 15.0}
    assert parameters == learnt
    assert 'no line of the mains is 12 dB above the noise' in lines
    humming, lines = learn(hum_v=0.5)
    assert humming['mains_hz'] == 60.0
    assert 'mains of 60 Hz: lines of 60 Hz (' in lines
    # The comb makes noise louder by 3 dB; the hum was louder by 20.
    ratios = np.array(humming['noise_floor']) / floors
    np.testing.assert_allclose(20.0 * np.log10(ratios), 3.0, atol=0.7)
    # Of hum without whole periods there is no comb.
    other = dataclasses.replace(EVIDENCE, sample_rate_hz=377.7)
    parameters, lines = learn(chain=other, mains_hz=50.0, hum_v=1.0)
    assert 'mains_hz cannot remove it' in lines
    assert parameters.keys() == learnt.keys()
    with pytest.raises(ValueError, match=r'^rest: lasts 4 s, allowed: at least 5 s at rest'):
        learn(rest_s=4.0)


def test_contact_begins_above_a_finger_that_touches_nothing_and_below_one_that_slides():
    volts, truth = slips(1, slip_hz=14.0)
    idle = 4.3 + 0.002 * np.random.default_rng(2).standard_normal((4000, 4))
    of_idle = track_with(idle, kind='idle')
    level_v = contact_level_v(EVIDENCE, [track_with(volts, truth), of_idle])
    gated = SlipChain(dataclasses.replace(EVIDENCE, contact_level_v=level_v))
    assert not gated.update(idle, excess=True).excess.any()
    gated.reset()
    assert gated.update(volts, excess=True).excess[truth].any(axis=1).mean() > 0.8
    # Where a finger always touches there is no level.
    for more in ([], [track_with(volts, kind='idle')]):
        with pytest.raises(ValueError, match=r'touches nothing has a level of .* allowed: 1\.2 t'):
            contact_level_v(EVIDENCE, [track_with(volts, truth), *more])
    # A slide that sticks for half of its time is in contact by its loudest rows.
    sticks = np.arange(len(volts)) % 1140 < 703
    volts[sticks] = np.resize(idle, volts.shape)[sticks]
    assert contact_level_v(EVIDENCE, [track_with(volts, truth), of_idle]) > 0.0
