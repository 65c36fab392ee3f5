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

"""What a report draws of a channel beside its volts."""

import dataclasses

import numpy as np
import pytest

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.report.signal_codes import (
    THRESHOLD_CODE,
    level_codes,
    ranges_db,
    signal_codes,
    signals_of,
)
from support import report_scenes as scenes

CONFIG = scenes.THREE_CHANNELS


def test_codes_are_above_the_threshold_where_and_only_where_the_channel_is_on():
    time_s = np.arange(1000) / CONFIG.sample_rate_hz
    burst = 0.02 * np.sin(2 * np.pi * 20.0 * time_s) * (time_s % 2.0 > 1.2)
    volts = 4.0 + burst[:, None] + 1e-4 * np.random.default_rng(0).standard_normal((1000, 3))
    volts[300, 0] = np.nan
    result = SlipChain(CONFIG).update(volts)
    codes = level_codes(result, CONFIG.threshold)
    assert result.channels.any()
    np.testing.assert_array_equal(codes > THRESHOLD_CODE, result.channels & result.valid)
    np.testing.assert_array_equal(codes == 0, ~result.valid)
    between = (codes > 1) & (codes < 255)
    octaves = np.log2(result.level[between] / CONFIG.threshold)
    assert np.all(
        np.abs((codes[between].astype(float) - THRESHOLD_CODE) / 16.0 - octaves) <= 1 / 16
    )
    # The level is all there is of a decision by the mean.
    assert signals_of(CONFIG) == ('level',)
    np.testing.assert_array_equal(signal_codes(result, CONFIG), codes)


@pytest.mark.parametrize('range_db', [0.0, 15.0])
def test_of_evidence_excess_and_floor_stand_beside_the_level(range_db):
    config = dataclasses.replace(scenes.EVIDENCE, noise_floor_range_db=range_db)
    volts, _ = scenes.tapped()
    volts[100:120, 3] = np.nan
    result = SlipChain(config).update(volts, floor=True, excess=True)
    level, excess, floor = np.split(signal_codes(result, config), 3, axis=1)
    assert signals_of(config) == ('level', 'excess', 'floor')
    on = result.channels & result.valid
    np.testing.assert_array_equal(level > THRESHOLD_CODE, on)
    for codes, values, name in ((excess, result.excess, 'excess'), (floor, result.floor, 'floor')):
        np.testing.assert_array_equal(codes == 0, ~result.valid)
        low, high = ranges_db(config)[name]
        decibels = low + (codes - 1.0) / 254 * (high - low)
        within = 0.51 * (high - low) / 254 + 1e-9
        assert np.abs(decibels - values)[result.valid].max() <= within
    assert excess.max() == 255
