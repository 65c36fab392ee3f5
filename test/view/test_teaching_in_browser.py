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


"""Rest, slips and taps taught in a real browser, to simulated fingers."""

import re
from pathlib import Path

import numpy as np
import pytest

from slip_detector.recordings import open_recording
from slip_detector.view.access import Access
from slip_detector.view.teaching_requests import TeachingRequests
from support.browsers import PATIENCE_MS, expect
from support.lessons import write_lesson
from support.simulated_hand import SimulatedHand, served_beside


@pytest.fixture
def opened(open_page):
    """Return what opens a page, and waits until it knows what is recorded."""

    def open_(served):
        page = open_page(served)
        expect(now(page)).not_to_be_empty()
        return page

    return open_


def served(tmp_path, **how):
    return served_beside(
        SimulatedHand(), prepare=lambda server: TeachingRequests(server, tmp_path), **how
    )


def now(page):
    return page.locator('.teach-now')


def words(page):
    return page.locator('.teach-words')


def record(page, what):
    """Return the button that records; each recording has one that deletes it beside it."""
    return page.locator('.teach-buttons').get_by_role('button', name=re.compile(f'^{what}'))


def tune(page):
    return page.get_by_role('button', name='Tune', exact=True)


def row(page, name):
    return page.get_by_role('row', name=re.compile(rf'\b{name}\b'))


def seconds_of(page):
    """Wait until something has been recorded for so long; the page rounds to a tenth."""
    return lambda least: expect(now(page)).to_have_text(
        re.compile(rf': ({least}\.[1-9]|[{least + 1}-9]\.\d|\d\d+\.\d) s'), timeout=PATIENCE_MS
    )


def truth_of(path):
    return np.concatenate([piece.truth for piece in open_recording(path).rows()])


def test_rest_and_slips_are_recorded_with_keys_and_mouse(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.down(' ')
        expect(now(page)).to_contain_text('SLIP')
        expect(record(page, 'Slip')).to_have_attribute('aria-pressed', 'true')
        page.keyboard.up(' ')
        expect(now(page)).to_contain_text('hold still')
        expect(row(page, 'slip_1')).to_be_visible(timeout=PATIENCE_MS)
        expect(now(page)).to_have_text('Nothing is recorded now.')
        record(page, 'Slip').hover()
        page.mouse.down()
        expect(now(page)).to_contain_text('SLIP')
        page.mouse.up()
        expect(row(page, 'slip_2')).to_be_visible(timeout=PATIENCE_MS)
        # On other controls the space bar does what it always does.
        record(page, 'Rest').focus()
        page.keyboard.press(' ')
        expect(now(page)).to_contain_text('rest_1')
        page.keyboard.press('r')
        expect(now(page)).to_have_text('Nothing is recorded now.')
    truth = truth_of(tmp_path / 'index' / 'slip_1')
    assert np.flatnonzero(np.diff(truth.astype(int))).size == 2
    assert not truth[-1]


def test_a_page_that_is_reloaded_finds_the_recording_that_goes_on(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.press('r')
        seconds_of(page)(1)
        page.reload()
        seconds_of(page)(2)
        expect(record(page, 'Rest')).to_have_attribute('aria-pressed', 'true')
        page.keyboard.press('r')
        expect(row(page, 'rest_1')).to_be_visible()
    rows = [piece.stamps_ns for piece in open_recording(tmp_path / 'index' / 'rest_1').rows()]
    stamps_ns = np.concatenate(rows)
    assert stamps_ns[-1] - stamps_ns[0] >= 2e9
    assert np.diff(stamps_ns).max() < 3 * np.diff(stamps_ns).min()


def test_a_page_that_is_closed_ends_the_slip_that_it_held(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.down(' ')
        expect(now(page)).to_contain_text('SLIP')
        page.close()
        page = opened(running)
        expect(words(page)).to_contain_text('slip_1 has')
        expect(row(page, 'slip_1')).to_be_visible()
    assert not truth_of(tmp_path / 'index' / 'slip_1')[-1]


def test_recordings_are_listed_tuned_on_and_deleted_when_that_is_confirmed(opened, tmp_path):
    axe = pytest.importorskip('axe_core_python', reason='needs axe-core-python')
    write_lesson(tmp_path / 'index', slips=3)
    (tmp_path / 'index' / 'slip_3' / 'slip_3.mcap').write_bytes(b'no bag')
    with served(tmp_path) as running:
        page = opened(running)
        expect(row(page, 'slip_1')).to_contain_text('tuning')
        expect(row(page, 'slip_3')).to_contain_text('not used')
        expect(row(page, 'slip_3')).to_contain_text('is broken')
        expect(record(page, 'Slip')).to_contain_text('2 of 20')
        page.evaluate((Path(axe.__path__[0]) / 'axe.min.js').read_text(encoding='utf-8'))
        found = page.evaluate("axe.run('#tools')")
        (tmp_path / 'index' / 'rest_1' / 'rest_1.mcap').write_bytes(b'no bag')
        tune(page).click()
        failed = page.get_by_role('alert').filter(has_text='Tuning failed')
        expect(failed).to_contain_text('rest_1')
        expect(failed).to_contain_text('What was recorded is kept')
        expect(tune(page)).to_be_enabled()
        said = []
        answers = ['dismiss', 'accept']
        page.on(
            'dialog',
            lambda dialog: (said.append(dialog.message), getattr(dialog, answers.pop(0))()),
        )
        delete = page.get_by_role('button', name='Delete slip_1', exact=True)
        delete.click()
        expect(row(page, 'slip_1')).to_be_visible()
        assert (tmp_path / 'index' / 'slip_1').exists()
        delete.click()
        expect(row(page, 'slip_1')).to_have_count(0)
        expect(tune(page)).to_be_disabled()
    wrong = [(one['id'], [node['html'] for node in one['nodes']]) for one in found['violations']]
    assert wrong == []
    assert len(found['passes']) > 10
    assert 'Delete slip_1' in said[0]
    assert not (tmp_path / 'index' / 'slip_1').exists()
    assert (tmp_path / 'index' / 'slip_2').exists()


def test_a_page_that_may_only_look_records_nothing(opened, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    with served(tmp_path, access=Access(read_only=True)) as running:
        page = opened(running)
        delete = page.get_by_role('button', name='Delete slip_1', exact=True)
        for button in (*map(record, [page] * 3, ('Rest', 'Slip', 'Taps')), tune(page), delete):
            expect(button).to_be_disabled()
        page.keyboard.press('r')
        expect(now(page)).to_contain_text('--read-only')
    assert not (tmp_path / 'index' / 'rest_3').exists()
