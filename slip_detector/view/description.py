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

"""The messages that describe the fingers to a page: configurations and diagnostics."""

from typing import Any

from slip_detector.view.hand import Finger, Hand
from slip_detector.view.taxels import drawn_positions


def hand_description(hand: Hand) -> dict[str, Any]:
    """Return the content of the message ``hand``: all fingers and their configurations.

    Returns
    -------
    dict
        ``fingers``: a description of each, sorted by name; ``gone``: labels, by name, of the
        fingers whose detectors have ended.
    """
    fingers = sorted(hand.fingers.values(), key=lambda finger: finger.name)
    return {'fingers': [finger_description(finger) for finger in fingers], 'gone': hand.gone}


def finger_description(finger: Finger) -> dict[str, Any]:
    """Return the description of a finger: its channels, its groups and its decision.

    Examples
    --------
    >>> from slip_detector.parameters.detector import DetectorConfig
    >>> finger = Finger('/index/slip_detector', DetectorConfig(channels=2))
    >>> described = finger_description(finger)
    >>> described['label'], described['channels'], described['groups']
    ('index', ['ch1', 'ch2'], {'all': [1, 2]})
    """
    config = finger.config
    return {
        'name': finger.name,
        'label': finger.label,
        'starts': finger.starts,
        'notice': finger.notice,
        'channels': list(config.names),
        'positions_m': drawn_positions(config).tolist(),
        'disabled': list(config.disabled_channels),
        'groups': {name: list(members) for name, members in config.groups.items()},
        'vote': config.vote,
        'decision': config.decision,
        'threshold': config.threshold,
        'sample_rate_hz': config.sample_rate_hz,
        'input_timeout_s': config.input_timeout_s,
        'passband_hz': list(config.passband_hz),
        'stopbands_hz': [list(pair) for pair in config.stopbands_hz],
        'mains_hz': config.mains_hz,
    }


def diagnostics(hand: Hand) -> dict[str, Any]:
    """Return the content of the message ``diagnostics``: what each detector reports."""
    return {
        'fingers': {
            finger.name: [list(each) for each in finger.diagnostics]
            for finger in hand.fingers.values()
        }
    }
