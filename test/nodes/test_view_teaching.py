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


"""From a sensor that nobody has seen to a saved configuration, on the page, with real nodes."""

import re

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameters import text_of
from support.browsers import PATIENCE_MS, expect
from support.page_parts import record_button, recording, tab, tool

#: A search takes so long at most where other tests run beside it.
SEARCH_MS = 300_000


#: Seconds of rest, taps and slips that are recorded, number of slips.
REST_S, TAPS_S, SLIP_S, SLIPS = 6, 10, 4, 4


def wait_until_it_has(page, name, seconds):
    at_least = '|'.join(map(str, range(seconds, 10 * seconds)))
    expect(page.locator('.teach-now')).to_have_text(re.compile(rf'{name}: ({at_least})\.'))


def recorded_for(page, key, name, seconds):
    """Record with a key until so many seconds are in it."""
    page.keyboard.press(key)
    wait_until_it_has(page, name, seconds)
    page.keyboard.press(key)
    expect(recording(page, name)).to_be_visible()


def test_rest_slip_taps_tune_apply_and_save_with_a_simulated_finger_that_obeys(
    bench, browser, tmp_path
):
    folder = tmp_path / 'taught'
    _, address = bench.start_view('--folder', str(folder), '--scene', 'obedient')
    page = browser.new_page()
    page.goto(address)
    expect(record_button(page, 'Rest')).to_be_enabled(timeout=PATIENCE_MS)
    finger = page.locator('.finger')
    expect(finger).to_have_attribute('data-state', re.compile('rest|slip'))
    recorded_for(page, 'r', 'rest_1', REST_S)
    recorded_for(page, 'r', 'rest_2', REST_S)
    for k in range(1, SLIPS + 1):
        page.keyboard.down(' ')
        wait_until_it_has(page, f'slip_{k}', SLIP_S)
        page.keyboard.up(' ')
        expect(recording(page, f'slip_{k}')).to_be_visible()
    recorded_for(page, 't', 'taps_1', TAPS_S)

    tool(page, 'Tune').click()
    searching = re.compile(r'([2-9]\d|[1-3]\d\d) of')
    expect(page.locator('.tuning-step')).to_have_text(searching, timeout=SEARCH_MS)
    page.locator('#stop-tuning').click()
    expect(page.locator('.tuning-step')).to_contain_text('Done', timeout=SEARCH_MS)
    page.locator('#apply').click()
    expect(page.locator('.teach-words')).to_contain_text('the detector runs with')
    expect(finger).to_have_attribute('data-state', 'rest')
    page.keyboard.down(' ')
    expect(finger).to_have_attribute('data-state', 'slip')
    page.keyboard.up(' ')
    expect(finger).to_have_attribute('data-state', 'rest')
    tab(page, 'Parameters').click()
    tuned = DetectorConfig.from_yaml(folder / 'scene' / 'index' / 'tuning' / 'tuned.yaml')
    threshold = page.locator('[data-name=threshold] input')
    expect(threshold).to_have_value(text_of(tuned.threshold))
    tool(page, 'Save').click()
    expect(page.locator('.saved')).to_contain_text('config:=')
    saved = folder / 'scene_index.yaml'
    assert DetectorConfig.from_yaml(saved).to_parameters() == tuned.to_parameters()
    page.close()
