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

"""When a slip is recorded, by which keys, and when it is not, in a real browser."""

import re

import pytest

from support.browsers import expect
from support.finger_states import rest_rows


@pytest.fixture
def page(played):
    """Return the page of a finger; nothing is recorded."""
    _, page = played({'index': rest_rows()})
    expect(said(page)).to_have_text('Nothing is recorded now.', timeout=60_000)
    expect(slip(page)).to_be_enabled()
    return page


def said(page):
    return page.locator('.teach-now')


def slip(page):
    return page.locator('.teach-buttons').get_by_role('button', name=re.compile('^Slip'))


def recorded(page):
    return page.get_by_role('row', name=re.compile(r'^slip_\d'))


def test_letters_and_spaces_that_are_typed_record_nothing(page):
    field = page.get_by_label('File')
    field.fill('')
    field.press_sequentially('r t')
    expect(field).to_have_value('r t')
    page.get_by_label('What').focus()
    page.keyboard.press('t')
    page.evaluate('document.activeElement.blur()')
    # The next key that is none of a field records, and is the first to do so.
    page.keyboard.press('r')
    expect(said(page)).to_contain_text('rest_1')
    page.keyboard.press('r')
    expect(said(page)).to_have_text('Nothing is recorded now.')
    expect(page.get_by_role('row', name=re.compile(r'^rest_1 '))).to_be_visible()
    assert page.locator('.recordings tbody tr').count() == 1


@pytest.mark.parametrize('lost', ['blur', 'visibilitychange'])
def test_a_slip_ends_when_its_key_is_held_where_the_page_does_not_see_it(page, lost):
    page.keyboard.down(' ')
    expect(said(page)).to_contain_text('SLIP')
    target = 'window' if lost == 'blur' else 'document'
    page.evaluate(f'{target}.dispatchEvent(new Event("{lost}"))')
    expect(recorded(page)).to_have_count(1, timeout=60_000)
    page.keyboard.up(' ')


def test_a_key_that_repeats_is_one_slip_and_one_rest(page):
    # After a click elsewhere the space bar is for slips.
    page.get_by_role('button', name='Longer stretch of time').click()
    page.get_by_role('tab', name='Teach').click()
    for _ in range(5):
        page.keyboard.down(' ')
    expect(said(page)).to_contain_text('slip_1')
    page.keyboard.up(' ')
    expect(recorded(page)).to_have_count(1, timeout=60_000)
    expect(page.locator('#trace-span')).to_have_text('20 s')
    # Held on the button it is one slip, too.
    slip(page).focus()
    page.keyboard.down(' ')
    expect(said(page)).to_contain_text('SLIP')
    page.keyboard.up(' ')
    expect(recorded(page)).to_have_count(2, timeout=60_000)
    expect(said(page)).to_have_text('Nothing is recorded now.')
    page.get_by_role('button', name=re.compile('^Rest')).focus()
    for _ in range(5):
        page.keyboard.down('Enter')
    page.keyboard.up('Enter')
    expect(said(page)).to_contain_text('rest_1')
    page.keyboard.press('Enter')
    expect(page.locator('.recordings tbody tr')).to_have_count(3)


def test_who_cannot_hold_a_key_begins_and_ends_a_slip(page):
    slip(page).focus()
    page.keyboard.press('Enter')
    expect(said(page)).to_contain_text('SLIP')
    expect(slip(page)).to_have_attribute('aria-pressed', 'true')
    # Longer than the server waits for a page that is gone.
    expect(said(page)).to_contain_text(re.compile(r': ([5-9]|\d\d+)\.\d s, SLIP'), timeout=60_000)
    page.keyboard.press('Enter')
    expect(recorded(page)).to_have_count(1, timeout=60_000)


def test_keys_can_be_switched_off(page):
    page.keyboard.press('?')
    page.get_by_label('Keys act wherever the focus is').uncheck()
    page.evaluate('document.activeElement.blur()')
    page.keyboard.press('p')
    page.keyboard.press('t')
    # What has the focus acts all the same.
    slip(page).focus()
    page.keyboard.down(' ')
    expect(said(page)).to_contain_text('slip_1')
    page.keyboard.up(' ')
    expect(recorded(page)).to_have_count(1, timeout=60_000)
    expect(page.get_by_role('button', name='Pause')).to_be_visible()
    assert page.locator('.recordings tbody tr').count() == 1
