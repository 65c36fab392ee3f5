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

"""The figures of several recordings together."""

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.chain.settling import settling_rows
from slip_detector.evaluation.figures import FALSE, TRUE, figures_of_merit
from slip_detector.evaluation.replay import Replay
from support.replay_cases import CONFIG, RATE_HZ, ridges


def labelled(*slips, others=()):
    """Return rows with ridges, of which the label calls only some slip."""
    volts, _ = ridges(*slips, *others)
    _, truth = ridges(*slips)
    return Samples.evenly(volts, RATE_HZ, truth)


def test_figures_of_several_are_those_of_their_events_and_rows_together():
    replay = Replay(CONFIG)
    slips = (400, 600), (1400, 1600)
    a, b = replay.run([labelled(*slips)]), replay.run([labelled(*slips, others=[(900, 950)])])
    pooled = figures_of_merit([a, b])
    assert pooled['slips'] == 4
    assert [alarm.kind for alarm in b.alarms] == [TRUE, FALSE, TRUE]
    assert pooled['precision'] == 0.8
    assert pooled['rows'] == 4000
    settling = 2 * max(settling_rows(CONFIG), 40)
    assert pooled['settling_rows'] == settling
    # Of each slip 200 rows and 40 of its tail are no rest.
    rest_rows = 4000 - 4 * 240 - settling
    assert pooled['rest_s'] == rest_rows / RATE_HZ
    assert pooled['false_alarms_per_minute'] == pytest.approx(60.0 * RATE_HZ / rest_rows)
    assert pooled['recall_by_chance'] == pytest.approx(240 / rest_rows)
    assert pooled['false_time_percent'] == pytest.approx(100.0 * b.on_rest_rows / rest_rows)
    latencies = [1e3 * slip.latency_s for one in (a, b) for slip in one.slips]
    assert pooled['latency_worst_ms'] == max(latencies)
    assert pooled['latency_median_ms'] == pytest.approx(np.median(latencies))


def test_the_paper_counts_each_row_without_slip_and_false_time_those_of_the_rest():
    outcome = Replay(CONFIG).run([labelled((400, 600))])
    figures = figures_of_merit([outcome])
    # After the slip the chain is ON while its windows hold it, which is not false.
    assert figures['false_positive_percent'] == 100.0 * outcome.on_rows / 1800 > 0.0
    assert figures['false_time_percent'] == 0.0


def test_nothing_is_lost_with_a_recording_without_rows():
    replay = Replay(CONFIG)
    whole, empty = replay.run([labelled((400, 600))]), replay.run([])
    assert figures_of_merit([whole, empty]) == figures_of_merit([whole])
    nothing = figures_of_merit([empty])
    for name in ('recall', 'auc_all', 'success_percent', 'false_positive_percent'):
        assert nothing[name] is None
