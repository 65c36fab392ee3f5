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
from slip_detector.view import hand
from slip_detector.view.hand import Finger
from support.simulated_hand import SimulatedHand


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
    finger.track.take_samples(np.array([1]), np.zeros((1, 16)), np.zeros(1))
    track = finger.track
    finger.take_config(DetectorConfig(threshold=0.7))
    assert finger.track is track
    finger.take_config(DetectorConfig(channels=8, groups={'a': range(1, 9)}))
    assert len(finger.track.samples) == 0
    assert finger.track.beginnings > track.beginnings
    assert finger.groups.shape == (1,)


def test_a_detector_that_is_started_again_says_so_and_with_which_channels():
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
    finger.take_config(DetectorConfig())
    finger.started_again(DetectorConfig())
    assert finger.notice.endswith('with 16 channels instead of 8')


def test_that_a_detector_was_started_again_is_no_news_for_ever(monkeypatch):
    finger = Finger('/slip_detector', DetectorConfig())
    finger.no_volts = 'no volts are shown'
    finger.started_again(DetectorConfig())
    assert finger.notice.startswith('no volts are shown; the detector was started again at ')
    now_s = time.monotonic()
    monkeypatch.setattr(hand.time, 'monotonic', lambda: now_s + hand.RESTART_TOLD_S)
    assert finger.notice == 'no volts are shown'


def test_a_detector_that_is_not_heard_is_called_silent_after_some_heartbeats(monkeypatch):
    finger = Finger('/slip_detector', DetectorConfig(heartbeat_hz=1.0))
    now_s = time.monotonic()
    assert not finger.silent_words()
    monkeypatch.setattr(hand.time, 'monotonic', lambda: now_s + 2.5)
    assert not finger.silent_words()
    monkeypatch.setattr(hand.time, 'monotonic', lambda: now_s + 4.0)
    assert finger.silent_words() == (
        'the detector has not been heard for 4 s: was it killed, or stopped?'
    )


def test_of_the_name_of_a_page_no_more_is_kept_than_pages_have():
    simulated = SimulatedHand(real_time=False)
    (name,) = simulated.fingers
    by = f'page {"x" * 10_000}'
    asyncio.run(simulated.change(name, {'threshold': 0.25}, by))
    assert simulated.panel(name).changes[-1].by == by[: hand.LONGEST_NAME]
    with pytest.raises(ValueError, match='threshold is -1'):
        asyncio.run(simulated.change(name, {'threshold': -1}, by))
    asyncio.run(simulated.change(name, {'threshold': 0.5}, 'page 7'))
    assert simulated.panel(name).changes[-1].by == 'page 7'
