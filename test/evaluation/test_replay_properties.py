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

import itertools

import numpy as np
import pytest
from evaluation.reference_scores import Stretch, area, figures, runs
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.compiled import COMPILED
from slip_detector.evaluation import replay as replay_module
from slip_detector.evaluation.figures import ALREADY_ON, STAGES, decision_figures, figures_of_merit
from slip_detector.evaluation.replay import Replay, only_filters
from support.recorded import stretches_of
from support.replay_cases import plain
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings

SOME = settings(max_examples=60 if COMPILED else 5, deadline=None)


def cut(pieces, cuts):
    """Cut pieces at further places."""
    for piece in pieces:
        n = len(piece.volts)
        for a, b in itertools.pairwise(sorted({0, n, *(place % n for place in cuts)})):
            yield piece.take(slice(a, b))._replace(new_stretch=piece.new_stretch and not a)


@SOME
@given(
    recordings(),
    chains(),
    EVALUATIONS,
    st.lists(st.integers(0, 1200), max_size=6),
    st.integers(1, 500),
)
def test_any_cut_of_the_rows_gives_the_same_outcome(pieces, config, evaluation, cuts, block_rows):
    replay = Replay(config, evaluation)
    whole = replay.run(stretches_of(pieces), RATE_HZ)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay_module, 'BLOCK_VALUES', block_rows * config.channels)
        assert plain(replay.run(cut(pieces, cuts), RATE_HZ)) == plain(whole)


@SOME
@given(recordings(), chains(), EVALUATIONS)
def test_figures_are_those_of_an_independent_scorer(pieces, config, evaluation):
    outcome = Replay(config, evaluation).run(pieces, RATE_HZ)
    found = figures_of_merit([outcome])
    chain, parts, columns = SlipChain(config), [], []
    for number, part in enumerate(stretches_of(pieces)):
        if number:
            chain.restart()
        result = chain.update(part.volts, votes=(config.vote,))
        scored = result.slip, part.truth, settling_rows(config), evaluation, RATE_HZ
        parts.append(Stretch(*scored))
        moving = np.zeros(len(part.truth), bool) if part.moving is None else part.moving
        statistic = result.vote_statistic[:, 0]
        settled = np.arange(len(part.truth)) >= parts[-1].settling_rows
        columns.append((*scored[:2], moving, statistic, settled, result.valid))
    on, truth, moving, statistic, settled, valid = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    expected = figures(parts) | {'rows': len(on), 'slip_rows': int(truth.sum())}
    sooner = expected['sooner_than_chance']
    if sooner is not None and min(abs(sooner), abs(sooner - 0.5)) < 1e-9:
        # Whether latencies are defined is up to round-off.
        expected = {k: v for k, v in expected.items() if not k.startswith('latency')}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert found['moving_rows'] in (None, int(moving.sum()))
    for against, auc in ((~truth, 'auc_all'), (~truth & moving, 'auc_moving')):
        wanted, error = area(statistic, truth & settled, against & settled)
        assert found[auc] == (None if wanted is None else pytest.approx(wanted, abs=error))
    enabled = [c for c in range(config.channels) if c + 1 not in config.disabled_channels]
    invalid = np.count_nonzero(~valid, axis=0) * np.isin(range(config.channels), enabled)
    assert outcome.invalid_rows == tuple(invalid)
    decided = decision_figures([outcome])
    assert decided['onsets'] == sum(len(runs(part_on)) for part_on, *_ in columns)
    assert decided['on_s'] == pytest.approx(on.sum() / RATE_HZ)
    assert decided['invalid_channels'] == np.count_nonzero(invalid)


@SOME
@given(recordings(), chains(), EVALUATIONS)
def test_the_parts_of_a_latency_sum_to_it_and_end_where_their_stage_passes(
    pieces, config, evaluation
):
    whole = stretches_of(pieces)[0]
    outcome = Replay(config, evaluation).run([whole], RATE_HZ)
    evidence = config.decision == 'evidence'
    result = SlipChain(config).update(whole.volts, floor=evidence)
    filtered = SlipChain(only_filters(config)).update(whole.volts).envelope
    least = config.threshold
    if evidence:
        least = 10.0 ** ((result.floor + config.evidence_offset_db) / 20.0)
    signals = [
        signal & result.valid
        for signal in (filtered > least, result.envelope > least, result.channels)
    ]
    settled = max(settling_rows(config), round(evaluation.off_before_s * RATE_HZ))
    for slip in outcome.slips:
        start, end = round(slip.start_s * RATE_HZ), round(slip.end_s * RATE_HZ)
        # The next slip ends the search.
        nexts = [round(s.start_s * RATE_HZ) for s in outcome.slips if s.start_s > slip.start_s]
        until = min([end + round(evaluation.tail_s * RATE_HZ), *nexts[:1], len(result.slip)])
        already_on = start > 0 and bool(result.slip[start - 1])
        first = start + np.flatnonzero(result.slip[start:until])[:1]
        found = slip.alarm is not None
        rise = round(outcome.alarms[slip.alarm].start_s * RATE_HZ) if found else None
        assert (slip.settling, slip.on_at_start) == (start < settled, already_on)
        assert slip.latency_s == (pytest.approx((rise - start) / RATE_HZ) if found else None)
        assert slip.late == (found and rise - start > round(evaluation.late_after_s * RATE_HZ))
        through = [bool(signal[start:until].any()) for signal in signals]
        lost_at = STAGES[[*through, False].index(False)]
        # The first rise may go on with an alarm that ended too shortly before it.
        lost_at = ALREADY_ON if already_on or first.size else lost_at
        assert slip.lost_at == (None if found or slip.settling else lost_at)
        if already_on or [rise] != [*first]:
            assert slip.stages_s is None
            continue
        group = list(config.groups.values())[int(result.groups[rise].argmax())]
        columns = [channel - 1 for channel in group]
        # The end of a stage: where its signal first got through, or the next one did.
        ends = []
        for k in range(3):
            seen = np.any([s[start : rise + 1, columns] for s in signals[k:]], axis=(0, 2))
            ends.append(int(seen.argmax()) if seen.any() else rise - start)
        parts = np.diff([0, *ends, rise - start]) / RATE_HZ
        assert min(parts) >= 0.0
        assert slip.stages_s == pytest.approx(dict(zip(STAGES, parts, strict=True)))
