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

"""The connection of the live page in a real browser, with simulated fingers."""

import threading
import time

from slip_detector.view.access import Access
from slip_detector.view.server import NO_TOKEN
from support.browsers import expect
from support.simulated_hand import SimulatedHand, served_beside

PATIENCE_MS = 60_000


def drawn(page):
    """Wait until a frame is drawn that is newer than all so far."""
    page.evaluate(
        "document.querySelectorAll('[data-state]').forEach((e) => delete e.dataset.state)"
    )
    page.locator('[data-state]').first.wait_for(state='attached', timeout=PATIENCE_MS)


def until(holds, what):
    """Wait until something holds."""
    end_s = time.monotonic() + PATIENCE_MS / 1e3
    while not holds():
        assert time.monotonic() < end_s, what
        time.sleep(0.02)


def test_the_page_connects_and_shows_each_finger(open_page):
    with served_beside(SimulatedHand(('index', 'thumb'))) as served:
        page = open_page(served)
        for label in ('index', 'thumb'):
            expect(page.get_by_role('heading', name=label, exact=True)).to_be_visible()
        expect(page.locator('[data-finger]').first).to_contain_text('valid', timeout=PATIENCE_MS)


def test_when_slip_view_ends_the_page_says_so_and_connects_again_by_itself(browser):
    page = browser.new_page()
    with served_beside(SimulatedHand(), access=Access(token='word')) as served:
        page.goto(served.url)
        drawn(page)
        # The first words are shown for a second, which a busy machine may not see.
        page.evaluate("""() => {
          const words = document.getElementById('connection');
          window.shown = [];
          new MutationObserver(() => shown.push(words.textContent))
            .observe(words, {childList: true, characterData: true, subtree: true});
        }""")
    words = page.locator('#connection')
    expect(words).to_contain_text('slip_view cannot be reached', timeout=PATIENCE_MS)
    assert page.evaluate('shown[0]').startswith('slip_view was stopped')
    # What is shown of the finger is old, and it does not look as if it were not.
    card = page.locator('[data-finger]')
    expect(card).to_have_attribute('data-state', 'lost')
    expect(card).to_contain_text('not connected')
    port = int(served.url.split(':')[2].partition('/')[0])
    with served_beside(SimulatedHand(('thumb',)), access=Access(token='word'), port=port):
        expect(words).to_have_text('connected', timeout=PATIENCE_MS)
        expect(page.get_by_role('heading', name='thumb', exact=True)).to_be_visible(
            timeout=PATIENCE_MS
        )
        drawn(page)
    with served_beside(SimulatedHand(), access=Access(token='another'), port=port):
        expect(words).to_contain_text(NO_TOKEN, timeout=PATIENCE_MS)
        page.close()


def test_a_slip_view_that_hangs_is_told_from_one_that_has_nothing_new(open_page):
    with served_beside(SimulatedHand()) as served:
        page = open_page(served)
        words, card = page.locator('#connection'), page.locator('[data-finger]')
        goes_on = threading.Event()
        hanging = threading.Thread(target=served.call, args=(goes_on.wait, PATIENCE_MS / 1e3))
        hanging.start()
        try:
            expect(words).to_have_text('slip_view does not answer', timeout=PATIENCE_MS)
            expect(card).to_have_attribute('data-state', 'lost')
        finally:
            goes_on.set()
            hanging.join()
        expect(words).to_have_text('connected', timeout=PATIENCE_MS)
        expect(card).not_to_have_attribute('data-state', 'lost')


def test_a_page_that_was_loaded_again_goes_on(open_page):
    with served_beside(SimulatedHand()) as served:
        page = open_page(served)
        for _ in range(3):
            page.reload()
            drawn(page)


def test_without_its_token_the_page_is_not_shown(browser):
    with served_beside(SimulatedHand(), access=Access(token='word')) as served:
        page = browser.new_page()
        page.goto(served.url.partition('?')[0])
        expect(page.locator('body')).to_have_text(NO_TOKEN)
        page.close()


def test_another_site_in_the_same_browser_cannot_connect(browser):
    with served_beside(SimulatedHand()) as served, served_beside(SimulatedHand()) as other:
        page = browser.new_page()
        page.goto(f'{other.url}page/icon.svg')
        address = served.url.replace('http', 'ws') + 'live'
        outcome = """(address) => new Promise((done) => {
            const socket = new WebSocket(address);
            socket.onopen = () => done('open');
            socket.onerror = () => done('refused');
        })"""
        # Of another port is another origin; a page of the policy of ours may not even ask.
        assert page.evaluate(outcome, address) == 'refused'
        page.goto('about:blank')
        assert page.evaluate(outcome, address) == 'refused'
        page.close()


def test_a_page_that_is_hidden_looks_at_nothing_and_goes_on_when_it_is_seen_again(open_page):
    hand = SimulatedHand()
    with served_beside(hand) as served:
        page = open_page(served)

        def watched():
            return served.call(lambda: set(hand.watched))

        until(watched, 'the page to look')
        hide = """(hidden) => {
            Object.defineProperty(document, 'hidden', {value: hidden, configurable: true});
            document.dispatchEvent(new Event('visibilitychange'));
        }"""
        page.evaluate(hide, True)
        until(lambda: not watched(), 'the page to look at nothing')
        page.evaluate(hide, False)
        until(watched, 'the page to look again')
        drawn(page)
