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

"""Memory that is known before it is taken."""

import dataclasses
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain import memory
from slip_detector.chain.memory import check_memory, machine_bytes, state_shape
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig


@given(
    st.integers(1, 60),
    st.floats(0.01, 0.5),
    st.floats(0.01, 0.5),
    st.sampled_from([0.0, 50.0]),
    st.sampled_from(['mean', 'evidence']),
)
def test_the_state_has_the_shape_that_was_foretold(channels, envelope_s, mean_s, mains_hz, what):
    config = ChainConfig(
        channels=channels,
        envelope_window_s=envelope_s,
        decision_window_s=mean_s,
        mains_hz=mains_hz,
        decision=what,
        noise_floor=1e-3,
    )
    assert SlipChain(config).state.shape == state_shape(config)


def test_windows_beyond_the_memory_are_refused_with_the_numbers_before_any_is_taken():
    config = ChainConfig(sample_rate_hz=5e4, channels=10_000, envelope_window_s=60.0)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match='parameter channels is 10000: ') as refusal:
            SlipChain(config)
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()
    for words in ('windows of 60 s and 0.04 s at 50000 Hz', '240 GB', 'allowed: '):
        assert words in str(refusal.value)


def test_rows_that_are_kept_count_too(monkeypatch):
    config = ChainConfig()
    state = 8 * 16 * state_shape(config)[1]
    kept = 8 * 16 * 1900
    monkeypatch.setattr(memory, 'machine_bytes', lambda: (state + kept) / memory.SHARE)
    check_memory(config, kept_s=5.0)
    with pytest.raises(ValueError, match='GB of memory'):
        check_memory(dataclasses.replace(config, envelope_window_s=0.05), kept_s=5.0)


def test_a_container_may_have_less_than_the_machine(monkeypatch, tmp_path):
    for text, least in (('max', None), ('1000000', 1_000_000)):
        (tmp_path / 'memory.max').write_text(f'{text}\n')
        monkeypatch.setattr(memory, 'CONTAINER_LIMITS', (tmp_path / 'memory.max',))
        assert (machine_bytes() == 1_000_000) == bool(least)
