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

"""The live page in a browser without a screen."""

import os
import time

import pytest

from benchmarks.tune import browser as system_browser

MISSING = system_browser.why_no_browser()


@pytest.fixture(scope='module')
def browser():
    """Return the system's browser; where it may lack, what needs it is skipped."""
    if MISSING and os.environ.get('SLIP_NEED_BROWSER') == '1':
        pytest.fail(f'SLIP_NEED_BROWSER is 1 and the live page {MISSING}')
    if MISSING:
        pytest.skip(MISSING)
    with system_browser.browser() as running:
        yield running


@pytest.fixture
def open_page(browser):
    """Return what opens the page of a served hand; what it complains of fails the test.

    Nothing may be asked of any other address.
    """
    complaints, pages = [], []

    def open_(served, width=1366, height=768):
        page = browser.new_page(viewport={'width': width, 'height': height})
        pages.append(page)
        origin = served.url.partition('?')[0]
        page.on('console', lambda message: complaints.append(message.text))
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.on('requestfailed', lambda request: complaints.append(request.url))
        page.on('request', lambda r: r.url.startswith(origin) or complaints.append(r.url))
        page.goto(served.url)
        page.locator('[data-state]').first.wait_for(state='attached', timeout=60_000)
        return page

    yield open_
    for page in pages:
        page.close()
    assert complaints == []


def until(condition, deadline_s=60.0):
    """Wait until a condition holds, and return what it gave."""
    end_s = time.monotonic() + deadline_s
    while not (found := condition()):
        assert time.monotonic() < end_s, 'it did not come'
        time.sleep(0.02)
    return found
