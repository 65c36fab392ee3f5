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
import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest
from chain import reference_evidence
from chain.chain_cases import bits, noise, quick_evidence
from chain.reference import reference, vote_of
from hypothesis import assume, given, note, settings
from hypothesis import strategies as st

from slip_detector.chain import slip_chain as chain_module
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stages import WORD_ROWS
from slip_detector.compiled import COMPILED
from slip_detector.parameters import COMMON_MODES, ChainConfig
from support.interpreted import interpreted
from support.python_runs import run_python
from support.random_chains import (
    assert_same_votes,
    cases,
    configs,
    recordings,
    round_off,
    with_evidence,
)

CHECKOUT = Path(chain_module.__file__).parents[2]

# The interpreted kernel is some 500 times slower.
EXAMPLES = 200 if COMPILED else 60
FEW_EXAMPLES = 40 if COMPILED else 15

#: Of a decibel, in the kernel.
ERROR_DB, ACTIVITY_ERROR_DB = 1e-5, 4e-4


# --- against the reference -----------------------------------------------------------------


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_chain_that_decides_by_the_mean_gives_what_the_reference_gives(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    # A threshold amid the levels, which do not depend on it, so that there is something to decide.
    levels = SlipChain(config).update(volts).level
    levels = levels[levels > 0]
    share = data.draw(st.floats(0.0, 1.0), label='share of levels below the threshold')
    threshold = float(np.quantile(levels, share)) if levels.size else 0.5
    config = ChainConfig(**config.__dict__ | {'threshold': max(threshold, 1e-30)})
    truth = reference(volts, config)

    result = SlipChain(config).update(volts)

    tolerance = round_off(config, volts, truth.envelope)
    note(f'{config}, tolerance {tolerance}')
    assert np.abs(result.envelope - truth.envelope).max() <= tolerance
    assert np.abs(result.level - truth.level).max() <= tolerance
    assert np.array_equal(result.valid, truth.valid)
    clear = np.abs(truth.level - config.threshold) > tolerance
    assert np.array_equal(result.channels[clear], truth.channels[clear])
    assert np.array_equal(result.channels, (result.level > config.threshold) & truth.enabled)
    # The vote on the chain's own levels has no tolerance.
    votes, can_vote = vote_of(config, result.level, result.channels, result.valid)
    assert np.array_equal(result.can_vote, can_vote)
    assert_same_votes(config, result, votes, result.level)


def assert_floor_follows(config, found, level_db, moving):
    """Check each row of a floor against the row before it, which the chain itself gave."""
    learnt = config.noise_floor_learnt and config.noise_floor
    for column, least_db in enumerate(reference_evidence.least_floors_db(config)):
        rows = np.flatnonzero(moving[:, column])
        level, now = level_db[rows, column], found[rows, column]
        before = np.concatenate([[least_db], now[:-1]])[: len(now)]
        off = []
        # A level next to the floor may be on either side of it.
        for side_db in (level - ERROR_DB, level + ERROR_DB):
            wanted = reference_evidence.moved_floor(before, side_db, config)
            if not learnt:
                wanted[:1] = side_db[:1]
            if config.noise_floor:
                wanted = np.clip(wanted, least_db, least_db + config.noise_floor_range_db)
            off.append(np.abs(wanted - now))
        assert (np.minimum(*off) <= 1.01 * ERROR_DB).all()
        still = ~moving[1:, column]
        np.testing.assert_array_equal(found[1:, column][still], found[:-1, column][still])
        if rows.size and not config.noise_floor:
            assert np.isnan(found[: rows[0], column]).all()


@settings(max_examples=EXAMPLES // 4)
@given(st.data())
def test_any_chain_that_decides_by_evidence_gives_what_the_reference_gives(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    config = data.draw(with_evidence(config, volts))
    note(f'{config}')
    truth = reference(volts, config)
    result = SlipChain(config).update(volts, floor=True, excess=True, votes=[config.vote])

    tolerance = round_off(config, volts, truth.envelope)
    assert np.abs(result.envelope - truth.envelope).max() <= tolerance
    assert np.array_equal(result.valid, truth.valid)
    # Stage by stage, each on what the chain gave for the one before.
    low, high = config.valid_range_v
    good = (volts >= low) & (volts <= high)
    settle = config.mains_rows + config.samples(config.envelope_window_s)
    moves = reference_evidence.rows_that_move(volts, good, result.envelope, config)
    settled = reference_evidence.rows_that_settled(moves, result.valid, settle)
    level_db = reference_evidence.decibels(result.envelope)
    # The low level within its round-off; contact must not be a matter of that.
    delta = 1e-12 * np.abs(volts[good]).max(initial=0.0)
    lows = np.maximum(truth.low - delta, 0.0), truth.low + delta
    hold_rows = config.samples(config.contact_hold_s)
    of_low = [
        reference_evidence.rows_in_contact(low, truth.valid, config, hold_rows) for low in lows
    ]
    assume(np.array_equal(*of_low))
    contact, touches = of_low[0]
    left_out = truth.after_impact | ~contact
    bare = SlipChain(dataclasses.replace(config, activity_cap_db=0.0))
    floor = bare.update(volts, floor=True).floor
    moving = settled & moves & touches[:, None]
    begun = reference_evidence.rows_with_floor(moving, config)
    assert_floor_follows(config, floor, level_db, moving)
    counts = settled & begun
    if config.low_band_hz:
        lifts = counts & contact[:, None]
        least, most = (reference_evidence.lifted_floors(floor, low, lifts, config) for low in lows)
        error_db = ACTIVITY_ERROR_DB * config.exponent
        assert not ((result.floor < least - error_db) | (result.floor > most + error_db)).any()
        assert np.array_equal(np.isnan(result.floor), np.isnan(floor))
    else:
        assert np.array_equal(result.floor, floor, equal_nan=True)
    common = reference_evidence.common_excess(level_db, floor, begun, settled, config.common_rank)
    excess = reference_evidence.excess_of(
        level_db, result.floor, common, counts, left_out, config.evidence_cap_db
    )
    np.testing.assert_allclose(result.excess, excess, rtol=0, atol=2 * ERROR_DB)
    assert (result.excess[~counts] == 0).all()
    evidence = reference_evidence.evidence_of(result.excess, counts, config)
    np.testing.assert_allclose(result.level, evidence, rtol=0, atol=1e-13)
    # The decisions on the chain's own evidence have no tolerance.
    on = reference_evidence.channels_on(result.level, config.threshold) & truth.enabled
    assert np.array_equal(result.channels, on)
    held = reference_evidence.largest_threshold(result.level)
    votes, can_vote = vote_of(config, held, on, result.valid)
    assert np.array_equal(result.can_vote, can_vote)
    assert_same_votes(config, result, votes, held)
    assert np.array_equal(result.vote_statistic[:, 0] > 1, result.slip)


# --- streaming -----------------------------------------------------------------------------


def in_pieces(chain, pieces, **kept):
    return bits(*(chain.update(piece, **kept) for piece in pieces))


@settings(max_examples=FEW_EXAMPLES)
@given(st.data())
def test_any_cut_of_the_rows_gives_the_same_bits(data):
    config, volts, kept = data.draw(cases())
    cuts = data.draw(st.lists(st.integers(0, len(volts)), max_size=12), label='cuts')
    whole = bits(SlipChain(config).update(volts, **kept))
    assert in_pieces(SlipChain(config), np.split(volts, sorted(cuts)), **kept) == whole
    # What is kept changes nothing else.
    bare = SlipChain(config).update(volts, envelope=False, level=False)
    assert bare.flags.tobytes() == whole['flags']


ALL_STAGES = {
    'impact_v': 2.0, 'impact_s': 0.01, 'contact_level_v': 0.1, 'contact_hold_s': 0.02,
    'activity_cap_db': 8.7, 'common_rank': 2,
}  # fmt: skip


@pytest.mark.parametrize(
    'config',
    [
        *(ChainConfig(channels=7, common_mode=c, flat_after_s=0.02) for c in COMMON_MODES),
        ChainConfig(channels=7, vote='mean', envelope_window_s=0.2, decision_window_s=0.3),
        quick_evidence(channels=20, mains_hz=50, groups={}, **ALL_STAGES),
    ],
    ids=lambda config: f'{config.decision}, {config.common_mode}, {config.vote}',
)
def test_single_rows_and_empty_calls_give_the_same_bits_over_chunks_of_rows(config):
    rows = 9 * WORD_ROWS + 5 if COMPILED else 3 * WORD_ROWS + 5
    volts = np.round(3 + noise(2, rows, config.channels), 1)
    volts[noise(3, *volts.shape) > 1.8] = np.nan
    whole = bits(SlipChain(config).update(volts))
    pieces = [piece for row in volts for piece in (row[None], volts[:0])]
    assert in_pieces(SlipChain(config), pieces) == whole


@pytest.mark.parametrize(
    'copied', [copy.deepcopy, lambda chain: pickle.loads(pickle.dumps(chain))]
)
@pytest.mark.parametrize(
    'config',
    [
        ChainConfig(channels=9, common_mode='mean', vote='mean'),
        quick_evidence(**ALL_STAGES),
    ],
)
def test_a_copy_made_in_mid_stream_goes_on_with_the_same_bits(copied, config):
    volts = 2 + noise(8, 300, config.channels)
    chain = SlipChain(config)
    chain.update(volts[:150])
    twin = copied(chain)
    assert twin.config == config
    rest = bits(chain.update(volts[150:]))
    assert bits(twin.update(volts[150:])) == rest
    chain.update(volts[:1])
    assert twin.state.tobytes() != chain.state.tobytes()


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_reset_makes_the_chain_new_and_leaves_earlier_results_alone(common_mode):
    config = ChainConfig(common_mode=common_mode, mains_hz=50.0)
    volts = 2 + noise(6, 90, 16)
    chain = SlipChain(config)
    earlier = chain.update(100 * noise(7, 77, 16))
    before = bits(earlier)
    chain.reset()
    assert bits(chain.update(volts)) == bits(SlipChain(config).update(volts))
    assert bits(earlier) == before


# --- the interpreted kernel ----------------------------------------------------------------


@pytest.mark.skipif(not COMPILED, reason='there is no compiled kernel to compare with')
@settings(max_examples=25)
@given(st.data())
def test_the_interpreted_kernel_gives_the_bits_of_the_compiled_one(data):
    config, volts, kept = data.draw(cases())
    compiled = SlipChain(config).update(volts, **kept)
    assert bits(interpreted('chain.slip_chain').SlipChain(config).update(volts, **kept)) == bits(
        compiled
    )


def test_without_numba_it_is_said_once_that_all_runs_interpreted():
    script = (
        'import sys; sys.modules["numba"] = None; from slip_detector import SlipChain as Chain'
    )
    done = run_python('-c', f'{script}; Chain(), Chain()', cwd=CHECKOUT)
    assert done.returncode == 0
    assert done.stderr == (
        'Numba is not installed: all runs interpreted, slower, with the same decisions\n'
    )
