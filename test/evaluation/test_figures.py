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

"""The figures of slips and alarms, of one recording and of several."""

import dataclasses

import numpy as np
import pytest

from slip_detector.evaluation.events import LASTING, NO_EVENTS
from slip_detector.evaluation.figures import (
    FALSE,
    REPEAT,
    SETTLING,
    STAGES,
    TRUE,
    Alarm,
    ReplayOutcome,
    TrueSlip,
    event_figures,
    mean_and_sd,
    paper_figures,
)
from slip_detector.evaluation.scores import ScoreCounts

SLIP = TrueSlip(
    start_s=1.0, end_s=2.0, alarm=0, latency_s=0.04, accuracy_s=0.0, settling=False, late=False,
    stages_s=dict(zip(STAGES, (0.01, 0.005, 0.02, 0.005), strict=True)), lost_at=None,
    on_at_start=False, on_while=True, channel_delays_s=(0.03, None), delay_s=0.03,
)  # fmt: skip
MISSED = dataclasses.replace(
    SLIP, alarm=None, latency_s=None, stages_s=None, lost_at='envelope', on_while=False
)


def events(kind, certain, rest):
    """Return the events of a recording of a kind, without slips."""
    lasting = np.zeros_like(NO_EVENTS.lasting)
    lasting[[0, LASTING.index(kind)], :, 0] = certain, rest
    return dataclasses.replace(NO_EVENTS, lasting=lasting)


def outcome(slips=(), kinds=(), of=NO_EVENTS, rows=0, on_rows=0):
    """Return the outcome of a recording with 10 rows a second, none of them called slip."""
    return ReplayOutcome(
        rows=rows, slip_rows=0, moving_rows=None, on_rows=on_rows, settling_rows=0,
        sample_rate_hz=10.0, slips=tuple(slips),
        alarms=tuple(Alarm(1.0, 1.5, kind, None) for kind in kinds),
        events=of, scores=ScoreCounts.pooled([]),
    )  # fmt: skip


def test_figures_of_events_by_hand():
    late = dataclasses.replace(
        SLIP,
        latency_s=0.24,
        late=True,
        stages_s=dict(zip(STAGES, (0.2, 0.01, 0.02, 0.01), strict=True)),
    )
    early = dataclasses.replace(SLIP, latency_s=-0.01, stages_s=None)
    begun = dataclasses.replace(MISSED, settling=True, lost_at=None)
    already_on = dataclasses.replace(MISSED, lost_at='already_on')
    slips = [SLIP, late, MISSED, already_on, early, begun]
    kinds = (TRUE, TRUE, TRUE, REPEAT, FALSE, SETTLING)
    # The one false alarm is in the 20 s of the second.
    outcomes = [
        outcome(slips[:2], kinds[:1], events('rest', (3.0, 2.5, 0), (10.0, 0.6, 0))),
        outcome(slips[2:], kinds[1:], events('press', (1.0, 0.5, 0), (20.0, 0.0, 1))),
    ]
    # All others are those of an independent scorer, see test_replay_properties.py.
    expected = pytest.approx(
        {
            'coverage': 0.75, 'latency_accuracy_ms': 0.0,
            'filter_ms': 105.0, 'envelope_ms': 7.5, 'decision_ms': 20.0, 'vote_ms': 7.5,
            'late_filter_ms': 200.0, 'late_envelope_ms': 10.0, 'late_decision_ms': 20.0,
            'late_vote_ms': 10.0,
            'missed_at_filter': 0, 'missed_at_envelope': 1, 'missed_at_decision': 0,
            'missed_at_vote': 0, 'missed_already_on': 1,
            'rest_on_percent': 6.0, 'rest_alarms_per_minute': 0.0,
            'press_on_percent': 0.0, 'press_alarms_per_minute': 3.0,
            **{f'{kind}_{what}': None for kind in ('taps', 'roll', 'idle')
               for what in ('on_percent', 'alarms_per_minute')},
        }
    )  # fmt: skip
    found = event_figures(outcomes)
    assert {name: found[name] for name in expected.expected} == expected


def test_the_figures_of_the_paper_by_hand():
    assert mean_and_sd([]) == mean_and_sd([None]) == (None, None)
    assert mean_and_sd([None, 0.02]) == (0.02, None)
    slips = [
        dataclasses.replace(SLIP, delay_s=delay_s, on_while=on_while)
        for delay_s, on_while in ((0.03, True), (0.05, False), (None, True), (0.04, True))
    ]
    assert paper_figures([outcome(slips, rows=60, on_rows=3)]) == pytest.approx(
        {
            'mean_delay_ms': 40.0,
            'sd_delay_ms': 10.0,  # n - 1
            'success_percent': 75.0,
            'false_positive_percent': 5.0,
        }
    )
    assert set(paper_figures([]).values()) == {None}
