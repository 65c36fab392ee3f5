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

"""What is known of a finger: its name for people, its state over a restart, its silence."""

import asyncio
import time

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view import detectors
from slip_detector.view.detectors import Finger
from support.simulated_detectors import SimulatedDetectors


@pytest.mark.parametrize(
    ('name', 'label'),
    [
        ('/index/slip_detector', 'index'),
        ('/left/index/slip_detector', 'left/index'),
        ('/slip_detector', 'slip_detector'),
        ('/index/second', 'index/second'),
        ('/second', 'second'),
    ],
)
def test_a_finger_is_called_by_its_namespace(name, label):
    assert Finger(name, DetectorConfig()).label == label


def test_a_change_of_the_decision_keeps_the_track_and_other_channels_begin_a_new_one():
    finger = Finger('/slip_detector', DetectorConfig())
    finger.track.add_samples(np.array([1]), np.zeros((1, 16)), np.zeros(1))
    track = finger.track
    finger.update_config(DetectorConfig(threshold=0.7))
    assert finger.track is track
    finger.update_config(DetectorConfig(channels=8, groups={'a': range(1, 9)}))
    assert len(finger.track.samples) == 0
    assert finger.track.beginnings > track.beginnings
    assert finger.groups.shape == (1,)


def test_for_some_minutes_a_finger_says_that_its_detector_started_again_and_with_what(
    monkeypatch,
):
    finger = Finger('/slip_detector', DetectorConfig())
    finger.slip = finger.valid = True
    finger.started_again(DetectorConfig())
    assert 'started again' in finger.notice
    assert 'channels' not in finger.notice
    assert not finger.slip
    assert not finger.valid
    finger.started_again(DetectorConfig(channels=8))
    assert finger.notice.endswith('with 8 channels instead of 16')
    assert finger.starts == 3
    # Its parameters may be read before it publishes.
    finger.update_config(DetectorConfig())
    finger.no_volts = 'no volts are shown'
    finger.started_again(DetectorConfig())
    assert finger.notice.startswith('no volts are shown; the detector was started again at ')
    assert finger.notice.endswith('with 16 channels instead of 8')
    now_s = time.monotonic()
    monkeypatch.setattr(detectors.time, 'monotonic', lambda: now_s + detectors.RESTART_SHOWN_S)
    assert finger.notice == 'no volts are shown'


def test_a_detector_that_is_not_heard_is_called_silent_after_some_heartbeats(monkeypatch):
    finger = Finger('/slip_detector', DetectorConfig(heartbeat_hz=1.0))
    now_s = time.monotonic()
    assert not finger.silence()
    monkeypatch.setattr(detectors.time, 'monotonic', lambda: now_s + 2.5)
    assert not finger.silence()
    monkeypatch.setattr(detectors.time, 'monotonic', lambda: now_s + 4.0)
    assert finger.silence() == (
        'the detector has not been heard for 4 s: was it killed, or stopped?'
    )


def test_a_pages_name_is_cut_to_the_length_of_real_ones():
    simulated = SimulatedDetectors(real_time=False)
    (name,) = simulated.fingers
    by = f'page {"x" * 10_000}'
    asyncio.run(simulated.change(name, {'threshold': 0.25}, by))
    assert simulated.panel(name).changes[-1].by == by[: detectors.LONGEST_NAME]
    with pytest.raises(ValueError, match='threshold is -1'):
        asyncio.run(simulated.change(name, {'threshold': -1}, by))
    asyncio.run(simulated.change(name, {'threshold': 0.5}, 'page 7'))
    assert simulated.panel(name).changes[-1].by == 'page 7'
