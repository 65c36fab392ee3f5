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

"""Baselines, huge values and bad samples: what they leave behind in the chain."""

import numpy as np
import pytest
from chain.chain_cases import noise

from slip_detector.chain.filters import design, largest_pole_radius
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters import COMMON_MODES, ChainConfig

# --- baselines and huge values -------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_a_constant_baseline_gives_no_level_from_the_first_row(common_mode):
    volts = np.full((200, 16), 4.3)
    volts[:, 3:9] = [-1.7, 0.1, 3.3, 1e3, -1e8, 0.0]
    result = SlipChain(ChainConfig(common_mode=common_mode)).update(volts)
    assert not result.level.any()
    assert not result.envelope.any()
    assert not result.slip.any()


@pytest.mark.parametrize('stopbands', [(), ((0.5, 7.0), (50.0, 180.0))])
@pytest.mark.parametrize('common_mode', ['none', 'mean'])
def test_a_huge_pulse_leaves_no_trace(stopbands, common_mode):
    config = ChainConfig(channels=2, stopbands_hz=stopbands, common_mode=common_mode)
    # By then the answer to the pulse is below 1e-12, with a factor of 1e6 for the network's gain
    # and for poles that lie together.
    forgotten = 1e-12 / (1e6 * config.gain * 1e6)
    after = int(np.log(forgotten) / np.log(largest_pole_radius(design(config))))
    windows = config.samples(config.envelope_window_s) + config.samples(config.decision_window_s)
    volts = 0.1 * noise(15, 20 + after + windows + 100, 2)
    calm = SlipChain(config).update(volts)
    hit = volts.copy()
    hit[15:20, 0] += 1e6
    shaken = SlipChain(config).update(hit)
    assert shaken.level[40, 0] > 1e15 * calm.level.max()
    end = slice(20 + after + windows, None)
    assert calm.level[end].min() > 1e-3
    # The filters are linear and have forgotten; what is left is each row's own rounding.
    assert np.allclose(shaken.level[end], calm.level[end], rtol=1e-9, atol=0.0)
    assert np.array_equal(shaken.flags[end], calm.flags[end])
