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

import pytest

from slip_detector.parameters.detector import DetectorConfig
from support.browsers import expect
from support.page_parts import NAME, changes, config_of, field, tool
from support.simulated_detectors import SimulatedDetectors


@pytest.fixture
def opened(serve, open_page):
    """Return what serves fingers at rest, and opens a number of pages at their parameters."""

    def open_(labels=('index',), files=(), pages=1):
        served = serve(SimulatedDetectors(labels, real_time=False), files)
        every = [open_page(served) for _ in range(pages)]
        for page in every:
            page.get_by_role('tab', name='Parameters').click()
            expect(field(page, 'threshold')).to_have_value('0.5')
        return served, *every

    return open_


def refusal(page):
    return page.locator('#parameters [role=alert]')


def row(page, name):
    return page.locator(f'[data-name="{name}"]')


def set_values(page, **values):
    for name, value in values.items():
        field(page, name).fill(value)
    tool(page, 'Set').click()


def test_every_parameter_is_there_with_unit_range_and_meaning(opened):
    _, page = opened()
    closed = page.locator('#parameters details:not([open]) > summary')
    while closed.count():
        closed.first.click()
    names = page.locator('#parameters .parameter label').all_inner_texts()
    assert names == list(DetectorConfig().to_parameters())
    for words in ('s', 'A shorter gap in the input is bridged', 'Allowed: 0 to 60.'):
        expect(row(page, 'max_gap_s')).to_contain_text(words)
    # A reader of the screen finds it by its name.
    expect(page.get_by_label('decision_window_s', exact=True)).to_have_value('0.04')
    expect(field(page, 'autostart')).to_be_disabled()
    expect(row(page, 'autostart')).to_contain_text('Holds from the start')


def test_values_are_typed_set_at_once_or_refused_and_undone_one_after_the_other(opened, tmp_path):
    file = tmp_path / 'finger.yaml'
    text = '/**/slip_detector: {{ros__parameters: {{threshold: {}}}}}'
    file.write_text(text.format(0.5), encoding='utf-8')
    served, page = opened(files=[file])
    expect(page.locator('#parameters')).to_contain_text(f'Its file is {file}.')
    for name in ('Set', 'Undo', 'As in the file'):
        expect(tool(page, name)).to_be_disabled()
    # What is typed in a field is no key of the page.
    field(page, 'threshold').press_sequentially('p?2')
    expect(page.get_by_role('button', name='Pause')).to_be_visible()
    set_values(page, threshold='<b>low', gain='2')
    expect(refusal(page)).to_have_text(
        "Refused: parameter threshold is '<b>low', allowed: a number"
    )
    expect(field(page, 'threshold')).to_have_attribute('aria-invalid', 'true')
    expect(field(page, 'gain')).to_have_attribute('aria-invalid', 'false')
    expect(field(page, 'gain')).to_have_value('2')
    assert config_of(served) == DetectorConfig()
    tool(page, 'Discard').click()
    expect(refusal(page)).to_be_hidden()
    expect(field(page, 'gain')).to_have_value('100')
    field(page, 'threshold').fill('0.25')
    expect(row(page, 'threshold')).to_contain_text('the detector has 0.5')
    field(page, 'passband_hz').fill('10, 60')
    tool(page, 'Set 2 values').click()
    expect(changes(page)).to_contain_text('Set: threshold from 0.5 to 0.25, ')
    assert config_of(served) == DetectorConfig(threshold=0.25, passband_hz=(10, 60))
    field(page, 'gain').fill('1')
    field(page, 'gain').press('Escape')
    expect(field(page, 'gain')).to_have_value('100')
    field(page, 'threshold').fill('0.75')
    field(page, 'threshold').press('Enter')
    expect(changes(page)).to_contain_text('Set: threshold from 0.25 to 0.75.')
    expect(row(page, 'threshold')).to_contain_text('In the file: 0.5.')
    for before in ('0.25', '0.5'):
        expect(page.locator('#parameters')).to_contain_text('Undo takes back: threshold from')
        tool(page, 'Undo').click()
        expect(field(page, 'threshold')).to_have_value(before)
    expect(tool(page, 'Undo')).to_be_disabled()
    # The file as it is now.
    file.write_text(text.format(0.125), encoding='utf-8')
    set_values(page, gain='7')
    tool(page, 'As in the file').click()
    expect(field(page, 'threshold')).to_have_value('0.125')
    assert config_of(served) == DetectorConfig(threshold=0.125)
    file.write_text(text.format('low'), encoding='utf-8')
    set_values(page, gain='7')
    tool(page, 'As in the file').click()
    expect(refusal(page)).to_contain_text(f'{file}: parameter')


def test_groups_come_and_go_as_a_set(opened):
    served, page = opened()
    for name in ('TP', 'TD'):
        row(page, f'groups.{name}').get_by_role('button').click()
    expect(row(page, 'groups.TP')).to_contain_text('To be removed')
    new = page.get_by_label('New group')
    new.fill('all (of it')
    tool(page, 'Add').click()
    set_values(page, **{'groups.all (of it': '14, 16, 11, 9, 1, 3, 8, 6'})
    expect(refusal(page)).to_contain_text("'all (of it'")
    field(page, 'groups.all (of it').press('Escape')
    new.fill('T')
    tool(page, 'Add').click()
    set_values(page, **{'groups.T': '14, 16, 11, 9, 1, 3, 8, 6'})
    expect(changes(page)).to_contain_text('groups.TP from 14, 16, 11, 9')
    expect(row(page, 'groups.TP')).to_have_count(0)
    assert list(config_of(served).groups) == ['LR', 'LU', 'T']
    tool(page, 'Undo').click()
    expect(field(page, 'groups.TP')).to_have_value('14, 16, 11, 9')
    assert config_of(served) == DetectorConfig()


def test_two_pages_tell_each_other_what_they_change_also_after_slip_view_started_again(opened):
    served, one, other = opened(pages=2)
    field(other, 'threshold').fill('0.9')
    set_values(one, threshold='0.25')
    expect(changes(other)).to_have_text(
        'Changed on another page: threshold from 0.5 to 0.25.', timeout=1000
    )
    expect(row(other, 'threshold')).to_contain_text('the detector has 0.25.')
    expect(row(other, 'threshold')).to_contain_text('Changed on another page meanwhile.')
    expect(field(other, 'threshold')).to_have_value('0.9')
    expect(changes(one)).to_have_text('Set: threshold from 0.5 to 0.25.')
    tool(other, 'Set').click()
    expect(field(one, 'threshold')).to_have_value('0.9', timeout=1000)
    expect(row(other, 'threshold')).not_to_contain_text('meanwhile')
    served.call(lambda: served.detectors.panel(NAME).update({'gain': 5.0}))
    for page in (one, other):
        expect(changes(page).locator('li').last).to_have_text(
            'Changed by another program: gain from 100 to 5.'
        )
    begun_again = SimulatedDetectors(('index',), real_time=False)
    served.call(lambda: setattr(served.server, 'detectors', begun_again))
    expect(field(one, 'threshold')).to_have_value('0.5')
    set_values(one, threshold='0.125')
    expect(changes(one).locator('li').last).to_have_text('Set: threshold from 0.5 to 0.125.')


def test_parameters_are_saved_in_the_folder_that_is_named_and_nowhere_else(opened, tmp_path):
    served, page = opened(labels=('index', 'thumb'))
    set_values(page, threshold='0.25')
    expect(changes(page)).to_contain_text('0.25')
    expect(page.locator('#tools .saving')).to_contain_text(str(tmp_path))
    file = page.get_by_label('File', exact=True)
    expect(file).to_have_value('index')
    tool(page, 'Save').click()
    saved = page.locator('#tools .saved')
    expect(saved).to_contain_text(f'config:={tmp_path}/index.yaml')
    assert DetectorConfig.from_yaml(tmp_path / 'index.yaml') == config_of(served)
    tool(page, 'Save').click()
    expect(saved).to_contain_text('Not saved: ')
    page.locator('#tools .saving select').select_option('all')
    tool(page, 'Replace the file').click()
    expect(saved).to_contain_text(f'fingers:=index,thumb config:={tmp_path}/index.yaml')
    assert '/thumb/slip_detector:' in (tmp_path / 'index.yaml').read_text(encoding='utf-8')
    file.fill('../index')
    tool(page, 'Save').click()
    expect(saved).to_contain_text("Not saved: name is '../index', allowed: ")
    assert [path.name for path in tmp_path.iterdir()] == ['index.yaml']
