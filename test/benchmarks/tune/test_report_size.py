"""The measurement of a report's size and of the time until it is drawn."""

import os

import pytest

from benchmarks.tune import browser, report_size

MISSING = browser.why_no_browser()


@pytest.mark.skipif(bool(MISSING) and os.environ.get('SLIP_NEED_BROWSER') != '1', reason=MISSING)
def test_the_report_of_ten_minutes_is_small_and_opens():
    assert MISSING == ''
    result = report_size.measure_report(600.0)
    assert 1e6 < result['bytes'] < 10e6
    assert result['ready_ms'] > 0.0
    assert result['skipped'] == ''


def test_without_a_browser_only_the_size_is_measured(monkeypatch):
    monkeypatch.setattr(browser.shutil, 'which', lambda name: None)
    result = report_size.measure_report(20.0)
    assert result['bytes'] > 1e5
    assert result['ready_ms'] is None
    assert 'chromium-headless-shell' in result['skipped'] or 'playwright' in result['skipped']
