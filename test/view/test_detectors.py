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


"""What is known of a finger: its name, its state over a restart, its place; its parameters."""

import time

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view import detectors
from slip_detector.view.detectors import (
    OUTSIDE,
    RESTART,
    Finger,
    drawn_positions,
    least_distance_m,
)

NAME = '/index/slip_detector'


def test_another_threshold_keeps_track_and_rest_and_other_channels_begin_anew():
    finger = Finger(NAME, DetectorConfig())
    with pytest.raises(ValueError, match='index: too few samples'):
        finger.keep_rest()
    volts = np.random.default_rng(2).normal(size=(800, 16))
    finger.track.add_samples(Samples(volts, 1 + np.arange(800)))
    finger.keep_rest()
    track = finger.track
    finger.update_config(DetectorConfig(threshold=0.7))
    assert finger.track is track
    assert finger.rest.density_db.shape == (16, 380)
    finger.update_config(DetectorConfig(channels=8, groups={'a': range(1, 9)}))
    assert len(finger.track.samples) == 0
    assert finger.track.beginnings > track.beginnings
    assert (finger.groups.shape, finger.rest) == ((1,), None)


def test_a_restart_is_mentioned_for_some_minutes(monkeypatch):
    finger = Finger('/slip_detector', DetectorConfig())
    finger.slip = finger.valid = True
    finger.update_config(DetectorConfig(), RESTART)
    assert not finger.slip
    assert not finger.valid
    finger.no_volts = 'no volts are shown'
    words = 'no volts are shown; the detector was started again at '
    assert finger.description()['notice'].startswith(words)
    now_s = time.time()
    monkeypatch.setattr(detectors.time, 'time', lambda: now_s + detectors.RESTART_SHOWN_S)
    assert finger.description()['notice'] == 'no volts are shown'


def test_a_detector_that_is_not_heard_is_called_silent_after_some_heartbeats(monkeypatch):
    finger = Finger('/slip_detector', DetectorConfig(heartbeat_hz=1.0))
    now_s = time.monotonic()
    assert not finger.silence()
    monkeypatch.setattr(detectors.time, 'monotonic', lambda: now_s + 2.5)
    assert not finger.silence()
    monkeypatch.setattr(detectors.time, 'monotonic', lambda: now_s + 4.0)
    assert finger.silence().startswith('the detector has not been heard for 4 s: was it killed')


def test_channels_that_share_a_place_are_drawn_on_a_circle_around_it():
    places = [[0.0, 0.0, 0.0], [0.004, 0.0, 0.0], [0.004, 0.0, 0.0], [0.0, 0.008, 0.001]]
    config = DetectorConfig(channels=4, taxel_positions_m=np.ravel(places))
    wanted = [places[0], [0.003, 0.0, 0.0], [0.005, 0.0, 0.0], places[3]]
    assert drawn_positions(config) == pytest.approx(np.array(wanted), abs=1e-12)
    assert least_distance_m(drawn_positions(config)) == pytest.approx(0.002)


def test_undoing_again_and_again_leads_back_through_every_state():
    states = [
        DetectorConfig(threshold=1.0),
        DetectorConfig(threshold=2.0),
        DetectorConfig(threshold=2.0, channels=2, groups={'a': [1], 'b': [2]}),
        DetectorConfig(threshold=1.0, vote=1, channels=2, groups={'all': [1, 2]}),
    ]
    finger = Finger(NAME, states[0])
    for config in [*states, states[-1]]:
        finger.update_config(config, OUTSIDE)
    assert finger.count == 3
    while finger.to_undo():
        assert finger.config == states.pop()
        finger.update_config(finger.config.with_values(finger.to_undo()), OUTSIDE)
    assert [finger.config] == states


def test_restoring_the_file_sets_all_that_differs_and_can_be_set():
    finger = Finger(NAME, DetectorConfig(vote=2))
    assert finger.as_in_file() == {}
    finger.in_file = DetectorConfig(threshold=0.3, autostart=False)
    assert finger.as_in_file() == {'threshold': 0.3, 'vote': 'all'}


def test_values_lost_in_a_restart_are_reported_and_can_be_set_again_by_undo():
    finger = Finger(NAME, DetectorConfig())
    finger.update_config(DetectorConfig(threshold=0.3), OUTSIDE)
    finger.update_config(DetectorConfig(autostart=False), RESTART)
    assert finger.changes[-1].by == RESTART
    assert finger.to_undo() == {'threshold': 0.3}
    finger.update_config(finger.config.with_values(finger.to_undo()), OUTSIDE)
    assert finger.config.threshold == 0.3
    assert finger.to_undo() == {'threshold': 0.5}
