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


"""The tabs that set a finger up in a real browser: parameters, recordings, tuning."""

import re

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.recordings.labels import read_labels
from slip_detector.view import tuning
from support import page_parts as parts
from support.browsers import expect
from support.finger_states import rest_rows
from support.simulated_detectors import SimulatedDetectors
from support.training import true_slip_s, write_recordings


def row(page, name):
    return page.locator(f'[data-name="{name}"]')


def set_values(page, **values):
    for name, value in values.items():
        parts.field(page, name).fill(value)
    parts.field(page, next(iter(values))).press('Enter')


def test_parameters_are_set_together_refused_undone_and_saved(serve, open_page, tmp_path):
    file = tmp_path / 'finger.yaml'
    file.write_text('/**/slip_detector: {ros__parameters: {threshold: 0.5}}', encoding='utf-8')
    served, page = serve(SimulatedDetectors(('index', 'thumb'), real_time=False), [file])
    other = open_page(served)
    for each in (page, other):
        parts.tab(each, 'Parameters').click()
        expect(parts.field(each, 'threshold')).to_have_value('0.5')
    closed = page.locator('#parameters details:not([open]) > summary')
    while closed.count():
        closed.first.click()
    expect(row(page, 'max_gap_s')).to_contain_text('Allowed: 0 to 60.')
    expect(row(page, 'autostart')).to_contain_text('Holds from the start')
    expect(parts.field(page, 'autostart')).to_be_disabled()
    # What is typed in a field is no key of the page.
    parts.field(page, 'threshold').press_sequentially('p?2')
    expect(parts.button(page, 'Pause')).to_be_visible()
    set_values(page, threshold='<b>low', gain='2')
    refusal = page.locator('#parameters [role=alert]')
    expect(refusal).to_have_text("Refused: parameter threshold is '<b>low', allowed: a number")
    expect(parts.field(page, 'threshold')).to_have_attribute('aria-invalid', 'true')
    assert parts.config_of(served) == DetectorConfig()
    parts.tool(page, 'Dismiss').click()
    expect(refusal).to_be_hidden()
    parts.field(page, 'threshold').press('Enter')
    expect(refusal).to_be_visible()
    parts.field(page, 'threshold').fill('0.3')
    expect(refusal).to_be_hidden()
    parts.tool(page, 'Discard').click()
    expect(parts.field(page, 'gain')).to_have_value('100')
    # Two pages tell each other what they change.
    parts.field(other, 'threshold').fill('0.9')
    set_values(page, threshold='0.25', passband_hz='10, 60')
    words = 'Set: passband_hz from 7, 50 to 10, 60, threshold from 0.5'
    expect(parts.changes(page)).to_contain_text(words)
    expect(parts.changes(other)).to_contain_text('Changed on another page: passband_hz')
    expect(row(other, 'threshold')).to_contain_text('Not set yet; the detector has 0.25.')
    expect(parts.field(other, 'threshold')).to_have_value('0.9')
    finger = served.detectors.fingers[parts.NAME]
    served.call(finger.update_config, finger.config.with_values({'gain': 5.0}), 'outside')
    expect(parts.changes(page)).to_contain_text('Changed by another program: gain from 100 to 5.')
    expect(page.locator('#parameters')).to_contain_text('Undo takes back: gain from')
    for name, field, value in (('Undo', 'gain', '100'), ('As in the file', 'threshold', '0.5')):
        parts.tool(page, name).click()
        expect(parts.field(page, field)).to_have_value(value)
    # A group comes, another goes, at once.
    row(page, 'groups.TP').get_by_role('button', name='Remove', exact=True).click()
    page.get_by_label('New group', exact=True).fill('T')
    parts.tool(page, 'Add').click()
    set_values(page, **{'groups.T': '14, 16, 11, 9'})
    expect(parts.changes(page)).to_contain_text('groups.TP from 14, 16, 11, 9')
    assert list(parts.config_of(served).groups) == ['TD', 'LR', 'LU', 'T']
    saved = page.locator('#tools .saved')
    expect(page.get_by_label('File', exact=True)).to_have_value('index')
    for words in (f'config:={tmp_path}/index.yaml', 'Not saved: '):
        parts.tool(page, 'Save').click()
        expect(saved).to_contain_text(words)
    page.locator('#tools .saving select').select_option('all')
    parts.tool(page, 'Replace the file').click()
    expect(saved).to_contain_text(f'fingers:=index,thumb config:={tmp_path}/index.yaml')


def test_rest_and_slips_are_recorded_listed_tuned_on_and_deleted(played, tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, 'COMMAND', ('false',))
    write_recordings(tmp_path / 'index', slips=3)
    (tmp_path / 'index' / 'slip_3' / 'slip_3.mcap').write_bytes(b'no bag')
    _, page = played({'index': rest_rows()})
    now, listed = parts.recording_now(page), page.locator('.recordings tbody th')
    expect(parts.recording(page, 'slip_1')).to_contain_text('tuning')
    expect(parts.recording(page, 'slip_3')).to_contain_text('not used')
    expect(parts.record_button(page, 'Slip')).to_contain_text('2 of 20')
    expect(now).to_have_text('Nothing is recorded now.')
    # A key that repeats is one slip; letters in a field record nothing.
    page.get_by_label('File', exact=True).fill('')
    page.get_by_label('File', exact=True).press_sequentially('r t s')
    page.evaluate('document.activeElement.blur()')
    for _ in range(3):
        page.keyboard.down(' ')
    expect(now).to_contain_text('slip_4')
    expect(now).to_contain_text('SLIP')
    page.keyboard.up(' ')
    expect(parts.recording(page, 'slip_4')).to_be_visible()
    # It ends, too, when the page no longer sees the key, and when the page is gone.
    page.keyboard.down(' ')
    expect(now).to_contain_text('SLIP')
    page.evaluate('window.dispatchEvent(new Event("blur"))')
    expect(parts.recording(page, 'slip_5')).to_be_visible()
    page.keyboard.up(' ')
    slip = parts.record_button(page, 'Slip')
    slip.press('Enter')  # Where no key can be held, one press begins it, one ends it.
    expect(slip).to_have_attribute('aria-pressed', 'true')
    slip.press('Enter')
    expect(parts.recording(page, 'slip_6')).to_be_visible()
    page.keyboard.press('r')
    expect(now).to_contain_text('rest_3')
    page.reload()
    expect(parts.record_button(page, 'Rest')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.press('r')
    expect(parts.recording(page, 'rest_3')).to_be_visible()
    parts.record_button(page, 'Press').click()
    expect(now).to_contain_text('press_1')
    page.keyboard.press('s')
    expect(parts.recording(page, 'press_1')).to_be_visible()
    parts.tool(page, 'Tune').click()
    words = re.compile('^Tuning failed: the search ended.*What was recorded is kept')
    expect(page.locator('#tuning-failed')).to_contain_text(words)
    count = listed.count()
    for answer, left in (('dismiss', count), ('accept', count - 1)):
        page.once('dialog', lambda dialog, answer=answer: getattr(dialog, answer)())
        parts.tool(page, 'Delete slip_1').click()
        expect(listed).to_have_count(left)


def test_the_end_of_a_label_is_dragged_snapped_and_saved_beside_the_decision(played, tmp_path):
    write_recordings(tmp_path / 'index', slips=1)
    _, page = played({'index': rest_rows()})
    traces = page.locator('.recording-trace')
    trace = traces.nth(2)
    expect(trace).to_contain_text(re.compile('ON for .* of the slip, .* of the rest'))
    expect(traces.first).to_contain_text(re.compile('ON for .* % of the rest'))
    end = parts.slider(page, 'End of the slip in slip_1')
    by_key_s = float(end.get_attribute('aria-valuenow'))
    file = tmp_path / 'index' / 'slip_1.labels.yaml'
    parts.press(end, 'PageUp', 'PageUp', 'Enter')
    expect(trace).to_contain_text('Saved')
    assert read_labels(file).edges_s[0, 1] == pytest.approx(by_key_s + 0.2)
    # The hand was late; now both ends are where the plate begins and ends to slide.
    parts.tool(page, 'Snap slip_1').click()
    expect(trace).to_contain_text('Saved: start')
    assert read_labels(file).edges_s == pytest.approx(true_slip_s('slip_1')[np.newaxis], abs=0.05)
    for ends_s in (by_key_s + 0.2, by_key_s):
        parts.tool(page, 'Undo slip_1').click()
        expect(end).to_have_attribute('aria-valuetext', f'{ends_s:.2f} s')
    # Opened, and zoomed about the end, which is dragged and stops at the start of the slip.
    frame = trace.locator('.trace-frame')
    end.focus()
    expect(frame.locator('canvas')).to_have_css('height', '120px')
    end.hover()
    before = end.bounding_box()
    page.mouse.wheel(0, -500)
    page.wait_for_function(
        '(one) => one.scrollWidth > 2 * one.clientWidth', arg=frame.element_handle()
    )
    assert end.bounding_box()['x'] == pytest.approx(before['x'], abs=3)
    page.mouse.down()
    page.mouse.move(0, 0)
    page.mouse.up()
    start = parts.slider(page, 'Start of the slip in slip_1')
    start_s = float(start.get_attribute('aria-valuenow'))
    expect(end).to_have_attribute('aria-valuetext', f'{start_s + 0.01:.2f} s')
