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

"""Thresholds from quiet recordings: what rate of false alarms holds, and what is refused."""

import dataclasses

import numpy as np
import pytest

from slip_detector.evaluation.replay import Replay
from slip_detector.tuning.learning import learn_threshold
from support.tuning_cases import CHAIN, EVIDENCE, track, track_with

SURE = dataclasses.replace(EVIDENCE, evidence_offset_db=4.0)


def alarms_at(chain, recording):
    replay = Replay(chain)
    return len(replay.run(recording.rows(), recording.sample_rate_hz).alarms)


@pytest.mark.parametrize(('chain', 'vote'), [(CHAIN, 'all'), (SURE, 1)])
def test_the_rate_holds_in_the_recording_and_in_another_but_not_below_the_threshold(chain, vote):
    chain = dataclasses.replace(chain, vote=vote)
    recording = track(1, duration_s=600.0, slips=False)
    threshold, line = learn_threshold(recording, chain, 60.0)
    found = dataclasses.replace(chain, threshold=threshold)
    alarms = alarms_at(found, recording)
    assert f', {alarms} false alarms in 0.167 h: ' in line
    upper = float(line.split(' to ')[1].split(' an hour')[0])
    assert alarms / (1 / 6) <= upper <= 60.0
    other = track(2, duration_s=600.0, slips=False)
    assert alarms_at(found, other) <= 2 * 10
    lower = dataclasses.replace(found, threshold=threshold / 1.5)
    assert alarms_at(lower, recording) / (1 / 6) > 60.0


def test_a_recording_that_cannot_show_the_rate_is_refused():
    minute = track(5, duration_s=60.0, slips=False)
    noisy = dataclasses.replace(SURE, noise_floor=(1e-6,), noise_floor_range_db=10.0)
    silent = track_with(np.zeros((4560, 4)), name='seed 5')
    for recording, chain, per_hour, line in (
        (minute, CHAIN, 100.0, '5: lasts 0.0167 h, allowed: no slip, and at least 0.03 h to show'),
        (track(6), CHAIN, 1000.0, '6: has slip, allowed: no slip'),
        (minute, noisy, 200.0, '5: no threshold has that rate'),
        (silent, CHAIN, 1000.0, '5: no threshold has that rate'),
    ):
        with pytest.raises(ValueError, match=f'^seed {line}'):
            learn_threshold(recording, chain, per_hour)


def test_where_rest_makes_no_evidence_the_given_threshold_stays():
    surer = dataclasses.replace(SURE, noise_floor=(1.0,))
    found = learn_threshold(track(5, duration_s=60.0, slips=False), surer, 200.0)
    line = '0 false alarms in 0.0167 h: 0 to 180 an hour at 95% confidence'
    assert found == (surer.threshold, f'threshold {surer.threshold:g}, {line}')
