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

"""The kernel: what the reference gives, however the rows are cut, compiled or interpreted."""

import copy
import os
import pickle
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from slip_detector.chain import slip_chain as chain_module
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.chain.stages import WORD_ROWS
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from support.chain_cases import VOTES, bits, noise, sine
from support.interpreted import interpreted_chain
from support.random_chains import (
    assert_same_votes,
    bits_in_pieces,
    configs,
    recordings,
    reference_of,
    round_off,
)
from support.reference import _vote as reference_vote

CHECKOUT = Path(chain_module.__file__).parents[2]

# The interpreted kernel is some 500 times slower.
EXAMPLES = 300 if COMPILED else 100

FEW_EXAMPLES = 60 if COMPILED else 15

# --- against the reference -----------------------------------------------------------------


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_configuration_gives_what_the_reference_gives(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    # A threshold amid the levels, which do not depend on it, so that there is something to decide.
    levels = SlipChain(config).update(volts).level
    levels = levels[levels > 0]
    share = data.draw(st.floats(0.0, 1.0), label='share of levels below the threshold')
    threshold = float(np.quantile(levels, share)) if levels.size else 0.5
    config = ChainConfig(**config.__dict__ | {'threshold': max(threshold, 1e-30)})
    truth = reference_of(config, volts)

    result = SlipChain(config).update(volts)

    tolerance = round_off(config, volts, truth.envelope)
    note(f'{config}, tolerance {tolerance}')
    assert np.abs(result.envelope - truth.envelope).max() <= tolerance
    assert np.abs(result.level - truth.level).max() <= tolerance
    assert np.array_equal(result.valid, truth.valid)
    assert np.array_equal(result.can_vote, truth.can_vote)
    clear = np.abs(truth.level - config.threshold) > tolerance
    assert np.array_equal(result.channels[clear], truth.channels[clear])
    enabled = np.ones(config.channels, dtype=bool)
    enabled[np.array(config.disabled_channels, dtype=int) - 1] = False
    assert np.array_equal(result.channels, (result.level > config.threshold) & enabled)
    # The vote on the chain's own levels has no tolerance.
    votes, _ = reference_vote(
        result.level, result.channels, result.valid, config.threshold, config.groups, config.vote
    )
    assert_same_votes(config, result, votes, result.level)


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_the_default_chain_decides_as_the_reference_through_a_whole_trial(common_mode, vote):
    rate, n = 380.0, 1500 if COMPILED else 400
    volts = np.linspace(1, 5, 16) + 0.002 * noise(1, n, 16)
    sliding = slice(n // 3, 2 * n // 3)
    volts[sliding] += 0.03 * sine(n, 22.0, rate)[sliding, None] * np.linspace(0.5, 1.5, 16)
    volts[n // 2 : n // 2 + 40, 4] = np.nan
    config = ChainConfig(common_mode=common_mode, vote=vote)
    truth = reference_of(config, volts)
    result = SlipChain(config).update(volts)
    tolerance = round_off(config, volts, truth.envelope)
    assert tolerance < 1e-8 * truth.level.max()
    assert np.abs(result.level - truth.level).max() <= tolerance
    for name in ('slip', 'groups', 'can_vote', 'channels', 'valid'):
        assert np.array_equal(getattr(result, name), getattr(truth, name)), name
    assert common_mode != 'none' or (result.slip.any() and not result.slip.all())


# --- streaming -----------------------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 1, 'mean'])
@settings(max_examples=FEW_EXAMPLES // 3)
@given(data=st.data())
def test_any_cut_of_the_rows_gives_the_same_bits(common_mode, vote, data):
    config = data.draw(configs(common_mode=common_mode, vote=vote, threshold=0.05))
    volts = data.draw(recordings(config))
    cuts = data.draw(st.lists(st.integers(0, len(volts)), max_size=12), label='cuts')
    whole = bits(SlipChain(config).update(volts))
    assert bits_in_pieces(SlipChain(config), np.split(volts, sorted(cuts))) == whole


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_single_rows_and_empty_calls_give_the_same_bits(common_mode, vote):
    config = ChainConfig(channels=7, common_mode=common_mode, vote=vote, flat_after_s=0.02)
    volts = np.round(3 + noise(2, 3 * WORD_ROWS + 5, 7), 1)
    volts[noise(3, *volts.shape) > 1.8] = np.nan
    whole = bits(SlipChain(config).update(volts))
    pieces = [piece for row in volts for piece in (row[None], volts[:0])]
    assert bits_in_pieces(SlipChain(config), pieces) == whole


def test_windows_longer_than_a_block_give_the_same_bits_however_cut():
    config = ChainConfig(channels=2, envelope_window_s=0.2, decision_window_s=0.3)
    volts = noise(4, 260, 2)
    whole = bits(SlipChain(config).update(volts))
    for step in (1, 31, WORD_ROWS, 33, 76, 114):
        pieces = np.split(volts, range(step, len(volts), step))
        assert bits_in_pieces(SlipChain(config), pieces) == whole


def test_an_empty_call_returns_empty_results_and_changes_nothing():
    chain = SlipChain()
    chain.update(noise(5, 10, 16))
    before = pickle.dumps(chain.state)
    result = chain.update(np.zeros((0, 16)))
    assert result.slip.shape == (0,)
    assert result.groups.shape == result.can_vote.shape == (0, 4)
    assert result.channels.shape == result.valid.shape == (0, 16)
    assert result.level.shape == result.envelope.shape == (0, 16)
    assert pickle.dumps(chain.state) == before


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_reset_makes_the_chain_new(common_mode):
    config = ChainConfig(common_mode=common_mode)
    volts = 2 + noise(6, 90, 16)
    chain = SlipChain(config)
    chain.update(100 * noise(7, 77, 16))
    chain.reset()
    assert bits(chain.update(volts)) == bits(SlipChain(config).update(volts))


@pytest.mark.parametrize(
    'copied', [copy.deepcopy, lambda chain: pickle.loads(pickle.dumps(chain))]
)
@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_a_copy_made_in_mid_stream_goes_on_with_the_same_bits(copied, common_mode):
    config = ChainConfig(channels=9, common_mode=common_mode, vote='mean')
    volts = 2 + noise(8, 120, 9)
    chain = SlipChain(config)
    chain.update(volts[:50])
    twin = copied(chain)
    assert twin.config == config
    rest = bits(chain.update(volts[50:]))
    assert bits(twin.update(volts[50:])) == rest
    chain.update(volts[:1])
    assert twin.state.tobytes() != chain.state.tobytes()


def test_a_result_keeps_its_values_when_the_chain_goes_on():
    chain = SlipChain()
    result = chain.update(noise(9, 40, 16))
    before = bits(result)
    chain.update(noise(10, 40, 16))
    chain.reset()
    assert bits(result) == before


def test_the_input_is_not_written_to():
    config = ChainConfig(channels=3, disabled_channels=(2,), common_mode='median')
    volts = noise(11, 50, 3)
    volts[20:30, 0] = np.nan
    before = volts.tobytes()
    SlipChain(config).update(volts)
    SlipChain(ChainConfig(channels=3)).update(volts)
    assert volts.tobytes() == before


# --- the interpreted kernel ----------------------------------------------------------------


@pytest.mark.skipif(not COMPILED, reason='there is no compiled kernel to compare with')
@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 1, 'mean'])
@settings(max_examples=10)
@given(data=st.data())
def test_the_interpreted_kernel_gives_the_bits_of_the_compiled_one(common_mode, vote, data):
    config = data.draw(configs(common_mode=common_mode, vote=vote, threshold=0.05))
    volts = data.draw(recordings(config))
    votes = data.draw(st.sampled_from([(), ('all', 'mean', 1, 2, 3)]), label='votes')
    compiled = SlipChain(config).update(volts, votes=votes)
    plain = interpreted_chain(config).update(volts, votes=votes)
    assert bits(plain) == bits(compiled)
    assert plain.vote_statistic.tobytes() == compiled.vote_statistic.tobytes()
    # A row a call, from the other side.
    half = len(volts) // 2
    rows = interpreted_chain(config)
    pieces = [rows.update(piece) for piece in [volts[:half], *volts[half : half + 20, None]]]
    flags = np.concatenate([piece.flags for piece in pieces])
    assert flags.tobytes() == compiled.flags[: half + 20].tobytes()


WITHOUT_NUMBA = """
    import sys, warnings
    import numpy as np
    sys.modules['numba'] = None
    from slip_detector.chain.slip_chain import COMPILED, SlipChain
    assert not COMPILED
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        chain = SlipChain()
        results = [chain.update(piece) for piece in np.array_split(np.load(sys.argv[1]), 3)]
    for warning in caught:
        print(warning.category.__name__, warning.filename == '<string>', warning.message)
    np.save(sys.argv[2], np.concatenate([result.flags for result in results]))
"""


def test_without_numba_there_is_one_warning_and_the_same_decisions(tmp_path):
    volts = 4.3 + 0.04 * noise(12, 200, 16)
    np.save(tmp_path / 'volts.npy', volts)
    run = subprocess.run(
        [
            sys.executable,
            '-c',
            textwrap.dedent(WITHOUT_NUMBA),
            str(tmp_path / 'volts.npy'),
            str(tmp_path / 'flags.npy'),
        ],
        env=os.environ | {'PYTHONPATH': str(CHECKOUT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 1
    # The warning points at the caller's line.
    assert lines[0].startswith('RuntimeWarning True Numba is not installed')
    flags = SlipChain().update(volts).flags
    assert 0 < flags.sum() < flags.size
    assert np.array_equal(np.load(tmp_path / 'flags.npy'), flags)


@pytest.mark.skipif(not COMPILED, reason='without Numba there is a warning, tested elsewhere')
def test_with_numba_there_is_no_warning():
    with warnings.catch_warnings():
        warnings.resetwarnings()
        warnings.simplefilter('error')
        SlipChain().update(noise(13, 5, 16))
