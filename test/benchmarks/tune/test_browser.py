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

"""The browser that opens pages."""

from benchmarks.tune import browser
from support.browsers import require_browser


def test_a_system_without_a_browser_is_told_which_would_do(monkeypatch):
    monkeypatch.setattr(browser.importlib.util, 'find_spec', lambda name: object())
    monkeypatch.setattr(browser.shutil, 'which', lambda name: None)
    assert browser.why_no_browser() == f'needs a browser: one of {", ".join(browser.BROWSERS)}'


def test_a_python_without_playwright_is_told_so(monkeypatch):
    monkeypatch.setattr(browser.importlib.util, 'find_spec', lambda name: None)
    assert browser.why_no_browser() == 'needs the Python package playwright'


def test_the_time_until_a_page_is_drawn_is_what_the_page_says(tmp_path):
    require_browser()
    page = tmp_path / 'page.html'
    page.write_text('<html data-ready-ms="12.5"><body>drawn</body></html>')
    assert browser.ready_ms(page) == 12.5
