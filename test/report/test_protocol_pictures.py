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

"""What is drawn of the paper's protocol is what the chain made of it."""

import numpy as np
import pytest

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.protocol import SCENES, simulate_trials
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.protocol_pictures import stage_signals


@pytest.mark.parametrize(
    'changes', [{}, {'exponent': 2, 'rectify': 'half', 'common_mode': 'median'}]
)
def test_the_stages_that_are_drawn_are_those_of_the_chain(changes):
    config = ChainConfig(**changes)
    (trial,) = simulate_trials(SCENES['400'], [0])
    raw, _, power, envelope, level = stage_signals(trial, config, 5).values()
    result = SlipChain(config).update(trial.volts)
    np.testing.assert_array_equal(raw, trial.volts[:, 4])
    np.testing.assert_array_equal(level, result.level[:, 4])
    window = np.full(15, 1 / 15)  # 40 ms
    rms = np.sqrt(np.convolve(power**2, window)[: len(power)])
    np.testing.assert_allclose(rms, envelope, rtol=1e-6, atol=1e-9 * envelope.max())


def test_of_evidence_the_floor_and_the_excess_are_drawn_too():
    config = ChainConfig(
        decision='evidence', noise_floor=1e-3, exponent=1, mains_hz=50.0, impact_v=0.1
    )
    (trial,) = simulate_trials(SCENES['400'], [0])
    signals = stage_signals(trial, config, 5)
    _, _, power, envelope, floor, excess, level = signals.values()
    result = SlipChain(config).update(trial.volts, floor=True, excess=True)
    for drawn, wanted in ((floor, result.floor), (excess, result.excess), (level, result.level)):
        np.testing.assert_array_equal(drawn, wanted[:, 4])
    window = np.full(15, 1 / 15)
    rms = np.sqrt(np.convolve(power**2, window)[: len(power)])
    np.testing.assert_allclose(rms, envelope, rtol=1e-6, atol=1e-9 * envelope.max())
    assert list(signals)[-1] == 'evidence\n[dB s]'
