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

"""The system's browser, without a screen, for tests that open pages in it.

The fixture ``browser`` in ``test/conftest.py`` gives it to a test.
"""

import contextlib
import os

import pytest

from benchmarks.tune import browser as system_browser

try:
    from playwright.sync_api import expect
except ImportError:  # The fixture skips, or fails, before it is needed.
    expect = None

#: Discovery takes seconds now and then, and a page waits for its turn beside other tests.
PATIENCE_MS = 120_000


@contextlib.contextmanager
def browser_or_skip():
    """Run the browser; where there is none skip the test, or fail it where one has to be."""
    missing = system_browser.why_no_browser()
    if missing and os.environ.get('SLIP_NEED_BROWSER') == '1':
        pytest.fail(f'SLIP_NEED_BROWSER is 1 and the page {missing}')
    if missing:
        pytest.skip(missing)
    expect.set_options(timeout=PATIENCE_MS)
    try:
        with system_browser.browser() as running:
            yield running
    finally:
        expect.set_options(timeout=None)
