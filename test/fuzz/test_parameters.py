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
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain, check_memory
from slip_detector.parameters import (
    DetectorConfig,
    DriverConfig,
    EvaluationConfig,
    GraspConfig,
    TuneConfig,
)
from support.fuzzing import fuzz
from support.mutations import STRANGE, some_values

SETS = {
    config.NODE: config
    for config in (DetectorConfig, DriverConfig, EvaluationConfig, GraspConfig, TuneConfig)
}

#: For how many channels and rows a chain is built.
MOST_CHANNELS, MOST_ROWS = 64, 100_000


@st.composite
def parameters(draw):
    node = draw(st.sampled_from(list(SETS)))
    values = draw(some_values(SETS[node], most=5))
    if node == 'slip_detector' and draw(st.integers(0, 3)) == 0:
        values[f'groups.{draw(st.text(max_size=3))}'] = draw(STRANGE)
    if draw(st.integers(0, 9)) == 0:
        values[draw(st.text(max_size=8))] = draw(STRANGE)
    return node, values


def check(case):
    """What is taken says the same after any way out and in, and a chain of it runs."""
    node, values = case
    config = SETS[node].from_parameters(values)
    assert SETS[node].from_parameters(config.to_parameters()) == config
    if node != 'slip_detector' or config.channels > MOST_CHANNELS:
        return
    check_memory(config, 5.0)
    window_s = config.envelope_window_s + config.decision_window_s
    if window_s * config.sample_rate_hz <= MOST_ROWS:
        result = SlipChain(config).update([[4.3] * config.channels] * 3)
        assert result.slip.shape == (3,)


CORPUS = [
    ('slip_detector', {'groups': True}),
    ('slip_detector', {'disabled_channels': [1] * 1_000_000}),
    ('slip_detector', {'channels': 50_000, 'channel_names': [f'c{k}' for k in range(50_000)]}),
    ('slip_detector', {'channel_names': ['a'] * 50_000}),
    ('slip_detector', {'envelope_window_s': 1e300}),
    ('slip_detector', {'sample_rate_hz': 1e-300}),
    ('slip_detector', {'threshold': [1] * 1_000_000}),
    ('slip_detector', {'a' * 100_000: 1}),
    ('slip_detector', {'\u2028': 1}),
    ('slip_driver', {'udp_senders': ['']}),
]


@pytest.mark.filterwarnings('ignore:overflow:RuntimeWarning')
def test_any_set_is_taken_whole_or_refused_in_one_line():
    fuzz(parameters(), check, corpus=CORPUS, few=60, refusal='allowed|mean')
