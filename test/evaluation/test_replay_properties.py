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

"""Replaying any recording in any pieces, against a plain evaluation of the whole."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.evaluation import replay as replay_module
from slip_detector.evaluation.figures import ALREADY_ON, STAGES, figures_of_merit, first_on_delay_s
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig
from support.replay_cases import CONFIG, RATE_HZ, plain


@st.composite
def recordings(draw):
    """Draw rows with bursts of ridges, labels that mostly fit, and stretches."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label='seed'))
    n = 1200
    volts = 0.2 * rng.normal(size=(n, 4))
    time_s = np.arange(n) / RATE_HZ
    truth = np.zeros(n, bool)
    for _ in range(draw(st.integers(0, 4), label='bursts')):
        start = int(rng.integers(0, n))
        end = start + int(rng.integers(1, 200))
        strength = rng.choice([0.3, 1.0, 2.0], 4)
        volts[start:end] += np.sin(2 * np.pi * 50.0 * time_s[start:end, np.newaxis]) * strength
        shift = int(rng.integers(-10, 10))
        truth[max(start + shift, 0) : end + shift] = rng.random() < 0.8
    volts[rng.random(volts.shape) < 0.002] = np.nan
    for start in rng.integers(0, n, 20):  # A channel that leaves in the midst of ridges.
        volts[start : start + 30, rng.integers(0, 4)] = np.nan
    stamps_ns = np.round(time_s * 1e9).astype(np.int64)
    breaks = sorted(rng.integers(1, n, draw(st.integers(0, 2), label='gaps')).tolist())
    for at in breaks:
        stamps_ns[at:] += int(rng.choice([-500_000_000, 1_000_000_000]))
    moving = rng.random(n) < 0.5
    return volts, truth, stamps_ns, breaks, moving


def cut(recording, cuts):
    """Cut a recording at its breaks and elsewhere."""
    volts, truth, stamps_ns, breaks, moving = recording
    edges = [0, *sorted([*cuts, *breaks]), len(volts)]
    seen = set()
    for a, b in itertools.pairwise(edges):
        new = a in breaks and a not in seen and a < b
        if new:
            seen.add(a)
        yield Samples(volts[a:b], stamps_ns[a:b], truth[a:b], new_stretch=new, moving=moving[a:b])


CONFIGS = st.builds(
    lambda vote, common, exponent: dataclasses.replace(
        CONFIG, vote=vote, common_mode=common, exponent=exponent
    ),
    st.sampled_from(['all', 'mean', 1]),
    st.sampled_from(['none', 'mean']),
    st.sampled_from([1, 3]),
)
EVALUATIONS = st.builds(
    lambda early, tail, off: EvaluationConfig(
        early_s=early, tail_s=tail, off_before_s=off, late_after_s=0.06
    ),
    st.sampled_from([0.0, 0.02]),
    st.sampled_from([0.0, 0.05]),
    st.sampled_from([0.0, 0.03]),
)


@settings(max_examples=60 if COMPILED else 5)
@given(
    recordings(),
    CONFIGS,
    EVALUATIONS,
    st.lists(st.integers(0, 1200), max_size=6),
    st.integers(1, 500),
)
def test_any_cut_of_the_rows_gives_the_same_outcome(
    recording, config, evaluation, cuts, block_values
):
    whole = Replay(config, evaluation).run(cut(recording, []))
    kept = replay_module.BLOCK_VALUES
    replay_module.BLOCK_VALUES = block_values * 4
    try:
        pieces = Replay(config, evaluation).run(cut(recording, cuts))
    finally:
        replay_module.BLOCK_VALUES = kept
    assert plain(pieces) == plain(whole)


def stretches(recording):
    volts, _, _, breaks, _ = recording
    edges = sorted({0, *breaks, len(volts)})
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


def runs(on):
    """Return first row and first row after of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


@settings(max_examples=60 if COMPILED else 5)
@given(recordings(), CONFIGS, EVALUATIONS)
def test_figures_are_those_of_a_plain_evaluation_of_the_whole(recording, config, evaluation):
    volts, truth, _, _, moving = recording
    outcome = Replay(config, evaluation).run(cut(recording, []))
    settling = max(settling_rows(config), round(evaluation.off_before_s * RATE_HZ))
    on, channels, statistic, rises, labels = [], [], [], 0, []
    rest = np.zeros(len(volts), bool)
    for part in stretches(recording):
        result = SlipChain(config).update(volts[part], votes=(config.vote,))
        on.append(result.slip)
        channels.append(result.channels)
        statistic.append(result.vote_statistic[:, 0])
        turned_on = runs(result.slip)
        # An OFF of less than off_before_s is no end of an alarm.
        rises += sum(
            not k or a - turned_on[k - 1][1] >= evaluation.off_before_s * RATE_HZ
            for k, (a, _) in enumerate(turned_on)
        )
        labels += [(part.start + a, part.start + b) for a, b in runs(truth[part])]
        rest[part.start + settling : part.stop] = True
        early, tail = (round(s * RATE_HZ) for s in (evaluation.early_s, evaluation.tail_s))
        for a, b in runs(truth[part]):
            rest[part][max(a - early, 0) : b + tail] = False
    on, channels, statistic = (np.concatenate(parts) for parts in (on, channels, statistic))
    found = figures_of_merit([outcome])
    assert (found['rows'], found['slip_rows']) == (len(volts), int(truth.sum()))
    assert found['moving_rows'] == int(moving.sum())
    assert found['duration_s'] == len(volts) / RATE_HZ
    assert found['alarms'] == rises
    assert (outcome.rest_rows, outcome.on_rest_rows) == (rest.sum(), (rest & on).sum())
    assert found['false_time_percent'] == (
        pytest.approx(100.0 * on[rest].mean()) if rest.any() else None
    )
    assert found['slips'] == len(labels)
    assert found['false_positive_percent'] == (
        None if truth.all() else pytest.approx(100.0 * on[~truth].mean())
    )
    time_s = np.arange(len(volts)) / RATE_HZ
    for slip, (a, b) in zip(outcome.slips, labels, strict=True):
        assert slip.on_while == bool(on[a:b].any())
        delays = [first_on_delay_s(column[:b], time_s[:b], time_s[a]) for column in channels.T]
        assert slip.channel_delays_s == tuple(
            None if delay is None else pytest.approx(delay) for delay in delays
        )
        known = [delay for delay in delays if delay is not None]
        assert slip.delay_s == (pytest.approx(np.mean(known)) if known else None)
        assert slip.end_s - slip.start_s == pytest.approx((b - a) / RATE_HZ)
    for against, auc in ((~truth, 'auc_all'), (~truth & moving, 'auc_moving')):
        pairs = statistic[truth][:, np.newaxis] - statistic[against]
        if pairs.size:
            area = (pairs > 0).mean() + 0.5 * (pairs == 0).mean()
            assert found[auc] == pytest.approx(area, abs=1e-3)
        else:
            assert found[auc] is None


@settings(max_examples=60 if COMPILED else 5)
@given(recordings(), CONFIGS, EVALUATIONS)
def test_the_parts_of_a_latency_sum_to_it_and_each_is_what_it_says(recording, config, evaluation):
    volts, truth, _, _, _ = recording
    whole = [Samples.evenly(volts, RATE_HZ, truth)]
    outcome = Replay(config, evaluation).run(whole)
    sharp = dataclasses.replace(
        config, envelope_window_s=1.0 / RATE_HZ, decision_window_s=1.0 / RATE_HZ
    )
    result = SlipChain(config).update(volts)
    filtered = SlipChain(sharp).update(volts).envelope
    signals = [
        signal & result.valid
        for signal in (filtered > 0.3, result.envelope > 0.3, result.level > 0.3)
    ]
    off_rows = round(evaluation.off_before_s * RATE_HZ)
    settled = max(settling_rows(config), off_rows)
    for slip in outcome.slips:
        start, end = round(slip.start_s * RATE_HZ), round(slip.end_s * RATE_HZ)
        assert slip.settling == (start < settled)
        if slip.alarm is None:
            assert slip.latency_s is None
            assert slip.stages_s is None
            if slip.settling:
                assert slip.lost_at is None
                continue
            if result.slip[start - 1]:
                assert slip.lost_at == ALREADY_ON
                continue
            # The next slip ends the search.
            nexts = [round(s.start_s * RATE_HZ) for s in outcome.slips if s.start_s > slip.start_s]
            until = min([end + round(evaluation.tail_s * RATE_HZ), *nexts[:1], len(volts)])
            rises = np.flatnonzero(result.slip[start:until])
            if rises.size:  # the first goes on with an alarm that ended too shortly before it
                assert result.slip[start + rises[0] - off_rows : start + rises[0]].any()
                assert slip.lost_at == ALREADY_ON
                continue
            through = [bool(signal[start:until].any()) for signal in signals]
            assert slip.lost_at == STAGES[through.index(False) if False in through else 3]
            continue
        assert slip.lost_at is None
        rise = round(outcome.alarms[slip.alarm].start_s * RATE_HZ)
        assert slip.latency_s == pytest.approx((rise - start) / RATE_HZ)
        assert slip.late == (rise - start > 0.06 * RATE_HZ)
        if slip.stages_s is None:
            # Another rise came first, and went on with an alarm that was not over.
            assert rise < start or slip.on_at_start or result.slip[start:rise].any()
            continue
        assert list(slip.stages_s) == list(STAGES)
        assert sum(slip.stages_s.values()) == pytest.approx(slip.latency_s)
        assert min(slip.stages_s.values()) >= 0.0
        group = list(config.groups.values())[int(result.groups[rise].argmax())]
        columns = [channel - 1 for channel in group]
        # The end of a stage: where its signal first got through, or the next one did.
        ends = []
        for k in range(3):
            seen = np.any([s[start : rise + 1, columns] for s in signals[k:]], axis=(0, 2))
            ends.append(int(seen.argmax()) if seen.any() else rise - start)
        parts = np.diff([0, *ends, rise - start]) / RATE_HZ
        assert list(slip.stages_s.values()) == pytest.approx(parts.tolist())
