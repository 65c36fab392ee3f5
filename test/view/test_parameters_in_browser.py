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

"""Parameters of a detector in a real browser: changed, refused, undone, saved, by two pages."""

import contextlib
import re

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.access import Access
from slip_detector.view.parameter_requests import ParameterRequests
from support.browsers import expect
from support.simulated_hand import SimulatedHand, served_beside

NAME = '/index/slip_detector'


@pytest.fixture
def serve(tmp_path):
    """Return what serves fingers at rest."""
    with contextlib.ExitStack() as ends:

        def serve_(labels=('index',), files=(), **how):
            hand = SimulatedHand(labels, real_time=False)
            prepare = lambda server: ParameterRequests(server, tmp_path, files)  # noqa: E731
            return ends.enter_context(served_beside(hand, prepare=prepare, **how))

        yield serve_


@pytest.fixture
def opened(serve, open_page):
    """Return what opens a page at its parameters; it is closed before its server ends."""

    def open_(served):
        page = open_page(served)
        page.get_by_role('tab', name='Parameters').click()
        expect(field(page, 'threshold')).to_have_value('0.5', timeout=60_000)
        return page

    return open_


def field(page, name):
    return page.locator(f'[data-name="{name}"] :is(input, select)')


def button(page, name):
    return page.locator('#tools').get_by_role('button', name=name)


def set_button(page):
    return button(page, re.compile('^Set'))


def open_all(page):
    closed = page.locator('#parameters details:not([open]) > summary')
    while closed.count():
        closed.first.click()


def changes(page):
    return page.locator('#parameters .changes li')


def config(served):
    return served.call(lambda: served.hand.fingers[NAME].config)


def test_every_parameter_is_there_with_unit_range_and_meaning(serve, opened):
    running = serve()
    page = opened(running)
    open_all(page)
    names = page.locator('#parameters .parameter label').all_inner_texts()
    assert names == list(DetectorConfig().to_parameters())
    row = page.locator('[data-name=max_gap_s]')
    expect(row).to_contain_text('s')
    expect(row).to_contain_text('A shorter gap in the input is bridged')
    expect(row).to_contain_text('Allowed: 0 to 60.')
    # A reader of the screen finds it by its name.
    expect(page.get_by_label('decision_window_s')).to_have_value('0.04')
    fixed = field(page, 'autostart')
    expect(fixed).to_be_disabled()
    expect(page.locator('[data-name=autostart]')).to_contain_text('Holds from the start')


def test_what_was_typed_is_set_at_once_and_with_enter_too(serve, opened):
    running = serve()
    page = opened(running)
    expect(set_button(page)).to_be_disabled()
    field(page, 'threshold').fill('0.25')
    field(page, 'passband_hz').fill('10, 60')
    field(page, 'vote').fill('2')
    expect(page.locator('[data-name=threshold]')).to_contain_text('the detector has 0.5')
    assert config(running) == DetectorConfig()
    button(page, 'Set 3 values').click()
    changes = page.locator('#parameters .changes')
    expect(changes).to_contain_text('Set: threshold from 0.5 to 0.25, ')
    assert config(running) == DetectorConfig(threshold=0.25, passband_hz=(10, 60), vote=2)
    expect(set_button(page)).to_be_disabled()
    field(page, 'threshold').fill('0.3')
    field(page, 'threshold').press('Enter')
    expect(changes).to_contain_text('Set: threshold from 0.25 to 0.3.')
    field(page, 'gain').fill('1')
    field(page, 'gain').press('Escape')
    expect(field(page, 'gain')).to_have_value('100')
    expect(set_button(page)).to_be_disabled()


def test_a_refusal_is_shown_in_its_own_words_and_what_was_typed_stays(serve, opened):
    running = serve()
    page = opened(running)
    field(page, 'threshold').fill('<b>low')
    field(page, 'gain').fill('2')
    set_button(page).click()
    refusal = page.locator('#parameters [role=alert]')
    expect(refusal).to_have_text("Refused: parameter threshold is '<b>low', allowed: a number")
    expect(field(page, 'threshold')).to_have_attribute('aria-invalid', 'true')
    expect(field(page, 'gain')).to_have_attribute('aria-invalid', 'false')
    expect(field(page, 'gain')).to_have_value('2')
    assert config(running) == DetectorConfig()
    button(page, 'Discard').click()
    expect(refusal).to_be_hidden()
    expect(field(page, 'gain')).to_have_value('100')


def test_groups_come_and_go_as_a_set(serve, opened):
    running = serve()
    page = opened(running)
    for name in ('TP', 'TD'):
        page.locator(f'[data-name="groups.{name}"]').get_by_role('button').click()
    expect(page.locator('[data-name="groups.TP"]')).to_contain_text('To be removed')
    page.get_by_label('New group').fill('all (of it')
    button(page, 'Add').click()
    field(page, 'groups.all (of it').fill('14, 16, 11, 9, 1, 3, 8, 6')
    set_button(page).click()
    expect(page.locator('#parameters [role=alert]')).to_contain_text("'all (of it'")
    field(page, 'groups.all (of it').press('Escape')
    page.get_by_label('New group').fill('T')
    button(page, 'Add').click()
    field(page, 'groups.T').fill('14, 16, 11, 9, 1, 3, 8, 6')
    set_button(page).click()
    expect(page.locator('#parameters .changes')).to_contain_text('groups.TP from 14, 16, 11, 9')
    expect(page.locator('[data-name="groups.TP"]')).to_have_count(0)
    assert list(config(running).groups) == ['LR', 'LU', 'T']
    button(page, 'Undo').click()
    expect(field(page, 'groups.TP')).to_have_value('14, 16, 11, 9')
    assert config(running) == DetectorConfig()


def test_changes_are_undone_one_after_the_other_and_all_of_it_is_as_at_first(serve, opened):
    running = serve()
    page = opened(running)
    expect(button(page, 'Undo')).to_be_disabled()
    expect(button(page, 'As first seen')).to_be_disabled()
    for value in ('0.25', '0.75'):
        field(page, 'threshold').fill(value)
        set_button(page).click()
        expect(page.locator('#parameters .changes')).to_contain_text(f'to {value}.')
    button(page, 'Undo').click()
    expect(field(page, 'threshold')).to_have_value('0.25')
    expect(page.locator('#parameters')).to_contain_text('Undo takes back: threshold from')
    button(page, 'Undo').click()
    expect(field(page, 'threshold')).to_have_value('0.5')
    expect(button(page, 'Undo')).to_be_disabled()
    field(page, 'gain').fill('7')
    set_button(page).click()
    expect(page.locator('[data-name=gain]')).to_contain_text('In the file: 100.')
    button(page, 'As first seen').click()
    expect(field(page, 'gain')).to_have_value('100')
    assert config(running) == DetectorConfig()


def test_all_of_it_becomes_as_it_is_in_the_file_now(serve, opened, tmp_path):
    file = tmp_path / 'finger.yaml'
    text = '/**/slip_detector: {{ros__parameters: {{threshold: {}}}}}'
    file.write_text(text.format(0.5), encoding='utf-8')
    running = serve(files=[file])
    page = opened(running)
    expect(page.locator('#parameters')).to_contain_text(f'Its file is {file}.')
    field(page, 'gain').fill('7')
    set_button(page).click()
    expect(button(page, 'As in the file')).to_be_enabled()
    file.write_text(text.format(0.125), encoding='utf-8')
    button(page, 'As in the file').click()
    expect(field(page, 'threshold')).to_have_value('0.125')
    assert config(running) == DetectorConfig(threshold=0.125)
    file.write_text(text.format('low'), encoding='utf-8')
    field(page, 'gain').fill('7')
    set_button(page).click()
    button(page, 'As in the file').click()
    expect(page.locator('#parameters [role=alert]')).to_contain_text(f'{file}: parameter')


def test_two_pages_tell_each_other_what_they_change(serve, opened):
    running = serve()
    one, other = opened(running), opened(running)
    field(other, 'threshold').fill('0.9')
    field(one, 'threshold').fill('0.25')
    set_button(one).click()
    expect(other.locator('#parameters .changes')).to_have_text(
        'Changed on another page: threshold from 0.5 to 0.25.', timeout=1000
    )
    row = other.locator('[data-name=threshold]')
    expect(row).to_contain_text('the detector has 0.25.')
    expect(row).to_contain_text('Changed on another page meanwhile.')
    expect(field(other, 'threshold')).to_have_value('0.9')
    expect(one.locator('#parameters .changes')).to_have_text('Set: threshold from 0.5 to 0.25.')
    set_button(other).click()
    expect(field(one, 'threshold')).to_have_value('0.9', timeout=1000)
    expect(row).not_to_contain_text('meanwhile')
    # Somebody who has no page, and a detector that begins again.
    running.call(lambda: running.hand.panel(NAME).take({'gain': 5.0}))
    for page in (one, other):
        expect(page.locator('#parameters .changes li').last).to_have_text(
            'Changed by another program: gain from 100 to 5.'
        )


def test_nothing_can_be_changed_where_pages_may_only_look(serve, opened):
    running = serve(access=Access(read_only=True))
    page = opened(running)
    expect(page.locator('#parameters')).to_contain_text('--read-only')
    open_all(page)
    usable = page.locator('#parameters form :is(input, select):enabled')
    assert {element.evaluate('e => e.form.className') for element in usable.all()} <= {'saving'}
    expect(set_button(page)).to_be_disabled()
    expect(button(page, 'Save')).to_be_disabled()


def test_it_is_saved_in_the_folder_that_is_named_and_nowhere_else(serve, opened, tmp_path):
    running = serve(labels=('index', 'thumb'))
    page = opened(running)
    field(page, 'threshold').fill('0.25')
    set_button(page).click()
    expect(page.locator('#parameters .changes')).to_contain_text('0.25')
    expect(page.locator('#tools .saving')).to_contain_text(str(tmp_path))
    expect(page.get_by_label('File')).to_have_value('index')
    button(page, 'Save').click()
    saved = page.locator('#tools .saved')
    expect(saved).to_contain_text(f'config:={tmp_path}/index.yaml')
    assert DetectorConfig.from_yaml(tmp_path / 'index.yaml') == config(running)
    button(page, 'Save').click()
    expect(saved).to_contain_text('Not saved: ')
    page.get_by_label('What').select_option('all')
    button(page, 'Replace the file').click()
    expect(saved).to_contain_text(f'fingers:=index,thumb config:={tmp_path}/index.yaml')
    text = (tmp_path / 'index.yaml').read_text(encoding='utf-8')
    assert '/thumb/slip_detector:' in text
    page.get_by_label('File').fill('../index')
    button(page, 'Save').click()
    expect(saved).to_contain_text("Not saved: name is '../index', allowed: ")
    assert [path.name for path in tmp_path.iterdir()] == ['index.yaml']


def test_a_page_goes_on_telling_changes_when_slip_view_was_started_again(serve, opened):
    running = serve()
    page = opened(running)
    for value in ('0.25', '0.75'):
        field(page, 'threshold').fill(value)
        set_button(page).click()
        expect(changes(page).last).to_contain_text(f'to {value}.')
    begun_again = SimulatedHand(('index',), real_time=False)
    running.call(lambda: setattr(running.server, 'hand', begun_again))
    expect(field(page, 'threshold')).to_have_value('0.5')
    field(page, 'threshold').fill('0.125')
    set_button(page).click()
    expect(changes(page).last).to_have_text('Set: threshold from 0.5 to 0.125.')
