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

"""Decisions that mean nothing are found, and those that mean something are left alone."""

import numpy as np
import pytest

from slip_detector.chain.live_chain import Watch
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

RATE = 380
PLAIN = {'passband_hz': (20.0, 0.0), 'stopbands_hz': (), 'gain': 1.0, 'exponent': 1, 'vote': 2}
EVIDENCE = {**PLAIN, 'decision': 'evidence', 'noise_floor': 1.0}
LEARNT = {**EVIDENCE, 'noise_floor_learnt': True, 'noise_floor_range_db': 15.0}


def noise(seconds=12, size=1.0):
    return size * np.random.default_rng(0).standard_normal((seconds * RATE, 3))


def found(rows, **parameters):
    """Return what is found at last, the third channel being disabled."""
    chain = SlipChain(ChainConfig(channels=3, disabled_channels=[3], **parameters))
    watch, last = Watch(chain), {}
    for second in np.split(rows, len(rows) // RATE):  # In two pieces.
        last = watch.look([(piece, chain.update(piece)) for piece in np.array_split(second, 2)])
    return last


@pytest.mark.parametrize(
    ('parameters', 'size', 'kinds'),
    [
        (EVIDENCE, 1.0, []),
        (EVIDENCE, 2000.0, ['upper']),
        (EVIDENCE, 0.005, ['lower']),
        (LEARNT, 1.0, []),
        (LEARNT, 0.2, []),
        ({**LEARNT, 'noise_floor': ()}, 2000.0, []),
        ({**LEARNT, 'envelope_window_s': 1 / RATE}, 1.0, []),
        ({**LEARNT, 'noise_floor_rate_db_s': 10.0}, 20.0, ['upper']),
        ({**LEARNT, 'noise_floor_range_db': 0.0}, 20.0, []),
        ({**EVIDENCE, 'contact_level_v': 1e9, 'contact_channels': 1}, 2000.0, []),
    ],
)
def test_a_floor_that_cannot_follow_the_noise_is_found(parameters, size, kinds):
    assert found(noise(size=size), **parameters) == {kind: [0, 1] for kind in kinds}


def test_what_is_on_for_a_minute_without_a_pause_is_found():
    rows = noise(62)
    assert found(rows[: 59 * RATE], **PLAIN, threshold=1e-6) == {}
    assert found(rows, **PLAIN, threshold=1e-6) == {'slip': [0]}
    rows[:, 1] = 0.0  # One channel alone is not enough for the vote.
    assert found(rows, **PLAIN, threshold=1e-6, flat_after_s=0.0) == {'channels': [0]}
    rows[40 * RATE : 41 * RATE] = 0.0
    assert found(rows, **PLAIN, threshold=1e-6) == {}


@pytest.mark.parametrize('step', [0.0, 0.05, 0.3, 1.0])
def test_a_channel_that_is_cut_off_is_found_and_a_coarse_converter_is_none(step):
    rows = np.round(noise() / step) * step if step else noise()
    assert found(rows) == {}
    rows[:, 1] = np.minimum(rows[:, 1], 1.2)
    rows[:, 2] = np.minimum(rows[:, 2], 1.2)  # It is disabled.
    assert found(rows) == ({'cut off': [1]} if step < 0.3 else {})
    held = np.repeat(np.arange(12), RATE)[:, None] % 3 + 0.0 * rows  # Rests at its extremes.
    assert found(held, flat_after_s=0.0) == {}
