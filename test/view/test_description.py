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

"""What a page is told of the fingers: all of it can be sent, and is theirs."""

import json

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.description import diagnostics, finger_description, hand_description
from slip_detector.view.hand import Diagnosis, Finger
from support.simulated_hand import SimulatedHand

CONFIGS = [
    DetectorConfig(),
    DetectorConfig(channels=1, channel_names=('a',), disabled_channels=(), stopbands_hz=()),
    DetectorConfig(channels=3, disabled_channels=(2,), vote='mean', threshold=1e30),
    DetectorConfig(decision='evidence', noise_floor=(1e-3,), threshold=0.9, mains_hz=50.0),
]


@pytest.mark.parametrize('config', CONFIGS)
def test_a_finger_is_described_by_its_parameters_as_json_has_them(config):
    finger = Finger('/index/slip_detector', config)
    described = json.loads(json.dumps(finger_description(finger), allow_nan=False))
    assert described['channels'] == list(config.names)
    assert len(described['positions_m']) == config.channels
    assert described['disabled'] == list(config.disabled_channels)
    assert described['groups'] == {name: list(of) for name, of in config.groups.items()}
    for name in ('threshold', 'vote', 'decision', 'sample_rate_hz', 'mains_hz'):
        assert described[name] == getattr(config, name)


def test_fingers_stand_in_the_order_of_their_names_and_those_that_are_gone_beside_them():
    hand = SimulatedHand(('thumb', 'index', 'ring'))
    hand.remove('ring')
    described = hand_description(hand)
    assert [finger['label'] for finger in described['fingers']] == ['index', 'thumb']
    assert described['gone'] == {'/ring/slip_detector': 'ring'}


def test_what_each_detector_says_is_told_of_its_finger():
    hand = SimulatedHand(('index', 'thumb'))
    hand.fingers['/thumb/slip_detector'].diagnostics = (Diagnosis(2, 'input', 'no samples'),)
    told = diagnostics(hand)['fingers']
    assert told['/thumb/slip_detector'] == [[2, 'input', 'no samples']]
    assert told['/index/slip_detector'] == [[0, 'input', 'simulated samples']]
