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

"""The figures of slips and alarms that no independent scorer computes, by hand."""

import dataclasses

import numpy as np
import pytest

from slip_detector.evaluation.events import LASTING, NO_EVENTS
from slip_detector.evaluation.figures import (
    ALREADY_ON,
    STAGES,
    TrueSlip,
    figures_of_merit,
)
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig

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
