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

"""Sets of parameters, as services and programs give them."""

import pytest
from fuzz.fuzzing import STRANGE, fuzz, some_values
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain, check_memory
from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig
from support.config_cases import SETS

#: For how many channels and rows a chain is built.
MOST_CHANNELS, MOST_ROWS = 64, 100_000


@st.composite
def parameters(draw):
    config_class = draw(st.sampled_from(SETS))
    values = draw(some_values(config_class, most=5))
    if config_class is DetectorConfig and draw(st.integers(0, 3)) == 0:
        values[f'groups.{draw(st.text(max_size=3))}'] = draw(STRANGE)
    if draw(st.integers(0, 9)) == 0:
        values[draw(st.text(max_size=8))] = draw(STRANGE)
    return config_class, values


def check(case):
    """What is taken says the same after any way out and in, and a chain of it runs."""
    config_class, values = case
    config = config_class.from_parameters(values)
    assert config_class.from_parameters(config.to_parameters()) == config
    if not isinstance(config, ChainConfig) or config.channels > MOST_CHANNELS:
        return
    check_memory(config, 5.0)
    window_s = config.envelope_window_s + config.decision_window_s
    if window_s * config.sample_rate_hz <= MOST_ROWS:
        assert len(SlipChain(config).update([[4.3] * config.channels] * 3).slip) == 3


CORPUS = [
    (DetectorConfig, {'groups': True}),
    (DetectorConfig, {'disabled_channels': [1] * 1_000_000}),
    (DetectorConfig, {'channels': 50_000, 'channel_names': [f'c{k}' for k in range(50_000)]}),
    (DetectorConfig, {'channel_names': ['a'] * 50_000}),
    (DetectorConfig, {'envelope_window_s': 1e300}),
    (DetectorConfig, {'sample_rate_hz': 1e-300}),
    (DetectorConfig, {'threshold': [1] * 1_000_000}),
    (DetectorConfig, {'a' * 100_000: 1}),
    (DetectorConfig, {'\u2028': 1}),
    (DriverConfig, {'udp_senders': ['']}),
]


@pytest.mark.filterwarnings('ignore:overflow:RuntimeWarning')
def test_any_set_is_taken_whole_or_refused_in_one_line():
    fuzz(parameters(), check, corpus=CORPUS, few=60, refusal='allowed|mean')
