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

"""The measurement of a report's size and of the time until it is drawn."""

from benchmarks.tune import browser, report_size
from support.browsers import require_browser


def test_the_report_of_minutes_is_small_and_opens():
    require_browser()
    result = report_size.measure_report(180.0)
    assert 1e6 < result['bytes'] < 10e6
    assert result['ready_ms'] > 0.0
    assert result['skipped'] == ''


def test_without_a_browser_only_the_size_is_measured(monkeypatch):
    monkeypatch.setattr(browser.shutil, 'which', lambda name: None)
    result = report_size.measure_report(20.0)
    assert result['bytes'] > 1e5
    assert result['ready_ms'] is None
    assert 'chromium-headless-shell' in result['skipped'] or 'playwright' in result['skipped']
