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

"""The tab "Teach" in a real browser: what is recorded by which keys, listed, and deleted."""

import re

import pytest

from support.browsers import expect
from support.finger_states import rest_rows
from support.lessons import write_lesson
from support.page_parts import recording, recording_now, tool
from support.simulated_detectors import SimulatedDetectors


@pytest.fixture
def served(serve):
    return serve(SimulatedDetectors())


@pytest.fixture
def opened(open_page):
    """Return what opens a page, and waits until it knows what is recorded."""

    def open_(served):
        page = open_page(served)
        expect(recording_now(page)).not_to_be_empty()
        return page

    return open_


@pytest.fixture
def page(played):
    """Return the page of a finger at rest; nothing is recorded."""
    _, page = played({'index': rest_rows()})
    nothing_is_recorded(page)
    expect(tool(page, 'Slip')).to_be_enabled()
    return page


def nothing_is_recorded(page):
    expect(recording_now(page)).to_have_text('Nothing is recorded now.')


def listed(page):
    return page.locator('.recordings tbody tr')


def test_rest_and_slips_are_recorded_with_keys_and_mouse(served, opened):
    page = opened(served)
    page.keyboard.down(' ')
    expect(recording_now(page)).to_contain_text('SLIP')
    expect(tool(page, 'Slip')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.up(' ')
    expect(recording_now(page)).to_contain_text('hold still')
    expect(recording(page, 'slip_1')).to_be_visible()
    nothing_is_recorded(page)
    tool(page, 'Slip').hover()
    page.mouse.down()
    expect(recording_now(page)).to_contain_text('SLIP')
    page.mouse.up()
    expect(recording(page, 'slip_2')).to_be_visible()
    # On other controls the space bar does what it always does.
    tool(page, 'Rest').focus()
    page.keyboard.press(' ')
    expect(recording_now(page)).to_contain_text('rest_1')
    page.keyboard.press('r')
    nothing_is_recorded(page)


def test_a_page_that_is_loaded_again_finds_the_recording_that_goes_on(served, opened):
    page = opened(served)
    page.keyboard.press('r')
    for seconds in (1, 2):
        # The page rounds to a tenth.
        expect(recording_now(page)).to_have_text(
            re.compile(rf': ({seconds}\.[1-9]|[{seconds + 1}-9]\.\d|\d\d+\.\d) s')
        )
        page.reload()
    expect(tool(page, 'Rest')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.press('r')
    expect(recording(page, 'rest_1')).to_be_visible()


def test_a_slip_ends_when_the_page_that_holds_it_is_closed(served, opened):
    page = opened(served)
    page.keyboard.down(' ')
    expect(recording_now(page)).to_contain_text('SLIP')
    page.close()
    page = opened(served)
    expect(recording(page, 'slip_1')).to_be_visible()


def test_recordings_are_listed_tuned_on_and_deleted_when_that_is_confirmed(
    served, opened, tmp_path
):
    write_lesson(tmp_path / 'index', slips=3)
    (tmp_path / 'index' / 'slip_3' / 'slip_3.mcap').write_bytes(b'no bag')
    page = opened(served)
    tune = page.get_by_role('button', name='Tune', exact=True)
    expect(recording(page, 'slip_1')).to_contain_text('tuning')
    expect(recording(page, 'slip_3')).to_contain_text('not used')
    expect(recording(page, 'slip_3')).to_contain_text('is broken')
    expect(tool(page, 'Slip')).to_contain_text('2 of 20')
    (tmp_path / 'index' / 'rest_1' / 'rest_1.mcap').write_bytes(b'no bag')
    tune.click()
    failed = page.get_by_role('alert').filter(has_text='Tuning failed')
    expect(failed).to_contain_text('rest_1')
    expect(failed).to_contain_text('What was recorded is kept')
    expect(tune).to_be_enabled()
    asked = []
    answers = ['dismiss', 'accept']
    page.on(
        'dialog',
        lambda dialog: (asked.append(dialog.message), getattr(dialog, answers.pop(0))()),
    )
    delete = tool(page, 'Delete slip_1')
    delete.click()
    expect(recording(page, 'slip_1')).to_be_visible()
    delete.click()
    expect(recording(page, 'slip_1')).to_have_count(0)
    expect(tune).to_be_disabled()
    assert 'Delete slip_1' in asked[0]


def test_letters_and_spaces_that_are_typed_record_nothing(page):
    file = page.get_by_label('File', exact=True)
    file.fill('')
    file.press_sequentially('r t')
    expect(file).to_have_value('r t')
    page.locator('#tools .saving select').focus()
    page.keyboard.press('t')
    page.evaluate('document.activeElement.blur()')
    # The next key that is none of a field records, and is the first to do so.
    page.keyboard.press('r')
    expect(recording_now(page)).to_contain_text('rest_1')
    page.keyboard.press('r')
    nothing_is_recorded(page)
    expect(recording(page, 'rest_1')).to_be_visible()
    expect(listed(page)).to_have_count(1)


@pytest.mark.parametrize('lost', ['window, blur', 'document, visibilitychange'])
def test_a_slip_ends_when_its_key_is_held_where_the_page_does_not_see_it(page, lost):
    page.keyboard.down(' ')
    expect(recording_now(page)).to_contain_text('SLIP')
    target, event = lost.split(', ')
    page.evaluate(f'{target}.dispatchEvent(new Event("{event}"))')
    expect(listed(page)).to_have_count(1)
    page.keyboard.up(' ')


def test_a_key_that_repeats_is_one_slip_and_one_rest(page):
    # After a click elsewhere the space bar is for slips.
    page.get_by_role('button', name='Longer stretch of time').click()
    page.get_by_role('tab', name='Teach').click()
    for _ in range(5):
        page.keyboard.down(' ')
    expect(recording_now(page)).to_contain_text('slip_1')
    page.keyboard.up(' ')
    expect(listed(page)).to_have_count(1)
    expect(page.locator('#trace-span')).to_have_text('20 s')
    tool(page, 'Rest').focus()
    for _ in range(5):
        page.keyboard.down('Enter')
    page.keyboard.up('Enter')
    expect(recording_now(page)).to_contain_text('rest_1')
    page.keyboard.press('Enter')
    expect(listed(page)).to_have_count(2)


def test_a_slip_is_begun_and_ended_by_a_button_where_no_key_can_be_held_and_keys_are_off(page):
    page.keyboard.press('?')
    page.get_by_label('Keys act wherever the focus is').uncheck()
    page.evaluate('document.activeElement.blur()')
    page.keyboard.press('p')
    page.keyboard.press('t')
    # What has the focus acts all the same.
    tool(page, 'Slip').focus()
    page.keyboard.press('Enter')
    # Longer than the server waits for a page that is gone.
    expect(recording_now(page)).to_contain_text(re.compile(r': ([5-9]|\d\d+)\.\d s, SLIP'))
    expect(tool(page, 'Slip')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.press('Enter')
    expect(recording(page, 'slip_1')).to_be_visible()
    page.keyboard.down(' ')
    expect(recording_now(page)).to_contain_text('slip_2')
    page.keyboard.up(' ')
    expect(listed(page)).to_have_count(2)
    expect(page.get_by_role('button', name='Pause')).to_be_visible()
