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

"""Any configuration is made to fit any sensor, at once, and what fits stays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.fitting import fitting
from support.random_chains import configs


@given(configs(), st.integers(1, 70), st.floats(1.0, 1e6), st.sampled_from([(), ('no name',)]))
def test_any_configuration_fits_any_sensor_when_all_is_set_at_once(
    chain, channels, rate_hz, names
):
    config = chain.with_values(fitting(chain, channels, rate_hz, names))
    assert (config.channels, config.sample_rate_hz) == (channels, pytest.approx(rate_hz, rel=0.02))
    assert fitting(config, channels, rate_hz, names) == {}


def test_what_fits_stays_and_what_was_given_for_each_channel_is_dropped():
    evidence = {'decision': 'evidence', 'noise_floor': [2e-3, 1e-3], 'noise_floor_learnt': True}
    sensor = {'channel_names': ['a', 'b'], 'disabled_channels': [2], 'mains_hz': 50.0}
    config = DetectorConfig(channels=2, **sensor, taxel_positions_m=[0.0] * 6, **evidence)
    wanted = {'channels': 6, 'vote': 2, 'groups.all': [1, 2, 3, 4, 5, 6]}
    wanted |= {'noise_floor': [], 'noise_floor_learnt': False}
    assert fitting(config, 6, 380.0) == wanted
    fits = config.with_values(wanted)
    assert fits.channel_names == fits.disabled_channels == fits.taxel_positions_m == ()
    # At this rate there are no whole mains periods, and the bands do not fit.
    low = {'sample_rate_hz': 33.0, 'passband_hz': [11.0, 0.0], 'stopbands_hz': [], 'mains_hz': 0.0}
    unnamed = [f'ch{channel}' for channel in range(1, 17)]
    assert fitting(ChainConfig(mains_hz=60.0), 16, 33.1, unnamed) == low
