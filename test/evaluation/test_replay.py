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

"""Replaying recordings of ridges: slips, alarms, an observer, and figures by hand."""

import dataclasses
import tracemalloc
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.compiled import COMPILED
from slip_detector.evaluation.events import LASTING, NO_EVENTS
from slip_detector.evaluation.figures import ALREADY_ON, STAGES, TrueSlip, figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.recordings.labels import label_times
from support.replay_cases import CONFIG, RATE_HZ, ridges


@given(
    late=st.tuples(st.integers(-110, 110), st.integers(-110, 110)),
    accuracy_s=st.sampled_from([0.3, 0.35]),
)
def test_labels_that_are_off_within_their_accuracy_change_no_figure(late, accuracy_s):
    volts, _ = ridges((800, 1400))
    edges_ns = np.rint((np.array([800, 1400]) + late) * 1e9 / RATE_HZ).astype(np.int64)
    stamps_ns = Samples.evenly(volts, RATE_HZ, np.zeros(2000)).stamps_ns
    label = label_times(stamps_ns, edges_ns, accuracy_s)
    rows = Samples(volts, stamps_ns, **label, accuracy_s=accuracy_s)
    pieces = [rows.take(slice(900)), rows.take(slice(900, None))]
    figures = figures_of_merit([Replay(CONFIG).run(pieces)])
    assert (figures['matched'], figures['late'], figures['false_alarms']) == (1, 0, 0)
    assert (figures['coverage'], figures['auc_all'], figures['false_time_percent']) == (1, 1, 0)
    assert figures['latency_median_ms'] == 0.0
    assert figures['latency_accuracy_ms'] == 1e3 * accuracy_s


def test_the_recordings_own_rate_turns_rows_into_times():
    volts, truth = ridges((400, 600))
    rows = [Samples.evenly(volts, RATE_HZ, truth)]
    ours = Replay(CONFIG).run(rows)
    its = Replay(CONFIG).run(rows, sample_rate_hz=RATE_HZ / 1.01)
    assert its.slips[0].start_s == pytest.approx(1.01 * ours.slips[0].start_s)
    assert its.slips[0].latency_s == pytest.approx(1.01 * ours.slips[0].latency_s)
    # The tail of the slip and off_before_s are times too.
    assert (ours.settling_rows, its.settling_rows) == (max(settling_rows(CONFIG), 40), 40)
    rest_rows = RATE_HZ * ours.events.rest[0, 0], RATE_HZ / 1.01 * its.events.rest[0, 0]
    assert rest_rows == pytest.approx((2000 - 240 - ours.settling_rows, 2000 - 240 - 40))


def test_noise_in_short_clips_is_told_from_noise_as_by_guessing():
    # Evidence of noise grows from 0 to near its limit; these rows, as rest, would give 0.513.
    chain = dataclasses.replace(
        CONFIG, decision='evidence', passband_hz=(7.0, 50.0), exponent=1, noise_floor=0.25,
        noise_floor_learnt=True, evidence_offset_db=1.0, envelope_window_s=0.04,
        evidence_limit_db_s=0.2, threshold=0.05,
    )  # fmt: skip
    random, replay, areas = np.random.default_rng(1), Replay(chain), []
    for _ in range(40 if COMPILED else 5):
        slips = random.choice(np.arange(2, 10), 3, replace=False)
        truth = np.isin(np.arange(2000) // 200, slips)
        noise = Samples.evenly(random.standard_normal((2000, 4)), RATE_HZ, truth)
        areas.append(replay.run([noise]).scores.auc())
    assert abs(np.mean(areas) - 0.5) < 3.0 * np.std(areas) / np.sqrt(len(areas))


def test_an_observer_receives_all_rows_and_gaps():
    volts, truth = ridges((400, 600))
    whole = Samples.evenly(volts, RATE_HZ, truth)
    after = whole.take(slice(800, None))
    later = after._replace(stamps_ns=after.stamps_ns + 3_000_000_000, new_stretch=True)
    witness = mock.Mock()
    Replay(CONFIG).run([whole.take(slice(800)), later], observer=witness)
    rows, results, labels = zip(*(call.args for call in witness.add.mock_calls), strict=True)
    np.testing.assert_array_equal(np.concatenate(rows), volts)
    np.testing.assert_array_equal(np.concatenate(labels), truth)
    expected = [SlipChain(CONFIG).update(part).slip for part in (volts[:800], volts[800:])]
    found = np.concatenate([result.slip for result in results])
    np.testing.assert_array_equal(found, np.concatenate(expected))
    # A block ends before a slip.
    assert int(truth.argmax()) in np.cumsum([*map(len, rows)])
    witness.gap.assert_called_once_with(3.0)


def test_memory_does_not_grow_with_the_rows():
    volts, truth = ridges((400, 600))
    replay = Replay(CONFIG)

    def peak(pieces):
        tracemalloc.start()
        try:
            replay.run(Samples.evenly(volts, RATE_HZ, truth) for _ in range(pieces))
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(1)
    more = 200 if COMPILED else 10
    growth = peak(2 + more) - peak(2)
    # For each slip and its alarm there are some numbers for each channel.
    assert growth < more * 4000
    assert growth < 0.1 * more * volts.nbytes


NOTHING = Replay(ChainConfig()).run([])


def slip(stages_ms=None, **changes):
    """Return a slip with a latency in these parts; without any its alarm rises before it."""
    stages_s = stages_ms and dict(zip(STAGES, np.array(stages_ms) / 1e3, strict=True))
    latency_s = sum(stages_s.values()) if stages_s else -0.01
    known = TrueSlip(
        start_s=1.0, end_s=2.0, alarm=0, latency_s=latency_s, accuracy_s=0.0, settling=False,
        late=latency_s > 0.1, stages_s=stages_s, lost_at=None, on_at_start=False,
    )  # fmt: skip
    return dataclasses.replace(known, **changes)


def outcome(slips, kind, certain, rest):
    """Return the outcome of a recording of a kind; times in s, times ON, and false alarms."""
    lasting = np.zeros_like(NO_EVENTS.lasting)
    lasting[[0, LASTING.index(kind)], :, 0] = certain, rest
    events = dataclasses.replace(NO_EVENTS, lasting=lasting)
    return dataclasses.replace(NOTHING, slips=tuple(slips), events=events)


def test_figures_of_events_by_hand():
    missed = {'alarm': None, 'latency_s': None}
    first = [slip((10, 5, 20, 5)), slip((200, 10, 20, 10))]
    then = [slip(lost_at=lost_at, **missed) for lost_at in ('envelope', ALREADY_ON)]
    then += [slip(), slip(settling=True, **missed)]
    found = figures_of_merit(
        [
            outcome(first, 'rest', (3.0, 2.5, 0), (10.0, 0.6, 0)),
            outcome(then, 'press', (1.0, 0.5, 0), (20.0, 0.0, 1)),
        ]
    )
    expected = {
        'coverage': 0.75, 'latency_accuracy_ms': 0.0,
        'filter_ms': 105.0, 'envelope_ms': 7.5, 'decision_ms': 20.0, 'vote_ms': 7.5,
        'late_filter_ms': 200.0, 'late_envelope_ms': 10.0, 'late_decision_ms': 20.0,
        'late_vote_ms': 10.0,
        'missed_at_filter': 0, 'missed_at_envelope': 1, 'missed_at_decision': 0,
        'missed_at_vote': 0, 'missed_already_on': 1,
        'rest_on_percent': 6.0, 'rest_alarms_per_minute': 0.0,
        'press_on_percent': 0.0, 'press_alarms_per_minute': 3.0, 'taps_on_percent': None,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == pytest.approx(expected)
