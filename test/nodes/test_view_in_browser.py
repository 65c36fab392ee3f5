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

"""What happens to real nodes, on the page of a real slip_view, in a real browser."""

import signal

import pytest

from support.browsers import PATIENCE_MS, complaints_of, expect


@pytest.fixture
def page(bench, browser):
    """The page of a slip_view; what it complains of, or asks of others, fails the test."""
    view, address = bench.start_view()
    page = browser.new_page()
    page.set_default_timeout(PATIENCE_MS)
    complaints = complaints_of(page, address)
    page.goto(address)
    yield page
    page.close()
    assert complaints == []
    assert 'Traceback' not in view.log()


def words(place, text):
    expect(place).to_contain_text(text)


def test_each_fault_of_driver_and_detector_is_told_in_words(bench, page):
    words(page.locator('#no-finger'), 'detector')
    index = ('-r', '__ns:=/index')
    detector = bench.start('slip_detector', *index)
    card = page.locator('[data-finger="/index/slip_detector"]')
    words(card, 'no sample has come yet')
    words(card.locator('.diagnostics'), 'no samples yet: does the sensor run')
    given = {'source': 'scene', 'loop': 'true'}
    driver = bench.start('slip_driver', *index, parameters=given)
    words(card.locator('.badge'), 'SLIP')
    words(card.locator('.badge'), 'rest')
    driver.signal(signal.SIGSTOP)
    words(card, 'no sample for')
    words(card.locator('.diagnostics'), 'is the sensor plugged in, does its driver run?')
    driver.signal(signal.SIGCONT)
    words(card.locator('.diagnostics'), '380.0 samples a second')
    words(card.locator('.badge'), 'SLIP')
    detector.signal(signal.SIGKILL)
    words(card, 'was it killed, or stopped?')
    # By all who knew it: by the test, and by slip_view.
    bench.wait_until_forgotten('slip_detector')
    expect(card).to_have_count(0)
    again = bench.start('slip_detector', *index, parameters={'channels': 8})
    words(card.locator('.notice'), 'the detector was started again at')
    words(card.locator('.diagnostics'), 'dropped: not as many channels as configured')
    words(card.locator('.veil'), 'samples come, but they have 16 channels, the detector 8')
    expect(card.locator('.group .name')).to_have_text('all')
    again.signal(signal.SIGINT)
    expect(card).to_have_count(0)
    words(page.locator('#gone'), 'index: its detector has ended')
    bench.start('slip_detector', *index)
    words(card.locator('.badge'), 'SLIP')
    expect(page.locator('#gone')).to_be_hidden()
