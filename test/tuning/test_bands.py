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

"""The bands in which slides stand out from rest are found where they are."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.tuning.learning import learn
from slip_detector.tuning.measuring import slip_bands
from support.tuning_cases import CHAIN, RATE_HZ, track_with

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
        (np.arange(6000) % 400 >= 380, 'slides are too short to measure where they stand out'),
        (np.ones(6000, bool), 'there is too little rest to measure where slides stand out'),
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
