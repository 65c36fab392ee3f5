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

"""A browser without a screen, which opens the live page."""

import contextlib
import importlib
import importlib.util
import shutil
from collections.abc import Iterator
from typing import Any

#: Names of browsers that can run without a screen.
BROWSERS = ('chromium-headless-shell', 'chromium', 'google-chrome')

#: Options of the browser: no screen, and no requests of its own.
FLAGS = ('--headless', '--no-sandbox', '--disable-gpu', '--disable-background-networking')

#: Milliseconds within which a page must have been drawn.
PATIENCE_MS = 60_000.0


def why_no_browser() -> str:
    """Return why no page can be opened; empty if one can."""
    if importlib.util.find_spec('playwright') is None:
        return 'needs the Python package playwright'
    if not any(map(shutil.which, BROWSERS)):
        return f'needs a browser: one of {", ".join(BROWSERS)}'
    return ''


@contextlib.contextmanager
def browser(*more_flags: str) -> Iterator[Any]:
    """Run the system's browser, with more flags; see :func:`why_no_browser` first."""
    # By name, as Playwright may be missing (see why_no_browser).
    sync_playwright = importlib.import_module('playwright.sync_api').sync_playwright
    path = next(path for path in map(shutil.which, BROWSERS) if path)
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=path, args=[*FLAGS, *more_flags])
        try:
            yield running
        finally:
            running.close()
