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

"""The parameters of chain and detector: what the defaults are made of."""

import pytest

from slip_detector.parameters.detector import ChainConfig


def test_names_are_ch1_and_on_unless_given():
    assert ChainConfig(channels=3).names == ('ch1', 'ch2', 'ch3')
    assert ChainConfig(channels=2, channel_names=('left', 'right')).names == ('left', 'right')


def test_groups_are_table_1_for_16_channels_and_one_for_any_other_number():
    table_1 = {
        'TP': (14, 16, 11, 9),
        'TD': (1, 3, 8, 6),
        'LR': (5, 7, 12, 10),
        'LU': (2, 4, 15, 13),
    }
    assert ChainConfig().groups == table_1
    assert ChainConfig(channels=5).groups == {'all': (1, 2, 3, 4, 5)}


def test_default_groups_leave_out_disabled_channels_and_emptied_groups():
    config = ChainConfig(disabled_channels=(14, 1, 3, 8, 6))
    assert config.groups == {'TP': (16, 11, 9), 'LR': (5, 7, 12, 10), 'LU': (2, 4, 15, 13)}
    assert ChainConfig(channels=3, disabled_channels=[2]).groups == {'all': (1, 3)}


@pytest.mark.parametrize(
    ('seconds', 'samples'), [(0.0, 1), (0.001, 1), (0.0149, 1), (0.0151, 2), (1.0, 100)]
)
def test_a_time_is_rounded_to_samples_and_at_least_one(seconds, samples):
    config = ChainConfig(sample_rate_hz=100.0, stopbands_hz=(), passband_hz=(7, 45))
    assert config.samples(seconds) == samples


def test_a_single_noise_floor_is_that_of_every_channel():
    one = ChainConfig(channels=3, decision='evidence', noise_floor=0.25)
    assert one.noise_floors == (0.25, 0.25, 0.25)
    several = ChainConfig(channels=3, decision='evidence', noise_floor=[0.25, 1, '5e-1'])
    assert several.noise_floors == (0.25, 1.0, 0.5)
