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

"""What the chain takes and gives, the memory of a call, and what a chain takes over of another."""

import dataclasses

import numpy as np
import pytest
from chain.chain_cases import QUICK_EVIDENCE, bits, noise
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain import layout, slip_chain
from slip_detector.chain.slip_chain import SlipChain, check_memory
from slip_detector.parameters.detector import ChainConfig
from support.config_cases import message_of

# --- input and output ----------------------------------------------------------------------


@pytest.mark.parametrize('shape', [(3, 5), (0, 15), (16,), (1, 2, 16)])
def test_a_wrong_shape_is_an_error_that_names_both_shapes(shape):
    chain = SlipChain()
    message = message_of(chain.update, np.zeros(shape))
    assert message == f'volts has the shape {shape}, allowed: (any, 16)'
    # And nothing happened to the chain.
    rows = noise(28, 40, 16)
    assert bits(chain.update(rows)) == bits(SlipChain().update(rows))


@pytest.mark.parametrize('channels', [3, 16, 20])
def test_each_signal_is_kept_when_it_is_wanted_and_its_absence_is_an_error(channels):
    config = dataclasses.replace(QUICK_EVIDENCE, channels=channels, groups={}, impact_v=2.0)
    names = ('envelope', 'level', 'floor', 'excess')
    volts = noise(29, 60, channels)
    whole = SlipChain(config).update(volts, floor=True, excess=True, votes=['all', 2])
    for wanted in range(16):
        kept = {name: bool(wanted >> i & 1) for i, name in enumerate(names)}
        result = SlipChain(config).update(volts, **kept, votes=['all', 2])
        for name in ('flags', 'vote_statistic', *(name for name in names if kept[name])):
            assert np.array_equal(getattr(result, name), getattr(whole, name)), name
        for name in [name for name in names if not kept[name]]:
            assert f'call update with {name}=True' in message_of(getattr, result, name)
    message = message_of(SlipChain().update, np.zeros((1, 16)), floor=True)
    assert message == 'floor and excess are not kept, allowed: with decision: evidence'


INPUTS = {
    'big endian': lambda volts: volts.astype('>f8'),
    'lists': lambda volts: volts.tolist(),
    'not aligned': lambda volts: np.ndarray(
        volts.shape, np.float64, b'    ' + volts.tobytes(), offset=4
    ),
    'read-only': lambda volts: np.frombuffer(volts.tobytes()).reshape(volts.shape),
}


@pytest.mark.parametrize('made', INPUTS.values(), ids=INPUTS)
def test_any_kind_of_numbers_is_taken(made):
    # Small whole numbers are the same in every type.
    volts = np.random.default_rng(31).integers(0, 100, (70, 16)).astype(np.float64)
    assert bits(SlipChain().update(made(volts))) == bits(SlipChain().update(volts))


# --- memory --------------------------------------------------------------------------------


def test_windows_beyond_the_memory_are_refused_before_any_is_taken(monkeypatch):
    config = ChainConfig(channels=1_000_000, envelope_window_s=60.0, decision_window_s=60.0)
    message = message_of(SlipChain, config)
    assert message.startswith(
        'parameter channels is 1000000: with these windows and this rate they'
    )
    assert 'take 365 GB of memory, allowed: ' in message
    # Rows that are kept count too.
    check_memory(ChainConfig(), kept_s=5.0)
    monkeypatch.setattr(slip_chain, 'MEMORY_SHARE', 0.0)
    assert 'allowed: 0 GB' in message_of(check_memory, ChainConfig(), kept_s=5.0)


# --- what is taken over --------------------------------------------------------------------


CONFIG = ChainConfig(
    sample_rate_hz=400.0,
    channels=5,
    passband_hz=(20.0, 100.0),
    stopbands_hz=((45.0, 55.0),),
    valid_range_v=(-10.0, 10.0),
    envelope_window_s=0.02,
    decision_window_s=0.03,
)
ONE_SAMPLE = {'envelope_window_s': 1 / 400.0, 'decision_window_s': 1 / 400.0}


@given(
    st.integers(0, 150),
    st.sampled_from(['none', 'mean', 'median']),
    st.sampled_from([0.0, 50.0]),
    st.sampled_from([(), (2,)]),
    st.integers(0, 2**32 - 1),
)
def test_a_chain_that_takes_filters_over_goes_on_as_if_it_had_seen_all_rows(
    at, common_mode, mains_hz, disabled, seed
):
    rng = np.random.default_rng(seed)
    volts = 4.3 + rng.normal(size=(200, 5)).cumsum(axis=0) * 0.1
    volts[rng.random(volts.shape) < 0.02] = np.nan
    config = dataclasses.replace(
        CONFIG, common_mode=common_mode, mains_hz=mains_hz, disabled_channels=disabled, groups={}
    )
    long, short = SlipChain(config), SlipChain(dataclasses.replace(config, **ONE_SAMPLE))
    long.update(volts[:at])
    # What it did before does not matter.
    short.update(rng.normal(size=(30, 5)))
    short.take_filters(long)
    found = short.update(volts[at:])
    whole = SlipChain(short.config).update(volts)
    np.testing.assert_array_equal(found.envelope, whole.envelope[at:])
    np.testing.assert_array_equal(found.flags, whole.flags[at:])


@pytest.mark.parametrize('learnt', [False, True])
def test_noise_floors_are_taken_over_by_channel(learnt):
    config = dataclasses.replace(
        QUICK_EVIDENCE, channels=40, groups={}, noise_floor_learnt=learnt, disabled_channels=(3,)
    )
    other = dataclasses.replace(config, disabled_channels=tuple(range(5, 21)), groups={}, gain=5.0)
    volts = np.random.default_rng(0).normal(size=(400, 40)) * np.geomspace(0.1, 10, 40)
    chain, other_chain = SlipChain(config), SlipChain(other)
    taken = other_chain.update(volts[::-1], floor=True).floor[-1]
    chain.take_floors(other_chain, volts)
    found = chain.state[:, layout.FLOOR].flatten()[:40]
    enabled, known = np.arange(40) != 2, ~np.isin(np.arange(40), range(4, 20))
    scaled = taken - 20 * np.log10(5.0)
    np.testing.assert_allclose(found[known & enabled], scaled[known & enabled])
    # The others begin as learnt, else where they would settle in these rows.
    levels = SlipChain(config).update(volts).envelope[8:, ~known]
    settled = 20 * np.log10(np.quantile(levels, 0.1, axis=0))
    np.testing.assert_allclose(found[~known], -40.0 if learnt else settled, atol=0.1)
    assert np.isnan(found[2]) or learnt
