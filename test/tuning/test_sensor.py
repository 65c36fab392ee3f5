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

"""What is learnt of a sensor at rest, and knocks told from slips."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.sensor import (
    LEAST_LINE_DB,
    common_steps_v,
    find_mains,
    impact_step,
    knocks_v,
    learnt_floors,
)
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import CHAIN, RATE_HZ, track

PIEZO_HZ = 312.5
PIEZO = ChainConfig(
    sample_rate_hz=PIEZO_HZ,
    channels=4,
    passband_hz=(60.0, 0.0),
    passband_degree=2,
    stopbands_hz=(),
    exponent=1,
    gain=1.0,
)
NOISE_V = np.array([0.01, 0.03, 0.1, 0.02])


def noise(rows=10_000, seed=0):
    return NOISE_V * np.random.default_rng(seed).standard_normal((rows, 4))


def rest(volts, truth=None, rate_hz=PIEZO_HZ):
    truth = np.zeros(len(volts), bool) if truth is None else truth
    return track_of('rest', [Samples.evenly(volts, rate_hz, truth)], rate_hz)


def hum(mains_hz, rows, rate_hz, amplitudes):
    time_s = np.arange(rows)[:, np.newaxis] / rate_hz
    return sum(
        amplitude * np.sin(2 * np.pi * harmonic * mains_hz * time_s + harmonic)
        for harmonic, amplitude in amplitudes.items()
    )


@pytest.mark.parametrize('window_rows', [1, 3, 16, 90])
def test_at_the_floors_that_are_learnt_noise_makes_no_evidence(window_rows):
    chain = dataclasses.replace(PIEZO, envelope_window_s=window_rows / PIEZO_HZ)
    floors = learnt_floors(chain, [rest(noise(20_000))])
    chain = dataclasses.replace(
        chain,
        decision='evidence',
        noise_floor=floors,
        noise_floor_learnt=True,
        noise_floor_range_db=15.0,
        evidence_offset_db=0.5,
    )
    result = SlipChain(chain).update(noise(20_000, seed=1), excess=True)
    excess_db = result.excess[1000:].mean(axis=0)
    assert -5.0 < excess_db.min() <= excess_db.max() < 0.0
    # An offset of half of what is usual is enough.
    chain = dataclasses.replace(chain, evidence_offset_db=1.75)
    level = SlipChain(chain).update(noise(20_000, seed=1), level=True).level
    assert level.max() < 0.5 * chain.evidence_limit_db_s


def test_slips_and_bad_channels_take_no_part_in_the_floors():
    quiet, loud = noise(), noise()
    truth = np.zeros(len(loud), bool)
    truth[4000:7000] = True
    loud[truth] *= 50.0
    plain = np.array(learnt_floors(PIEZO, [rest(quiet)]))
    np.testing.assert_allclose(learnt_floors(PIEZO, [rest(loud, truth)]), plain, rtol=0.05)
    quiet[:, 1] = np.nan
    found = learnt_floors(PIEZO, [rest(quiet)])
    assert found[1] == pytest.approx(np.median(plain[[0, 2, 3]]), rel=1e-3)
    np.testing.assert_allclose(np.delete(found, 1), np.delete(plain, 1), rtol=1e-9)


def test_floors_come_from_all_recordings_and_cuts_change_nothing():
    volts = noise()
    truth = np.zeros(5000, bool)
    pieces = [Samples.evenly(part, PIEZO_HZ, truth) for part in np.split(volts, 2)]
    whole = learnt_floors(PIEZO, [rest(volts)])
    assert learnt_floors(PIEZO, [track_of('rest', pieces, PIEZO_HZ)]) == whole
    louder = learnt_floors(PIEZO, [rest(volts), rest(10.0 * noise(seed=1))])
    assert all(many > one for many, one in zip(louder, whole, strict=True))


def test_where_nothing_makes_noise_there_is_no_floor():
    with pytest.raises(ValueError, match='rest: no channel has any noise, allowed: a recording'):
        learnt_floors(PIEZO, [rest(np.full((3000, 4), 4.3))])


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
    found = find_mains(PIEZO, rest(volts, rate_hz=rate_hz))
    assert found.mains_hz == mains_hz
    for line in found.lines:
        harmonic = line.hum_hz / mains_hz
        assert harmonic in harmonics or any(
            abs(line.hum_hz - rate_hz * k) == pytest.approx(one * mains_hz)
            or abs(line.hum_hz - rate_hz * k) == pytest.approx(abs(one * mains_hz - rate_hz * j))
            for one in harmonics
            for k in range(8)
            for j in range(8)
        )
        assert line.least_db > LEAST_LINE_DB
        assert 0.0 < line.seen_hz <= rate_hz / 2


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_noise_has_no_mains_nor_has_a_line_that_one_channel_lacks(seed):
    volts = noise(6000, seed)
    assert find_mains(PIEZO, rest(volts)).mains_hz == 0.0
    volts[:, :3] += hum(50.0, 6000, PIEZO_HZ, {1: 0.5})
    assert find_mains(PIEZO, rest(volts)).mains_hz == 0.0
    without = dataclasses.replace(PIEZO, disabled_channels=(4,))
    assert find_mains(without, rest(volts)).mains_hz == 50.0


@pytest.mark.parametrize('common_mode', ['median', 'mean'])
def test_hum_that_is_taken_off_as_common_mode_is_no_line(common_mode):
    chain = dataclasses.replace(PIEZO, common_mode=common_mode)
    same = hum(50.0, 6000, PIEZO_HZ, {1: 0.5})
    baselines_v = np.arange(4.0)
    assert find_mains(chain, rest(baselines_v + noise(6000) + same)).mains_hz == 0.0
    different = same * [1.0, 2.0, 4.0, 8.0]
    assert find_mains(chain, rest(baselines_v + noise(6000) + different)).mains_hz == 50.0


def test_what_is_flat_has_no_mains():
    for chain in (PIEZO, dataclasses.replace(PIEZO, common_mode='median')):
        assert find_mains(chain, rest(np.full((6000, 4), 4.3))).mains_hz == 0.0


def test_a_recording_too_short_for_a_spectrum_has_no_mains():
    volts = hum(50.0, 2000, PIEZO_HZ, {1: 0.5}) + noise(2000)
    assert find_mains(PIEZO, rest(volts)).mains_hz == 0.0


def test_of_many_short_recordings_each_takes_part_in_the_floors():
    chain = dataclasses.replace(PIEZO, passband_hz=(7.0, 50.0), passband_degree=4)
    short = [rest(noise(400, seed)) for seed in range(900)]
    whole = learnt_floors(chain, [rest(noise(60_000))])
    np.testing.assert_allclose(learnt_floors(chain, short), whole, rtol=0.1)


def recording(volts, name='knocks', slip=False):
    return track_of(name, [Samples.evenly(volts, RATE_HZ, np.full(len(volts), slip))], RATE_HZ)


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
    pieces = [
        Samples.evenly(volts[:10], PIEZO_HZ, truth),
        Samples.evenly(volts[10:], PIEZO_HZ, truth, new_stretch=True),
    ]
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
