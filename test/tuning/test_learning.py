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

"""What is learnt: thresholds of quiet recordings for a rate of false alarms, bands of slides."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.evaluation.replay import Replay
from slip_detector.tuning.learning import learn, learn_threshold
from slip_detector.tuning.measuring import slip_bands
from support.tuning_cases import CHAIN, EVIDENCE, RATE_HZ, track, track_with

SURE = dataclasses.replace(EVIDENCE, evidence_offset_db=4.0)


def alarms_at(chain, recording):
    replay = Replay(chain)
    return len(replay.run(recording.rows(), recording.sample_rate_hz).alarms)


@pytest.mark.parametrize(('chain', 'vote'), [(CHAIN, 'all'), (SURE, 1)])
def test_the_rate_holds_in_the_recording_and_in_another_but_not_below_the_threshold(chain, vote):
    chain = dataclasses.replace(chain, vote=vote)
    recording = track(1, duration_s=600.0, slips=False)
    threshold, line = learn_threshold(recording, chain, 60.0)
    found = dataclasses.replace(chain, threshold=threshold)
    alarms = alarms_at(found, recording)
    assert f', {alarms} false alarms in 0.167 h: ' in line
    upper = float(line.split(' to ')[1].split(' an hour')[0])
    assert alarms / (1 / 6) <= upper <= 60.0
    other = track(2, duration_s=600.0, slips=False)
    assert alarms_at(found, other) <= 2 * 10
    lower = dataclasses.replace(found, threshold=threshold / 1.5)
    assert alarms_at(lower, recording) / (1 / 6) > 60.0


def test_a_recording_that_cannot_show_the_rate_is_refused():
    minute = track(5, duration_s=60.0, slips=False)
    noisy = dataclasses.replace(SURE, noise_floor=(1e-6,), noise_floor_range_db=10.0)
    silent = track_with(np.zeros((4560, 4)), name='seed 5')
    for recording, chain, per_hour, line in (
        (minute, CHAIN, 100.0, '5: lasts 0.0167 h, allowed: no slip, and at least 0.03 h to show'),
        (track(6), CHAIN, 1000.0, '6: has slip, allowed: no slip'),
        (minute, noisy, 200.0, '5: no threshold has that rate'),
        (silent, CHAIN, 1000.0, '5: no threshold has that rate'),
    ):
        with pytest.raises(ValueError, match=f'^seed {line}'):
            learn_threshold(recording, chain, per_hour)


def test_where_rest_makes_no_evidence_the_given_threshold_stays():
    surer = dataclasses.replace(SURE, noise_floor=(1.0,))
    found = learn_threshold(track(5, duration_s=60.0, slips=False), surer, 200.0)
    line = '0 false alarms in 0.0167 h: 0 to 180 an hour at 95% confidence'
    assert found == (surer.threshold, f'threshold {surer.threshold:g}, {line}')


SLIDING = np.arange(6000) % 1000 >= 600
SEEDS = st.integers(0, 2**32 - 1)


def noise(seed, low_hz=0.0, high_hz=RATE_HZ):
    """Return noise of an RMS of 1 between two frequencies, on four channels."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal((6000, 4)), axis=0)
    hz = np.fft.rfftfreq(6000, 1.0 / RATE_HZ)
    spectrum[(hz < low_hz) | (hz > high_hz)] = 0.0
    rows = np.fft.irfft(spectrum, 6000, axis=0)
    return rows / rows.std()


def slides(seed, low_hz, high_hz):
    volts = 4.3 + 0.05 * noise(seed)
    volts[SLIDING] += 0.2 * noise(seed + 1, low_hz, high_hz)[SLIDING]
    return track_with(volts, SLIDING)


@settings(max_examples=20, deadline=None)
@given(low_hz=st.floats(10.0, 90.0), octaves=st.floats(0.7, 3.0), seed=SEEDS)
def test_the_narrowest_band_is_that_of_the_slides_within_half_an_octave(low_hz, octaves, seed):
    highest_hz = 0.48 * RATE_HZ
    high_hz = min(low_hz * 2**octaves, highest_hz)
    bands, line = slip_bands(CHAIN, [slides(seed, low_hz, high_hz)])
    found_hz = bands[-1][0], bands[-1][1] or highest_hz
    assert np.abs(np.log2(np.divide(found_hz, (low_hz, high_hz)))).max() < 0.6
    assert f'stand out from rest at {bands[-1][0]:g} ' in line
    assert bands == sorted(bands, key=lambda band: band[0])


def test_noise_alone_has_no_band_however_few_its_spectra_are():
    for labels in (SLIDING, np.arange(6000) % 400 >= 300):
        tracks = [track_with(noise(seed), labels) for seed in range(20)]
        assert sum(bool(slip_bands(CHAIN, [track])[0]) for track in tracks) <= 1
    for labels, why in (
        (np.arange(6000) % 400 >= 380, 'Slides are too short to measure where they stand out'),
        (np.ones(6000, bool), 'There is too little rest to measure where slides stand out'),
    ):
        assert slip_bands(CHAIN, [track_with(noise(1), labels)]) == ([], why)


def test_a_pass_band_above_the_slides_and_a_lack_of_rest_are_said():
    tracks = [slides(1, 5.0, 12.0)]
    assert learn(CHAIN, tracks, observe=lambda step: None)[1][1:] == [
        'The given pass-band begins above them, at 20 Hz',
        'No noise learnt: there is no recording without slips',
    ]
    tracks.append(track_with(0.05 * noise(2), name='still', kind='rest'))
    lines = learn(CHAIN, tracks, observe=lambda step: None)[1]
    assert 'On still: no line of the mains' in lines[2]
