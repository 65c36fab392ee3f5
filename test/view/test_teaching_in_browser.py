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
from support.full_disk import full_disk
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


def row(page, name):
    return page.get_by_role('row', name=re.compile(rf'\b{name}\b'))


def seconds_of(page):
    """Wait until something has been recorded for so long; the page rounds to a tenth."""
    return lambda least: expect(now(page)).to_have_text(
        re.compile(rf': ({least}\.[1-9]|[{least + 1}-9]\.\d|\d\d+\.\d) s'), timeout=PATIENCE_MS
    )


def truth_of(path):
    return np.concatenate([piece.truth for piece in open_recording(path).rows()])


def test_a_slip_is_recorded_as_long_as_the_space_bar_is_held(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.down(' ')
        expect(now(page)).to_contain_text('SLIP')
        expect(page.get_by_role('button', name='Slip')).to_have_attribute('aria-pressed', 'true')
        page.keyboard.up(' ')
        expect(now(page)).to_contain_text('hold still')
        expect(row(page, 'slip_1')).to_be_visible(timeout=PATIENCE_MS)
        expect(now(page)).to_have_text('Nothing is recorded now.')
    truth = truth_of(tmp_path / 'index' / 'slip_1')
    assert np.flatnonzero(np.diff(truth.astype(int))).size == 2
    assert not truth[-1]


def test_the_mouse_holds_a_slip_too(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.get_by_role('button', name='Slip').hover()
        page.mouse.down()
        expect(now(page)).to_contain_text('SLIP')
        page.mouse.up()
        expect(row(page, 'slip_1')).to_be_visible(timeout=PATIENCE_MS)


def test_the_space_bar_does_on_other_controls_what_it_always_does(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.get_by_role('button', name='Rest').focus()
        page.keyboard.press(' ')
        expect(now(page)).to_contain_text('rest_1')
        page.keyboard.press('r')
        expect(now(page)).to_have_text('Nothing is recorded now.')


def test_a_page_that_is_reloaded_finds_the_recording_that_goes_on(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.press('r')
        seconds_of(page)(1)
        page.reload()
        seconds_of(page)(2)
        expect(page.get_by_role('button', name='Rest')).to_have_attribute('aria-pressed', 'true')
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


def test_a_recording_that_cannot_be_used_is_listed_so(opened, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    (tmp_path / 'index' / 'slip_2' / 'slip_2.mcap').write_bytes(b'no bag')
    with served(tmp_path) as running:
        page = opened(running)
        expect(row(page, 'slip_1')).to_contain_text('tuning')
        expect(row(page, 'slip_2')).to_contain_text('not used')
        expect(row(page, 'slip_2')).to_contain_text('is broken')
        expect(page.get_by_role('button', name=re.compile('^Slip'))).to_contain_text('1 of 20')
        expect(page.get_by_role('button', name='Tune', exact=True)).to_be_disabled()


def test_a_recording_is_deleted_only_when_that_is_confirmed(opened, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    with served(tmp_path) as running:
        page = opened(running)
        said = []
        answers = ['dismiss', 'accept']
        page.on(
            'dialog',
            lambda dialog: (said.append(dialog.message), getattr(dialog, answers.pop(0))()),
        )
        delete = page.get_by_role('button', name='Delete slip_1')
        delete.click()
        expect(row(page, 'slip_1')).to_be_visible()
        assert (tmp_path / 'index' / 'slip_1').exists()
        delete.click()
        expect(row(page, 'slip_1')).to_have_count(0)
    assert 'Delete slip_1' in said[0]
    assert not (tmp_path / 'index' / 'slip_1').exists()
    assert (tmp_path / 'index' / 'slip_2').exists()


def test_on_a_full_disk_the_page_says_so_and_what_was_recorded_stays(opened, tmp_path):
    with served(tmp_path) as running:
        page = opened(running)
        page.keyboard.press('t')
        seconds_of(page)(1)
        size = (tmp_path / 'index' / 'taps_1' / 'taps_1.mcap').stat().st_size
        with full_disk(size + 1000):
            expect(words(page)).to_contain_text('File too large')
        expect(words(page)).to_contain_text('which are kept')
        expect(row(page, 'taps_1')).to_contain_text('was cut off')
    assert len(truth_of(tmp_path / 'index' / 'taps_1')) > 300


def test_tuning_that_fails_says_why_and_keeps_what_was_recorded(opened, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    with served(tmp_path) as running:
        page = opened(running)
        expect(row(page, 'rest_1')).to_be_visible()
        (tmp_path / 'index' / 'rest_1' / 'rest_1.mcap').write_bytes(b'no bag')
        page.get_by_role('button', name='Tune').click()
        failed = page.get_by_role('alert').filter(has_text='Tuning failed')
        expect(failed).to_contain_text('rest_1')
        expect(failed).to_contain_text('What was recorded is kept')
        expect(page.get_by_role('button', name='Tune')).to_be_enabled()


def test_a_screen_reader_finds_all_of_it_by_name(opened, tmp_path):
    axe = pytest.importorskip('axe_core_python', reason='needs axe-core-python')
    write_lesson(tmp_path / 'index', slips=2)
    with served(tmp_path) as running:
        page = opened(running)
        expect(row(page, 'slip_2')).to_be_visible()
        page.keyboard.press('r')
        expect(now(page)).to_contain_text('rest_3')
        page.evaluate((Path(axe.__path__[0]) / 'axe.min.js').read_text(encoding='utf-8'))
        found = page.evaluate("axe.run('#tools')")
        page.keyboard.press('r')
    wrong = [(one['id'], [node['html'] for node in one['nodes']]) for one in found['violations']]
    assert wrong == []
    assert len(found['passes']) > 10


def test_a_page_that_may_only_look_records_nothing(opened, tmp_path):
    write_lesson(tmp_path / 'index', slips=2)
    with served(tmp_path, access=Access(read_only=True)) as running:
        page = opened(running)
        for name in ('Rest', 'Slip', 'Taps', 'Tune', 'Delete slip_1'):
            expect(page.get_by_role('button', name=name, exact=name == 'Tune')).to_be_disabled()
        page.keyboard.press('r')
        expect(now(page)).to_contain_text('--read-only')
    assert not (tmp_path / 'index' / 'rest_3').exists()
