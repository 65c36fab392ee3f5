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

"""Replaying a recording in pieces against a plain evaluation of the whole."""

import dataclasses
import itertools
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.settling import settling_rows
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.evaluation import replay as replay_module
from slip_detector.evaluation.events import ALREADY_ON, SETTLING, STAGES, TRUE
from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.evaluation.outcome import figures_of_merit
from slip_detector.evaluation.paper_figures import first_on_delay_s
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig

RATE_HZ = 400.0
CONFIG = ChainConfig(
    sample_rate_hz=RATE_HZ,
    channels=4,
    groups={'a': (1, 2), 'b': (3, 4)},
    passband_hz=(20.0, 100.0),
    stopbands_hz=(),
    gain=1.0,
    envelope_window_s=0.02,
    decision_window_s=0.02,
    threshold=0.3,
)


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
        yield LabelledRows(volts[a:b], truth[a:b], stamps_ns[a:b], new, moving[a:b])


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


def plain(outcome):
    """Return an outcome as something that can be compared."""
    scores = outcome.scores
    rest = dataclasses.replace(outcome, scores=None)
    return rest, scores.classes.tolist(), scores.counts.tolist()


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
    whole = [LabelledRows(volts, truth)]
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


def ridges(*bursts, n=2000, seed=0):
    """Return rows with ridges from row to row, and their label."""
    rng = np.random.default_rng(seed)
    volts, truth = 1e-3 * rng.normal(size=(n, 4)), np.zeros(n, bool)
    time_s = np.arange(n) / RATE_HZ
    for start, end in bursts:
        volts[start:end] += 2.0 * np.sin(2 * np.pi * 50.0 * (time_s[start:end, np.newaxis]))
        truth[start:end] = True
    return volts, truth


def test_two_slips_with_one_alarm_are_one_detected_and_one_that_found_it_on():
    volts, truth = ridges((400, 800))
    truth[600:604] = False
    outcome = Replay(CONFIG).run([LabelledRows(volts, truth)])
    first, second = outcome.slips
    assert [alarm.kind for alarm in outcome.alarms] == [TRUE]
    assert (first.alarm, first.on_at_start, first.lost_at) == (0, False, None)
    assert (second.alarm, second.on_at_start, second.lost_at) == (None, True, ALREADY_ON)
    assert second.on_while
    assert figures_of_merit([outcome])['recall'] == 0.5
    assert figures_of_merit([outcome])['missed_already_on'] == 1


def test_a_slip_that_goes_on_after_a_gap_is_no_easy_one_that_begins_there():
    volts, truth = ridges((400, 1200))
    stamps_ns = np.round(np.arange(2000) * 1e9 / RATE_HZ).astype(np.int64)
    stamps_ns[800:] += 3_000_000_000
    pieces = [
        LabelledRows(volts[:800], truth[:800], stamps_ns[:800]),
        LabelledRows(volts[800:], truth[800:], stamps_ns[800:], new_stretch=True),
    ]
    outcome = Replay(CONFIG).run(pieces)
    assert [slip.start_s for slip in outcome.slips] == [1.0, 5.0]
    assert [slip.end_s for slip in outcome.slips] == [2.0, 6.0]
    assert [alarm.kind for alarm in outcome.alarms] == [TRUE, SETTLING]
    assert [slip.settling for slip in outcome.slips] == [False, True]
    assert 0.0 < outcome.slips[0].latency_s < 0.1
    assert (outcome.slips[1].alarm, outcome.slips[1].lost_at) == (None, None)
    assert outcome.duration_s == 5.0
    figures = figures_of_merit([outcome])
    assert (figures['slips'], figures['matched'], figures['missed']) == (2, 1, 0)
    assert (figures['settling_slips'], figures['settling_alarms']) == (1, 1)
    assert figures['settling_rows'] == 2 * max(settling_rows(CONFIG), 40)
    assert figures['recall'] == 1.0


def test_a_clock_that_was_set_back_does_not_turn_time_back():
    volts, truth = ridges((400, 600), (1400, 1600))
    stamps_ns = np.round(np.arange(2000) * 1e9 / RATE_HZ).astype(np.int64)
    pieces = [
        LabelledRows(volts[:1000], truth[:1000], stamps_ns[1000:]),
        LabelledRows(volts[1000:], truth[1000:], stamps_ns[:1000], new_stretch=True),
    ]
    outcome = Replay(CONFIG).run(pieces)
    assert [slip.start_s for slip in outcome.slips] == [1.0, 3.5]
    assert figures_of_merit([outcome])['matched'] == 2


def test_the_recordings_own_rate_turns_rows_into_times():
    volts, truth = ridges((400, 600))
    ours = Replay(CONFIG).run([LabelledRows(volts, truth)])
    its = Replay(CONFIG).run([LabelledRows(volts, truth)], sample_rate_hz=RATE_HZ / 1.01)
    assert its.slips[0].start_s == pytest.approx(1.01 * ours.slips[0].start_s)
    assert its.slips[0].latency_s == pytest.approx(1.01 * ours.slips[0].latency_s)
    # The tail of the slip and off_before_s are times too.
    assert (ours.settling_rows, its.settling_rows) == (max(settling_rows(CONFIG), 40), 40)
    assert (ours.rest_rows, its.rest_rows) == (2000 - 240 - ours.settling_rows, 2000 - 240 - 40)


def test_late_is_later_than_the_limit():
    volts, truth = ridges((400, 600))
    latency_s = Replay(CONFIG).run([LabelledRows(volts, truth)]).slips[0].latency_s
    for limit_s, late in ((latency_s, False), (latency_s - 1 / RATE_HZ, True)):
        config = EvaluationConfig(late_after_s=limit_s)
        outcome = Replay(CONFIG, config).run([LabelledRows(volts, truth)])
        assert outcome.slips[0].late == late
        assert (figures_of_merit([outcome])['late_filter_ms'] is None) == (not late)


def test_a_replay_used_again_remembers_nothing():
    volts, truth = ridges((400, 600))
    replay = Replay(CONFIG)
    first = replay.run([LabelledRows(volts[:500], truth[:500])])
    again = replay.run([LabelledRows(volts[:500], truth[:500])])
    assert plain(first) == plain(again)


def test_what_is_not_asked_for_is_undefined_and_the_rest_is_the_same():
    volts, truth = ridges((400, 600), (1000, 1001))
    whole = figures_of_merit([Replay(CONFIG).run([LabelledRows(volts, truth)])])
    lean = Replay(CONFIG, scores=False, stages=False)
    bare = figures_of_merit([lean.run([LabelledRows(volts, truth)])])
    differ = {name for name in whole if whole[name] != bare[name]}
    assert whole['missed'] == 1
    assert differ == {
        'auc_all',
        *(f'{stage}_ms' for stage in STAGES),
        *(f'missed_at_{stage}' for stage in STAGES),
        'missed_already_on',
    }
    assert {bare[name] for name in differ} == {None}


class Witness:
    def __init__(self):
        self.volts, self.slip, self.truth, self.gaps = [], [], [], []

    def add(self, volts, result, truth):
        assert result.level.shape == volts.shape
        self.volts.append(volts)
        self.slip.append(result.slip)
        self.truth.append(truth)

    def gap(self, seconds):
        self.gaps.append((sum(map(len, self.volts)), seconds))


@pytest.mark.parametrize('scores', [True, False])
def test_who_looks_on_sees_all_rows_and_gaps(scores):
    volts, truth = ridges((400, 600))
    stamps_ns = np.round(np.arange(2000) * 1e9 / RATE_HZ).astype(np.int64)
    stamps_ns[800:] += 3_000_000_000
    witness = Witness()
    pieces = [
        LabelledRows(volts[:800], truth[:800], stamps_ns[:800]),
        LabelledRows(volts[800:], truth[800:], stamps_ns[800:], new_stretch=True),
    ]
    Replay(CONFIG, scores=scores).run(pieces, observer=witness)
    np.testing.assert_array_equal(np.concatenate(witness.volts), volts)
    np.testing.assert_array_equal(np.concatenate(witness.truth), truth)
    expected = [SlipChain(CONFIG).update(part).slip for part in (volts[:800], volts[800:])]
    np.testing.assert_array_equal(np.concatenate(witness.slip), np.concatenate(expected))
    assert witness.gaps == [(800, 3.0)]


def test_a_label_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r'truth has the shape \(3,\), allowed: \(4,\)'):
        Replay(CONFIG).run([LabelledRows(np.zeros((4, 4)), np.zeros(3, bool))])


def test_memory_does_not_grow_with_the_rows():
    volts, truth = ridges((400, 600))
    replay = Replay(CONFIG)

    def peak(pieces):
        tracemalloc.start()
        try:
            replay.run(LabelledRows(volts, truth) for _ in range(pieces))
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(1)
    more = 200 if COMPILED else 10
    growth = peak(2 + more) - peak(2)
    # For each slip and its alarm there are some numbers for each channel.
    assert growth < more * 4000
    assert growth < 0.1 * more * volts.nbytes
