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

"""The decision by evidence: what the reference gives, however the rows are cut."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from slip_detector.chain.evidence import LEAST_EXCESS_DB, floor_steps_db, least_floor_db
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.parameters.detector import ChainConfig
from support import reference_evidence
from support.chain_cases import QUICK_EVIDENCE, noise, quick_evidence, sine, tone
from support.interpreted import interpreted_chain
from support.random_chains import (
    assert_same_votes,
    configs,
    recordings,
    reference_of,
    round_off,
    with_evidence,
)
from support.reference import _vote as reference_vote

EXAMPLES = 60 if COMPILED else 30
FEW_EXAMPLES = 30 if COMPILED else 10

SIGNALS = ('envelope', 'level', 'floor', 'excess')
KEPT = {'floor': True, 'excess': True}

#: Of a decibel, in the kernel.
ERROR_DB = 1e-5


def bits(*results):
    return {
        name: np.concatenate([getattr(result, name) for result in results]).tobytes()
        for name in ('flags', 'after_impact', *SIGNALS)
    }


# --- against the reference -----------------------------------------------------------------


def assert_floor_follows(config, found, level_db, counts):
    """Check each row of a floor against the row before it, which the chain itself gave."""
    for column in range(config.channels):
        least_db = least_floor_db(config.noise_floors[column])
        rows = np.flatnonzero(counts[:, column])
        level, now = level_db[rows, column], found[rows, column]
        before = np.concatenate([[least_db], now[:-1]])[: len(now)]
        off = []
        # A level next to the floor may be on either side of it.
        for one in (level - ERROR_DB, level + ERROR_DB):
            wanted = reference_evidence.moved_floor(
                before, one, config.noise_floor_rate_db_s, config.sample_rate_hz
            )
            if not config.noise_floor_learnt:
                wanted[:1] = one[:1]
            wanted = np.clip(wanted, least_db, least_db + config.noise_floor_range_db)
            off.append(np.abs(wanted - now))
        assert (np.minimum(*off) <= 1.01 * ERROR_DB).all()
        still = ~counts[1:, column]
        assert (np.diff(found[:, column])[still] == 0).all()


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_configuration_gives_what_the_reference_gives(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    config = data.draw(with_evidence(config, volts))
    note(f'{config}')
    truth = reference_of(config, volts)
    result = SlipChain(config).update(volts, **KEPT, votes=[config.vote])
    enabled = np.ones(config.channels, dtype=bool)
    enabled[np.array(config.disabled_channels, dtype=int) - 1] = False

    tolerance = round_off(config, volts, truth.envelope)
    assert np.abs(result.envelope - truth.envelope).max() <= tolerance
    for name in ('valid', 'can_vote', 'after_impact'):
        assert np.array_equal(getattr(result, name), getattr(truth, name)), name
    # Stage by stage, each on what the chain gave for the one before.
    low, high = config.valid_range_v
    good = (volts >= low) & (volts <= high)
    settle = config.mains_rows + config.samples(config.envelope_window_s)
    counts = reference_evidence.rows_that_count(good, result.valid, settle)
    level_db = reference_evidence.decibels(result.envelope)
    assert_floor_follows(config, result.floor, level_db, counts)
    excess = reference_evidence.excess_of(
        level_db, result.floor, counts, result.after_impact, config.evidence_cap_db
    )
    np.testing.assert_allclose(result.excess, excess, rtol=0, atol=ERROR_DB)
    assert (result.excess[~counts] == 0).all()
    evidence = reference_evidence.evidence_of(
        result.excess, counts, config.evidence_offset_db, config.evidence_limit_db_s,
        config.sample_rate_hz,
    )  # fmt: skip
    np.testing.assert_allclose(result.level, evidence, rtol=0, atol=1e-13)
    # The decisions on the chain's own evidence have no tolerance.
    on = reference_evidence.channels_on(result.level, config.threshold) & enabled
    assert np.array_equal(result.channels, on)
    held = reference_evidence.largest_threshold(result.level)
    votes, _ = reference_vote(held, on, result.valid, config.threshold, config.groups, config.vote)
    assert_same_votes(config, result, votes, held)
    assert np.array_equal(result.vote_statistic[:, 0] > 1, result.slip)


def test_a_whole_recording_gives_what_the_reference_gives():
    n = 1500
    config = ChainConfig(
        decision='evidence', noise_floor=1e-4, mains_hz=50, impact_v=0.25, threshold=0.3,
        exponent=1, gain=1.0, vote=2, common_mode='median', passband_hz=(20.0, 0.0),
        passband_degree=2, stopbands_hz=(),
    )  # fmt: skip
    volts = np.linspace(1, 5, 16) + 0.002 * noise(1, n, 16)
    volts += 0.05 * sine(n, 50.0, 380.0)[:, None]
    sliding = slice(600, 1000)
    volts[sliding] += 0.02 * noise(2, n, 16)[sliding]
    volts[300:302] += [[0.7], [-0.5]]
    volts[700:760, 4] = np.nan
    truth = reference_of(config, volts)
    result = SlipChain(config).update(volts, **KEPT)
    # None of the levels is so close to the floor that rounding decides how it moves.
    np.testing.assert_allclose(result.floor, truth.floor, rtol=0, atol=ERROR_DB)
    np.testing.assert_allclose(result.excess, truth.excess, rtol=0, atol=2 * ERROR_DB)
    np.testing.assert_allclose(result.level, truth.level, rtol=0, atol=n / 380.0 * 2 * ERROR_DB)
    for name in ('slip', 'groups', 'can_vote', 'channels', 'valid', 'after_impact'):
        assert np.array_equal(getattr(result, name), getattr(truth, name)), name
    # The last of three steps is at row 302, and held for 114 rows.
    assert np.flatnonzero(result.after_impact).tolist() == list(range(300, 302 + 114))
    assert not result.slip[:600].any()
    assert result.slip[650:1000].all()
    assert not result.slip[-100:].any()


# --- streaming -----------------------------------------------------------------------------


@settings(max_examples=FEW_EXAMPLES)
@given(st.data())
def test_any_cut_of_the_rows_gives_the_same_bits(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    config = data.draw(with_evidence(config, volts))
    cuts = data.draw(st.lists(st.integers(0, len(volts)), max_size=12), label='cuts')
    whole = bits(SlipChain(config).update(volts, **KEPT))
    chain = SlipChain(config)
    assert bits(*(chain.update(rows, **KEPT) for rows in np.split(volts, sorted(cuts)))) == whole
    # What is kept of it changes nothing else.
    bare = SlipChain(config).update(volts, envelope=False, level=False)
    assert bare.flags.tobytes() == whole['flags']


def test_a_row_a_call_gives_the_same_bits_over_chunks_of_rows():
    config = quick_evidence(channels=20, mains_hz=50, impact_v=0.5, groups={}, vote=2)
    volts = np.round(3 + noise(2, 700, 20), 2)
    volts[noise(3, *volts.shape) > 1.8] = np.nan
    whole = bits(SlipChain(config).update(volts, **KEPT))
    chain = SlipChain(config)
    assert bits(*(chain.update(row[None], **KEPT) for row in volts)) == whole


@pytest.mark.parametrize(
    'copied', [copy.deepcopy, lambda chain: pickle.loads(pickle.dumps(chain))]
)
def test_a_copy_made_in_mid_stream_goes_on_with_the_same_bits(copied):
    chain = SlipChain(quick_evidence(mains_hz=50, impact_v=2.0))
    volts = 2 + noise(8, 300, 4)
    chain.update(volts[:150])
    twin = copied(chain)
    rest = bits(chain.update(volts[150:], **KEPT))
    assert bits(twin.update(volts[150:], **KEPT)) == rest


@pytest.mark.skipif(not COMPILED, reason='there is no compiled kernel to compare with')
@settings(max_examples=12)
@given(st.data())
def test_the_interpreted_kernel_gives_the_bits_of_the_compiled_one(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    config = data.draw(with_evidence(config, volts))
    votes = data.draw(st.sampled_from([(), ('all', 'mean', 1, 2, 3)]), label='votes')
    compiled = SlipChain(config).update(volts, **KEPT, votes=votes)
    plain = interpreted_chain(config).update(volts, **KEPT, votes=votes)
    assert bits(plain) == bits(compiled)
    assert plain.vote_statistic.tobytes() == compiled.vote_statistic.tobytes()


# --- the number that a vote holds against 1 ------------------------------------------------


@settings(max_examples=FEW_EXAMPLES)
@given(st.data())
def test_the_statistic_tells_of_any_threshold_where_slip_would_be_on(data):
    config = data.draw(configs(vote='all'))
    volts = data.draw(recordings(config))
    config = data.draw(with_evidence(config, volts))
    least = min(
        len(set(members) - set(config.disabled_channels)) for members in config.groups.values()
    )
    votes = ['all', *range(1, least + 1)]
    statistic = SlipChain(config).update(volts, votes=votes).vote_statistic
    share = data.draw(st.floats(0.01, 0.99), label='threshold, as a share of the limit')
    threshold = share * config.evidence_limit_db_s
    for v, vote in enumerate(votes):
        other = dataclasses.replace(config, threshold=threshold, vote=vote)
        slip = SlipChain(other).update(volts).slip
        at_unit = statistic[:, v] * config.threshold
        clear = np.abs(at_unit - threshold) > 1e-12 * threshold
        assert np.array_equal((at_unit > threshold)[clear], slip[clear])


# --- what stages do ------------------------------------------------------------------------


def test_a_channel_comes_on_above_the_threshold_and_goes_off_at_half_of_it():
    chain = SlipChain(
        quick_evidence(threshold=0.2, noise_floor_learnt=True, noise_floor_rate_db_s=0.0)
    )
    volts = np.concatenate([tone(40, 0.001), tone(30), tone(400, 0.001)])
    result = chain.update(volts)
    on, evidence = result.channels[:, 0], result.level[:, 0]
    rise, fall = int(on.argmax()), len(on) - int(on[::-1].argmax())
    assert evidence[rise - 1] <= 0.2 < evidence[rise]
    assert evidence[fall] <= 0.1 < evidence[fall - 1]
    assert on[rise:fall].all()
    assert on.sum() == fall - rise
    assert evidence.max() > 0.25


def test_evidence_stays_within_its_limit_and_falls_to_exactly_0():
    config = quick_evidence(evidence_limit_db_s=0.5, noise_floor_learnt=True)
    result = SlipChain(config).update(np.concatenate([tone(400), tone(800, 1e-4)]))
    assert result.level.max() == 0.5
    assert result.level.min() == 0.0
    assert (result.level[-100:] == 0).all()


def test_a_learnt_floor_begins_at_its_least_and_any_other_at_the_first_envelope():
    for learnt in (True, False):
        config = quick_evidence(noise_floor_learnt=learnt, noise_floor_rate_db_s=0.0)
        result = SlipChain(config).update(tone(200), **KEPT)
        begin = config.samples(config.envelope_window_s)
        assert result.floor[:begin] == pytest.approx(-40.0)
        wanted = -40.0 if learnt else 20 * np.log10(result.envelope[begin, 0])
        assert result.floor[begin:] == pytest.approx(wanted, abs=ERROR_DB)
        assert (result.level > 0).any() == learnt


def test_a_floor_rises_slowly_and_falls_nine_times_as_fast_within_its_range():
    config = quick_evidence(
        noise_floor_learnt=True, noise_floor_range_db=20.0, noise_floor_rate_db_s=4.0
    )
    result = SlipChain(config).update(np.concatenate([tone(1000), tone(400, 1e-6)]), **KEPT)
    floor = result.floor[:, 0]
    assert floor[500] - floor[400] == pytest.approx(1.0)
    assert floor[1030] - floor[1080] == pytest.approx(4.5)
    up_db, down_db = floor_steps_db(4.0, 400.0)
    assert (up_db, down_db) == pytest.approx((0.01, 0.09))
    long = SlipChain(config).update(tone(4000), **KEPT).floor
    assert long.max() == pytest.approx(-20.0)
    assert floor[-1] == pytest.approx(-40.0)


def test_in_noise_a_tenth_of_the_rows_lies_below_the_floor():
    config = quick_evidence(noise_floor_rate_db_s=5.0, envelope_window_s=0.0025)
    volts = noise(5, 10_000, 4)
    result = SlipChain(config).update(volts, **KEPT)
    below = (result.excess[3000:] <= 0).mean()
    assert below == pytest.approx(0.1, abs=0.02)


@settings(max_examples=FEW_EXAMPLES)
@given(st.integers(0, 200), st.integers(1, 60), st.sampled_from([np.nan, np.inf, 1e300]))
def test_a_channel_that_is_not_valid_keeps_floor_and_evidence(at, rows, bad):
    volts = np.concatenate([tone(150), tone(150, 0.001)])
    hit = volts.copy()
    hit[at : at + rows, 1] = bad
    config = quick_evidence(noise_floor_learnt=True, evidence_limit_db_s=0.3)
    result, clean = (SlipChain(config).update(one, **KEPT) for one in (hit, volts))
    out = slice(at, at + rows)
    before = result.level[at - 1, 1] if at else 0.0
    assert (result.level[out, 1] == before).all()
    assert (result.floor[out, 1] == result.floor[max(at - 1, 0), 1]).all()
    assert (result.excess[out, 1] == 0).all()
    assert not result.valid[out, 1].any()
    others = [0, 2, 3]
    assert np.array_equal(result.level[:, others], clean.level[:, others])


def test_a_late_channel_counts_from_its_own_first_sample_on():
    config = quick_evidence(mains_hz=50.0, noise_floor_learnt=True)
    volts = tone(300)
    volts[:117, 2] = np.nan
    result = SlipChain(config).update(volts, **KEPT)
    settle = config.mains_rows + config.samples(config.envelope_window_s)
    assert settle == 8 + 8
    for channel, first in ((0, 0), (2, 117)):
        assert (result.excess[: first + settle, channel] == 0).all()
        assert (result.envelope[: first + config.mains_rows, channel] == 0).all()


def test_a_gap_that_restarts_the_chain_keeps_the_floor_alone():
    config = quick_evidence(noise_floor_rate_db_s=100.0)
    volts = 0.1 * noise(9, 600, 4)
    chain = SlipChain(config)
    floor = chain.update(volts[:300], **KEPT).floor[-1]
    chain.restart()
    after = chain.update(volts[300:], **KEPT)
    assert np.array_equal(after.floor[0], floor)
    assert np.abs(floor + 40).min() > 1
    new = SlipChain(config).update(volts[300:], **KEPT)
    assert after.envelope.tobytes() == new.envelope.tobytes()
    assert (after.level[:8] == 0).all()
    chain.reset()
    assert bits(chain.update(volts[300:], **KEPT)) == bits(new)


def test_signals_of_evidence_are_refused_where_there_is_none():
    chain = SlipChain()
    with pytest.raises(ValueError, match='allowed: with decision: evidence'):
        chain.update(np.zeros((1, 16)), floor=True)
    result = SlipChain(QUICK_EVIDENCE).update(np.zeros((1, 4)))
    for name in ('floor', 'excess', 'after_impact'):
        with pytest.raises(ValueError, match=f'{name} was not kept'):
            getattr(result, name)


def test_what_evidence_needs_costs_the_mean_no_state():
    mean, evidence = SlipChain(), SlipChain(ChainConfig(decision='evidence', noise_floor=1.0))
    with_comb = SlipChain(ChainConfig(mains_hz=50.0))
    assert mean.state.shape[1] - evidence.state.shape[1] == 15 + 1  # the second window
    assert with_comb.state.shape[1] - mean.state.shape[1] == 38


# --- extremes ------------------------------------------------------------------------------


@pytest.mark.parametrize('size_v', [0.0, 5e-324, 1e-310, 1e-160, 1e6, 1e12])
def test_any_size_of_signal_gives_finite_numbers_within_their_bounds(size_v):
    values = {'gain': 1e6, 'exponent': 6} if size_v == 1e12 else {}
    config = quick_evidence(valid_range_v=(-1e12, 1e12), **values)
    volts = np.concatenate([size_v * noise(10, 300, 4), np.zeros((300, 4))])
    volts = np.clip(volts, -1e12, 1e12)
    result = SlipChain(config).update(volts, **KEPT)
    for name in SIGNALS:
        assert np.isfinite(getattr(result, name)).all(), name
    assert (result.excess >= LEAST_EXCESS_DB).all()
    assert (result.excess <= config.evidence_cap_db).all()
    assert (result.level >= 0).all()
    assert (result.level <= config.evidence_limit_db_s).all()
    assert (result.floor >= -40 - 1e-9).all()
    assert (result.floor <= 20 + 1e-9).all()


def test_a_step_of_a_million_volts_leaves_no_trace_in_the_evidence():
    config = quick_evidence(noise_floor_learnt=True, noise_floor_rate_db_s=0.0)
    volts = 0.1 * noise(11, 3000, 4)
    hit = volts.copy()
    hit[100:, 0] += 1e6
    calm, shaken = (SlipChain(config).update(one) for one in (volts, hit))
    assert shaken.level[150, 0] > 0.5
    assert np.abs(shaken.level - calm.level)[-100:].max() < 1e-3
