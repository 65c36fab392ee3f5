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

import itertools
import os
import re
import time
from typing import NamedTuple

import pytest
import yaml

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameters import text_of
from support.browsers import PATIENCE_MS, expect
from support.training import gripped, pulled, tapped

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from std_msgs.msg import Bool  # noqa: E402

from support.harness import patient_state_qos  # noqa: E402

#: A search takes so long at most where other tests run beside it.
SEARCH_MS = 300_000


class Amount(NamedTuple):
    """How much is recorded: two rests, slips, taps, with their seconds."""

    rest_s: int
    slips: int
    slip_s: float
    taps_s: int


#: ``SLIP_LESSON=full pytest -s`` records as much as a person would, and says how long that took.
RECORDED = (
    Amount(20, 10, 2.0, 40) if os.environ.get('SLIP_LESSON') == 'full' else Amount(7, 6, 1.0, 12)
)

#: So long after a slip `slip` may still be ON, as filters and windows hold it.
TAIL_S = 0.3


class Played:
    """A driver that plays a scene, while the block lasts."""

    def __init__(self, bench, folder, name, description, seed):
        file = folder / f'{name}.yaml'
        file.write_text(yaml.safe_dump(description), encoding='utf-8')
        given = {'source': 'scene', 'scene': file, 'seed': seed, 'loop': 'true'}
        self._bench, self._given = bench, given

    def __enter__(self):
        self._driver = self._bench.start(
            'slip_driver', '-r', '__ns:=/index', parameters=self._given
        )
        return self._driver

    def __exit__(self, *_):
        self._driver.end()
        self._bench.processes.remove(self._driver)


def opened(bench, browser, view):
    """Open the page of a slip_view, and wait until its finger can be taught."""
    bench.wait_for(lambda: 'http://' in view.log(), 'the address')
    page = browser.new_page()
    page.goto(re.search(r'http://\S+', view.log()).group())
    expect(
        page.locator('#tools').get_by_role('button', name=re.compile(r'^Rest\b'))
    ).to_be_enabled(timeout=PATIENCE_MS)
    return page


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
    expect(page.get_by_role('row', name=re.compile(rf'\b{name}\b'))).to_be_visible()


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


def changes_of(bench, topic):
    """Return the list of when a topic has changed to what."""
    heard = []
    bench.subscribe(
        Bool, topic, lambda m: heard.append((time.monotonic(), m.data)), patient_state_qos()
    )
    return heard


def figures(changes, truth, until_s):
    """Return how many slips were found, and for how long slip was ON without one."""
    starts_s = [at_s for at_s, slip in truth if slip]
    spans = [(a, next((b for b, s in truth if b > a and not s), until_s)) for a in starts_s]
    edges = [*changes, (until_s, False)]
    on = [(a, b) for (a, slip), (b, _) in itertools.pairwise(edges) if slip]
    found = sum(any(a < end and b > start for a, b in on) for start, end in spans)
    wrong_s = sum(
        max(0.0, b - a)
        - sum(max(0.0, min(b, end + TAIL_S) - max(a, start)) for start, end in spans)
        for a, b in on
    )
    return found, wrong_s


def test_rest_slip_tap_tune_apply_save_and_the_saved_file_is_better_on_a_fresh_seed(
    bench, browser, tmp_path
):
    view = bench.start_python(
        '-m', 'slip_detector.nodes.view', '--port', '0', '--folder', str(tmp_path / 'taught')
    )
    bench.start('slip_detector', '-r', '__ns:=/index')
    truth = bench.listen(Bool, 'index/slip_truth', patient_state_qos())
    page = opened(bench, browser, view)
    finger = page.locator('.finger')

    begun_s = time.monotonic()
    with Played(bench, tmp_path, 'rest', at_once(gripped(600.0)), seed=1):
        expect(finger).not_to_have_attribute('data-state', 'noInput')
        recorded_for(page, 'r', 'rest_1', RECORDED.rest_s)
        recorded_for(page, 'r', 'rest_2', RECORDED.rest_s)
    with Played(bench, tmp_path, 'pulled', pulled(RECORDED.slips, RECORDED.slip_s), seed=2):
        press_by_truth(bench, page, truth, RECORDED.slips)
        last = page.get_by_role('row', name=re.compile(rf'\bslip_{RECORDED.slips}\b'))
        expect(last).to_be_visible(timeout=PATIENCE_MS)
    with Played(bench, tmp_path, 'taps', at_once(tapped(600.0)), seed=3):
        recorded_for(page, 't', 'taps_1', RECORDED.taps_s)

    recorded_s = time.monotonic()
    page.get_by_role('button', name='Tune', exact=True).click()
    expect(page.locator('.tuning-step')).to_contain_text('Done', timeout=SEARCH_MS)
    tuned_s = time.monotonic()
    apply = page.get_by_role('button', name=re.compile('^Apply'))
    apply.click()
    expect(page.locator('.teach-words')).to_contain_text('the detector runs with')
    page.get_by_role('tab', name='Parameters').click()
    tuned = DetectorConfig.from_yaml(tmp_path / 'taught' / 'index' / 'tuning' / 'tuned.yaml')
    threshold = page.locator('[data-name=threshold] input')
    expect(threshold).to_have_value(text_of(tuned.threshold))
    page.get_by_role('button', name='Save', exact=True).click()
    expect(page.locator('.saved')).to_contain_text('config:=')
    print(
        f'recorded in {recorded_s - begun_s:.0f} s, tuned in {tuned_s - recorded_s:.0f} s, '
        f'applied and saved in {time.monotonic() - tuned_s:.1f} s'
    )
    saved = tmp_path / 'taught' / 'index.yaml'
    assert DetectorConfig.from_yaml(saved).to_parameters() == tuned.to_parameters()
    page.close()

    figures_of_both = compared_on_a_fresh_seed(bench, tmp_path, saved)
    (found_before, wrong_before_s), (found_after, wrong_after_s) = figures_of_both
    assert found_after >= found_before
    assert found_after == RECORDED.slips
    assert wrong_after_s < 0.5 * wrong_before_s


def compared_on_a_fresh_seed(bench, folder, saved):
    """Run a detector as it was and one with the saved file on the same rows; return figures."""
    for name, words in (('before', ()), ('after', ('--params-file', str(saved)))):
        voltages = ('-r', 'voltages:=/index/voltages')
        bench.start('slip_detector', *words, '-r', f'__ns:=/{name}', *voltages)
    slips = [changes_of(bench, f'{name}/slip') for name in ('before', 'after')]
    truth = changes_of(bench, 'index/slip_truth')
    bench.wait_for(lambda: all(slips), 'both detectors')
    scene = pulled(RECORDED.slips, RECORDED.slip_s, seed_of_pauses=5)
    with Played(bench, folder, 'fresh', scene, seed=99):
        bench.wait_for(lambda: sum(slip for _, slip in truth) > RECORDED.slips, 'all slips')
    until_s = next(at_s for at_s, slip in truth[::-1] if slip)
    return [figures([c for c in one if c[0] < until_s], truth[:-1], until_s) for one in slips]
