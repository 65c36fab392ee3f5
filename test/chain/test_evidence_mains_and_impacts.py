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

"""What is taken from the channels before evidence is gathered: mains and impacts."""

import dataclasses

import numpy as np

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig
from support.chain_cases import noise, quick_evidence, tone

KEPT = {'floor': True, 'excess': True}


def test_the_comb_takes_the_mains_and_all_its_harmonics_off():
    config = quick_evidence(
        sample_rate_hz=380.0, mains_hz=50.0, passband_hz=(20.0, 0.0), passband_degree=2
    )
    rows = np.arange(1000) / 380.0
    hum = sum(np.sin(2 * np.pi * (50 * k * rows + 0.1 * k)) for k in range(1, 12))
    result = SlipChain(config).update(4 + np.repeat(hum[:, None], 4, axis=1))
    assert result.envelope.max() < 1e-11
    without = SlipChain(dataclasses.replace(config, mains_hz=0.0)).update(
        4 + np.repeat(hum[:, None], 4, axis=1)
    )
    assert without.envelope[500:].min() > 0.5


def test_the_comb_serves_the_mean_too():
    config = ChainConfig(mains_hz=50.0)
    rows = np.arange(1000) / 380.0
    hum = 0.5 * np.sin(2 * np.pi * 50 * rows)[:, None]
    assert SlipChain(config).update(np.repeat(hum, 16, axis=1)).level.max() < 1e-30
    assert SlipChain(ChainConfig()).update(np.repeat(hum, 16, axis=1)).level.max() > 0.5


def test_an_impact_holds_the_excess_of_all_channels_at_0_for_its_time():
    config = quick_evidence(impact_v=5.0, impact_hold_s=0.1, noise_floor_learnt=True)
    volts = tone(300)
    volts[100:, [0, 3]] += 8.0  # a step on two channels
    volts[200:, 1] -= 8.0  # and one on one, which is none
    result = SlipChain(config).update(volts, **KEPT)
    held = slice(100, 140)
    assert np.flatnonzero(result.after_impact).tolist() == list(range(*held.indices(300)))
    assert (result.excess[held] == 0).all()
    assert (result.excess[140:] > 0).all()
    assert (np.diff(result.level[99:140], axis=0) < 0).all()


def test_an_impact_within_the_time_of_another_prolongs_it():
    config = quick_evidence(impact_v=5.0, impact_hold_s=0.1)
    volts = 0.1 * noise(6, 300, 4)
    volts[100:130] += 8.0
    result = SlipChain(config).update(volts, **KEPT)
    assert np.flatnonzero(result.after_impact).tolist() == list(range(100, 170))


def test_a_step_over_bad_samples_counts_where_the_channel_is_good_again():
    config = quick_evidence(impact_v=5.0, impact_hold_s=0.0)
    volts = 0.1 * noise(7, 60, 4)
    volts[20:] += 8.0
    volts[20:30, :3] = np.nan
    result = SlipChain(config).update(volts, **KEPT)
    assert np.flatnonzero(result.after_impact).tolist() == [30]


def test_disabled_channels_make_no_impact():
    config = quick_evidence(impact_v=5.0, disabled_channels=(1, 2), groups={})
    volts = 0.1 * noise(7, 60, 4)
    volts[20:, :3] += 8.0
    assert not SlipChain(config).update(volts, **KEPT).after_impact.any()
