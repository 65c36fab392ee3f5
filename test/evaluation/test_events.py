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

"""The figures that a robot needs of slips and alarms."""

import dataclasses

import pytest

from slip_detector.evaluation.figures import (
    FALSE,
    REPEAT,
    SETTLING,
    STAGES,
    TRUE,
    Alarm,
    TrueSlip,
    event_figures,
)

SLIP = TrueSlip(
    start_s=1.0, end_s=2.0, alarm=0, latency_s=0.04, settling=False, lead_s=0.0, window_s=1.1,
    late=False,
    stages_s=dict(zip(STAGES, (0.01, 0.005, 0.02, 0.005), strict=True)), lost_at=None,
    on_at_start=False, on_while=True, channel_delays_s=(0.03, None), delay_s=0.03,
)  # fmt: skip
MISSED = dataclasses.replace(
    SLIP, alarm=None, latency_s=None, stages_s=None, lost_at='envelope', on_while=False
)


def test_figures_by_hand():
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
    alarms = [Alarm(1.0, 1.5, kind, None) for kind in kinds]
    figures = event_figures(slips, alarms, 30.0, 0.6)
    assert figures == pytest.approx(
        {
            'slips': 6, 'settling_slips': 1, 'matched': 3, 'late': 1, 'missed': 2,
            'alarms': 6, 'repeated_alarms': 1, 'false_alarms': 1, 'settling_alarms': 1,
            'recall': 0.6, 'recall_by_chance': 1.1 / 30.0,
            # After 0.04, 0.24 and -0.01 s, with a false alarm in 30 s; two are missed.
            'sooner_than_chance': (3.0 - 2.0 * 0.27 / 30.0 - 2.0 * 1.1 / 30.0) / 5.0,
            'precision': 0.75, 'precision_by_chance': 5.5 / 35.5,
            'rest_s': 30.0, 'false_alarms_per_minute': 2.0,
            'false_time_percent': 2.0, 'false_time_s_per_hour': 72.0,
            'latency_median_all_ms': 240.0,
            'latency_median_ms': 40.0, 'latency_p90_ms': 200.0, 'latency_worst_ms': 240.0,
            'filter_ms': 105.0, 'envelope_ms': 7.5, 'decision_ms': 20.0, 'vote_ms': 7.5,
            'late_filter_ms': 200.0, 'late_envelope_ms': 10.0, 'late_decision_ms': 20.0,
            'late_vote_ms': 10.0,
            'missed_at_filter': 0, 'missed_at_envelope': 1, 'missed_at_decision': 0,
            'missed_at_vote': 0, 'missed_already_on': 1,
        }
    )  # fmt: skip


def test_what_is_not_defined_is_none_not_zero():
    nothing = event_figures([], [], 0.0, 0.0)
    undefined = {name for name, value in nothing.items() if value is None}
    assert undefined == {
        'recall', 'recall_by_chance', 'sooner_than_chance', 'precision', 'precision_by_chance',
        'false_alarms_per_minute', 'false_time_percent', 'false_time_s_per_hour',
        'latency_median_all_ms', 'latency_median_ms', 'latency_p90_ms', 'latency_worst_ms',
        *(f'{lead}{stage}_ms' for lead in ('', 'late_') for stage in STAGES),
    }  # fmt: skip
    missed = event_figures([MISSED], [], 10.0, 0.0)
    assert (missed['recall'], missed['precision']) == (0.0, None)
    assert missed['false_alarms_per_minute'] == 0.0
    assert missed['latency_median_ms'] is None
    unknown = event_figures([dataclasses.replace(MISSED, lost_at=None)], [], 10.0, 0.0)
    assert unknown['missed_at_filter'] is None
    quiet = event_figures([], [Alarm(0.0, 1.0, FALSE, None)], 60.0, 1.0)
    assert (quiet['recall'], quiet['precision']) == (None, 0.0)
