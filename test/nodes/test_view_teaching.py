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

import contextlib
import re

import yaml
from std_msgs.msg import Bool

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameters import text_of
from support.browsers import PATIENCE_MS, expect
from support.harness import patient_state_qos
from support.page_parts import record_button, recording, tab, tool
from support.training import gripped, pulled, tapped

#: A search takes so long at most where other tests run beside it.
SEARCH_MS = 300_000


#: Seconds of rest and taps that are recorded, number of slips.
REST_S, TAPS_S, SLIPS = 6, 10, 4


@contextlib.contextmanager
def played(bench, folder, name, description, seed):
    """Play a scene with a driver while the block lasts."""
    file = folder / f'{name}.yaml'
    file.write_text(yaml.safe_dump(description), encoding='utf-8')
    given = {'source': 'scene', 'scene': file, 'seed': seed, 'loop': 'true'}
    driver = bench.start('slip_driver', '-r', '__ns:=/index', parameters=given)
    yield
    driver.end()
    bench.processes.remove(driver)


def at_once(description):
    """The same scene, with the object in the grip from the beginning."""
    return {**description, 'steps': [{'duration_s': 0.1, 'force_n': 0.4}, {'duration_s': 600.0}]}


def recorded_for(page, key, name, seconds):
    """Record with a key until so many seconds are in it."""
    page.keyboard.press(key)
    at_least = '|'.join(map(str, range(seconds, 10 * seconds)))
    now = page.locator('.teach-now')
    expect(now).to_have_text(re.compile(rf'{name}: ({at_least})\.'))
    page.keyboard.press(key)
    expect(recording(page, name)).to_be_visible()


def press_by_truth(bench, page, truth, slips):
    """Press the space bar whenever the scene slips."""
    seen = len(truth)
    ended = 0
    is_down = False
    while ended < slips:
        bench.wait_for(lambda: len(truth) > seen, 'the next slip')  # noqa: B023
        for message in truth[seen:]:
            seen += 1
            if message.data and not is_down:
                page.keyboard.down(' ')
            elif is_down and not message.data:
                page.keyboard.up(' ')
                ended += 1
            is_down = message.data


def test_rest_slip_taps_tune_apply_and_save(bench, browser, tmp_path):
    _, address = bench.start_view('--folder', str(tmp_path / 'taught'))
    bench.start('slip_detector', '-r', '__ns:=/index')
    truth = bench.listen(Bool, 'index/slip_truth', patient_state_qos())
    page = browser.new_page()
    page.goto(address)
    expect(record_button(page, 'Rest')).to_be_enabled(timeout=PATIENCE_MS)
    finger = page.locator('.finger')

    with played(bench, tmp_path, 'rest', at_once(gripped(600.0)), seed=1):
        expect(finger).not_to_have_attribute('data-state', 'noInput')
        recorded_for(page, 'r', 'rest_1', REST_S)
        recorded_for(page, 'r', 'rest_2', REST_S)
    with played(bench, tmp_path, 'pulled', pulled(SLIPS), seed=2):
        press_by_truth(bench, page, truth, SLIPS)
        expect(recording(page, f'slip_{SLIPS}')).to_be_visible(timeout=PATIENCE_MS)
    with played(bench, tmp_path, 'taps', at_once(tapped(600.0)), seed=3):
        recorded_for(page, 't', 'taps_1', TAPS_S)

    tool(page, 'Tune').click()
    searching = re.compile(r'searching: ([2-9]\d|1\d\d) of')
    expect(page.locator('.tuning-step')).to_have_text(searching, timeout=SEARCH_MS)
    page.locator('#stop-tuning').click()
    expect(page.locator('.tuning-step')).to_contain_text('Done', timeout=SEARCH_MS)
    page.locator('#apply').click()
    expect(page.locator('.teach-words')).to_contain_text('the detector runs with')
    tab(page, 'Parameters').click()
    tuned = DetectorConfig.from_yaml(tmp_path / 'taught' / 'index' / 'tuning' / 'tuned.yaml')
    threshold = page.locator('[data-name=threshold] input')
    expect(threshold).to_have_value(text_of(tuned.threshold))
    tool(page, 'Save').click()
    expect(page.locator('.saved')).to_contain_text('config:=')
    saved = tmp_path / 'taught' / 'index.yaml'
    assert DetectorConfig.from_yaml(saved).to_parameters() == tuned.to_parameters()
    page.close()
