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

"""What tests of pages in a browser need; the fixture ``browser`` runs one."""

import os

import pytest

from benchmarks.view.browser import why_no_browser

#: Longest time that a page may take to show something: discovery alone takes seconds.
PATIENCE_MS = 120_000

try:
    from playwright.sync_api import expect
except ImportError:  # Then no test gets as far as to need it: see require_browser.
    expect = None
else:
    expect.set_options(timeout=PATIENCE_MS)

__all__ = ['PATIENCE_MS', 'complaints_of', 'expect', 'require_browser']


def require_browser():
    """Skip a test where there is no browser; fail it if SLIP_NEED_BROWSER is 1."""
    missing = why_no_browser()
    if missing and os.environ.get('SLIP_NEED_BROWSER') == '1':
        pytest.fail(f'SLIP_NEED_BROWSER is 1 and the test {missing}')
    if missing:
        pytest.skip(missing)


def complaints_of(page, allowed):
    """Return a list that what a page complains of is put on, and what it asks of others.

    ``allowed`` is how the addresses begin that it may ask for something.
    """
    complaints = []
    page.on('console', lambda message: complaints.append(message.text))
    page.on('pageerror', lambda error: complaints.append(str(error)))
    page.on('requestfailed', lambda request: complaints.append(request.url))
    page.on('request', lambda r: r.url.startswith(allowed) or complaints.append(r.url))
    return complaints
