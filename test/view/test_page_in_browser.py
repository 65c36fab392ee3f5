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

"""The live page in a real browser, with simulated fingers."""

import os

import pytest

from benchmarks.tune import browser as system_browser
from support.simulated_hand import SimulatedHand, served_beside

try:
    from playwright.sync_api import expect
except ImportError:
    expect = None

MISSING = system_browser.why_no_browser()

pytestmark = pytest.mark.skipif(
    bool(MISSING) and os.environ.get('SLIP_NEED_BROWSER') != '1', reason=MISSING
)


@pytest.fixture(scope='module')
def browser():
    if MISSING:
        pytest.fail(f'SLIP_NEED_BROWSER is 1 and the live page {MISSING}')
    with system_browser.browser() as running:
        yield running


def test_the_page_connects_and_shows_each_finger(browser):
    complaints = []
    with served_beside(SimulatedHand(('index', 'thumb'))) as served:
        page = browser.new_page()
        page.on('console', lambda message: complaints.append(message.text))
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.on('requestfailed', lambda request: complaints.append(request.url))
        page.on('request', lambda r: r.url.startswith(served.url) or complaints.append(r.url))
        page.goto(served.url)
        for label in ('index', 'thumb'):
            expect(page.get_by_role('heading', name=label)).to_be_visible()
        expect(page.locator('[data-finger]').first).to_contain_text('valid', timeout=60_000)
        page.close()
    assert not complaints
