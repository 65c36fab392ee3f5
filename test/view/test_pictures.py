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

"""The pictures of the live page in the docs, made anew: what they show is really on the page.

With ``SLIP_FIGURES`` naming a folder they are written there; without it only one is made.
"""

import os
from pathlib import Path

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Diagnosis
from support import page_parts as parts
from support.browsers import expect
from support.finger_states import without_channel_7
from support.simulated_detectors import SimulatedDetectors
from support.training import write_recordings

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'slip_detector.yaml'

#: Seconds of the scene at which the finger slips, and at which it is at rest after a slip.
IN_SLIP_S, AT_REST_S = 4.9, 8.75

RATE_HZ = 380.0

#: Seconds after which the scene begins again.
ROUND_S = 9.6


def opened(serve, played_s, prepare=lambda *simulated: None):
    """Open a page on fingers that have played so many seconds of their scene."""
    detectors = SimulatedDetectors(tuple(played_s), DetectorConfig.from_yaml(CONFIG))
    fingers = [*detectors.simulated.values()]
    prepare(*fingers)
    for simulated, seconds in zip(fingers, played_s.values(), strict=True):
        simulated.play(seconds)
    return serve(detectors)[1]


def keep(page, name, tmp_path):
    """Write what is seen."""
    path = Path(os.environ.get('SLIP_FIGURES', tmp_path)) / f'view_{name}.png'
    # Only the folder is another one than a test's.
    page.locator('#recordings-folder, #save-folder').evaluate_all(
        """(places, [here, there]) => {
          for (const place of places) place.textContent = place.textContent.replace(here, there);
        }""",
        [str(tmp_path), '/home/robot/slip_view'],
    )
    page.screenshot(path=path)


def stay_in_slip(simulated, *others):
    """Let the first finger slip until its picture has been made, however long that takes."""
    play, most = simulated.play, round(6.0 * RATE_HZ)

    def play_on(seconds):
        if simulated.played % len(simulated.rows) > most:
            simulated.played -= round(1.5 * RATE_HZ)
        play(seconds)

    simulated.play = play_on


def lose_a_channel(simulated):
    simulated.play(AT_REST_S - 2.0)
    simulated.disturb = without_channel_7


def break_two(*simulated):
    stay_in_slip(*simulated)
    *_, fourth, fifth = simulated
    fourth.disturb = without_channel_7
    fifth.play = lambda seconds: None
    words = 'no samples yet: does the sensor run, on this topic, with this type?'
    fifth.finger.diagnostics = (Diagnosis(2, 'input', words),)


#: Seconds that each finger has played, in the order of their names.
FIVE = {
    'index': ROUND_S + IN_SLIP_S - 1.5, 'little': 6.8, 'middle': 0.5, 'ring': 7.0, 'thumb': 0.0,
}  # fmt: skip

#: By name of the picture: the seconds that each finger has played, how they are prepared, until
#: which second they play, and the states that are seen.
PICTURES = {
    'five': (FIVE, break_two, ROUND_S + IN_SLIP_S, ('slip', 'rest', 'rest', 'rest', 'noInput')),
    'rest': ({'index': AT_REST_S - 2.0}, lambda simulated: None, AT_REST_S, ('rest',)),
    'slip': ({'index': IN_SLIP_S - 1.5}, stay_in_slip, IN_SLIP_S, ('slip',)),
    'dead': ({'index': 0.0}, lose_a_channel, AT_REST_S, ('rest',)),
}


@pytest.mark.parametrize('name', PICTURES)
def test_signals(serve, tmp_path, name):
    if name != 'five' and 'SLIP_FIGURES' not in os.environ:
        pytest.skip('no SLIP_FIGURES')
    played_s, prepare, seen_s, states = PICTURES[name]
    page = opened(serve, played_s, prepare)
    if name == 'dead':
        page.get_by_role('button', name='LR', exact=True).click()
    parts.until(page, f'data.toS > {40 + seen_s}')
    for label, state in zip(played_s, states, strict=True):
        expect(parts.card(page, label)).to_have_attribute('data-state', state)
    keep(page, name, tmp_path)


@pytest.mark.skipif('SLIP_FIGURES' not in os.environ, reason='no SLIP_FIGURES')
def test_teaching(serve, tmp_path):
    write_recordings(tmp_path / 'index', slips=3)
    page = opened(serve, {'index': 9.5})  # It slips again at 13.4 s.
    now = parts.recording_now(page)
    expect(parts.recording(page, 'taps_1')).to_be_visible()
    expect(page.locator('.recording-trace').last).to_contain_text('ON for')
    page.keyboard.down(' ')
    parts.until(page, f'data.toS > {40 + ROUND_S + IN_SLIP_S}')
    expect(now).to_contain_text('SLIP')
    keep(page, 'teach', tmp_path)
    page.keyboard.up(' ')
