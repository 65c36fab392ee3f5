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

"""The live page in a real browser: its connection, and a page that may only look."""

import threading
import time

from slip_detector.view.access import Access
from slip_detector.view.server import NO_TOKEN
from support.browsers import PATIENCE_MS, expect
from support.lessons import write_lesson
from support.page_parts import card, config_of, recording_now, threshold_line, tool
from support.simulated_detectors import SimulatedDetectors, served_beside


def wait_for_a_new_frame(page):
    page.evaluate(
        "document.querySelectorAll('[data-state]').forEach((e) => delete e.dataset.state)"
    )
    page.locator('[data-state]').first.wait_for(state='attached')


def wait_until(holds, what):
    end_s = time.monotonic() + PATIENCE_MS / 1e3
    while not holds():
        assert time.monotonic() < end_s, what
        time.sleep(0.02)


def test_when_slip_view_ends_the_page_says_so_and_connects_again_by_itself(browser):
    page = browser.new_page()
    with served_beside(SimulatedDetectors(), access=Access(token='word')) as served:
        page.goto(served.url)
        wait_for_a_new_frame(page)
        # The first words are shown for a second, which a busy machine may not see.
        page.evaluate("""() => {
          const words = document.getElementById('connection');
          window.shown = [];
          new MutationObserver(() => shown.push(words.textContent))
            .observe(words, {childList: true, characterData: true, subtree: true});
        }""")
    words = page.locator('#connection')
    expect(words).to_contain_text('slip_view cannot be reached')
    assert page.evaluate('shown[0]').startswith('slip_view was stopped')
    # What is shown of the finger is old, and it does not look as if it were not.
    expect(card(page)).to_have_attribute('data-state', 'lost')
    expect(card(page)).to_contain_text('not connected')
    port = int(served.url.split(':')[2].partition('/')[0])
    with served_beside(SimulatedDetectors(('thumb',)), access=Access(token='word'), port=port):
        expect(words).to_have_text('connected')
        expect(page.get_by_role('heading', name='thumb', exact=True)).to_be_visible()
        wait_for_a_new_frame(page)
    with served_beside(SimulatedDetectors(), access=Access(token='another'), port=port):
        expect(words).to_contain_text(NO_TOKEN)
        page.close()


def test_a_slip_view_that_hangs_is_told_from_one_that_has_nothing_new(open_page):
    with served_beside(SimulatedDetectors()) as served:
        page = open_page(served)
        words = page.locator('#connection')
        goes_on = threading.Event()
        hanging = threading.Thread(target=served.call, args=(goes_on.wait, PATIENCE_MS / 1e3))
        hanging.start()
        try:
            expect(words).to_have_text('slip_view does not answer')
            expect(card(page)).to_have_attribute('data-state', 'lost')
        finally:
            goes_on.set()
            hanging.join()
        expect(words).to_have_text('connected')
        expect(card(page)).not_to_have_attribute('data-state', 'lost')


def test_a_hidden_page_asks_for_nothing_and_goes_on_when_it_is_seen_or_loaded_again(open_page):
    detectors = SimulatedDetectors()
    with served_beside(detectors) as served:
        page = open_page(served)

        def watched():
            return served.call(lambda: set(detectors.watched))

        wait_until(watched, 'the page to look')
        hide = """(hidden) => {
            Object.defineProperty(document, 'hidden', {value: hidden, configurable: true});
            document.dispatchEvent(new Event('visibilitychange'));
        }"""
        page.evaluate(hide, True)
        wait_until(lambda: not watched(), 'the page to look at nothing')
        page.evaluate(hide, False)
        wait_until(watched, 'the page to look again')
        wait_for_a_new_frame(page)
        page.reload()
        wait_for_a_new_frame(page)


def test_a_page_that_may_only_look_can_change_nothing_in_any_tab(serve, open_page, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    detectors = SimulatedDetectors()
    before = detectors.fingers['/index/slip_detector'].config
    served = serve(detectors, access=Access(read_only=True))
    page = open_page(served)
    for name in ('Rest', 'Slip', 'Taps', 'Tune', 'Delete slip_1', 'Save'):
        expect(tool(page, name)).to_be_disabled()
    page.keyboard.press('r')
    expect(recording_now(page)).to_contain_text('--read-only')
    threshold_line(page).focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    expect(threshold_line(page)).to_have_attribute('aria-valuetext', 'threshold 0.5')
    page.get_by_role('tab', name='Parameters').click()
    expect(page.locator('#parameters')).to_contain_text('--read-only')
    expect(tool(page, 'Set')).to_be_disabled()
    expect(page.locator('#parameters form :is(input, select):enabled')).to_have_count(0)
    page.get_by_role('tab', name='Spectrum').click()
    edge = page.get_by_role('slider', name='Pass-band, low edge')
    expect(edge).to_have_attribute('aria-disabled', 'true')
    for name in ('Add stop-band', 'Remove stop-band 1'):
        expect(page.get_by_role('button', name=name)).to_be_disabled()
    assert config_of(served) == before
    assert not (tmp_path / 'index' / 'rest_3').exists()
