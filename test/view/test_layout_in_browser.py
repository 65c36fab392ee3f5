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


"""What is in sight on the page, on a laptop, an older one and a phone."""

import io
from itertools import combinations

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.recordings import RecordedFolder
from slip_detector.view.tuning import TuneRun
from support import page_parts as parts
from support.browsers import expect
from support.finger_states import rest_rows, slip_rows

#: Width and height of windows.
LAPTOP, OLD_LAPTOP, PHONE = (1440, 900), (1024, 768), (390, 844)


def tuned(served):
    """Let the tuning of the finger have found something."""
    run = TuneRun(RecordedFolder(None), parts.NAME, DetectorConfig())
    run.running, run.found = False, DetectorConfig(threshold=0.25)
    run.said['answer'] = ['Finds 9 of 10 slips (before: 8).']
    served.server.requests['apply_tuning'].__self__._run = run


def click_and_see_beside(page, name, answer, words):
    """Click a button that stands at the lower edge of the window; the answer stands beside it."""
    button = parts.tool(page, name)
    button.evaluate('button => button.scrollIntoView({block: "end"})')
    button.click()
    expect(answer).to_contain_text(words)
    expect(answer).to_be_in_viewport(ratio=1)
    expect(button).to_be_in_viewport()
    asked, told = button.bounding_box(), answer.bounding_box()
    assert abs(told['y'] - asked['y']) < 60


@pytest.mark.parametrize('size', [LAPTOP, PHONE], ids=['laptop', 'phone'])
def test_an_answer_stands_beside_its_button_in_sight(played, size):
    served, page = played({'index': rest_rows()}, size=size)
    saved = page.locator('#saved')
    click_and_see_beside(page, 'Save', saved, 'Saved. ros2 launch')
    click_and_see_beside(page, 'Save', saved, 'already exists')
    expect(parts.tool(page, 'Replace the file')).to_be_in_viewport(ratio=1)
    served.call(tuned, served)
    expect(parts.tool(page, 'Apply 1 values')).to_be_enabled()
    words, refusal = page.locator('.teach-words'), page.locator('#teach .refusal:visible')
    click_and_see_beside(page, 'Apply 1 values', words, '1 values set')
    finger = served.detectors.fingers[parts.NAME]
    served.call(finger.update_config, DetectorConfig(sample_rate_hz=400.0))
    # News of parameters takes a refusal away, so it has to come first.
    expect(parts.field(page, 'sample_rate_hz')).to_have_value('400')
    click_and_see_beside(page, 'Apply 1 values', refusal, 'tune it again')


def box(locator):
    """Return left, top, right and bottom of an element in the window."""
    corners = '({left, top, right, bottom}) => [left, top, right, bottom]'
    return locator.evaluate(f'(each) => ({corners})(each.getBoundingClientRect())')


def light(locator):
    """Return the mean lightness of what is seen of an element, 0 to 255."""
    image = pytest.importorskip('PIL.Image')
    return np.mean(image.open(io.BytesIO(locator.screenshot())).convert('L'))


def overlap(one, other):
    return all(min(one[i + 2], other[i + 2]) > max(one[i], other[i]) + 0.5 for i in (0, 1))


@pytest.mark.parametrize('size', [LAPTOP, OLD_LAPTOP], ids=['laptop', 'old_laptop'])
def test_one_finger_fills_the_screen(played, size):
    _, page = played({'index': rest_rows()}, size=size)
    width, height = size
    traces, words, tools = map(page.locator, ('#timeline', '.finger', '#tools'))
    expect(page.locator('.lane-name.channel')).to_have_count(4)
    left, _, right, bottom = box(traces)
    assert 0.85 * height < bottom < height
    assert right - left > 0.55 * width
    assert box(tools)[2] > width - 40
    assert box(tools)[0] - box(words)[2] < 40
    stops = 1  # Of Tab, up to Tune.
    while page.evaluate('document.activeElement.id') != 'record-press':
        page.keyboard.press('Tab')
        stops += 1
        assert stops <= 20
    # The signals stay in sight beside a long form.
    parts.tab(page, 'Parameters').click()
    page.mouse.wheel(0, 600)
    page.wait_for_function('() => scrollY > 300')
    expect(parts.threshold_line(page)).to_be_in_viewport(ratio=1)
    expect(parts.tool(page, 'Set')).to_be_in_viewport(ratio=1)


def test_five_fingers_stand_side_by_side_and_fit_on_a_phone(played):
    rows = dict.fromkeys(('index', 'little', 'middle', 'ring'), rest_rows())
    _, page = played({**rows, 'thumb': slip_rows()}, size=OLD_LAPTOP)
    cards = [box(each) for each in page.locator('.finger').all()]
    assert len({top for _, top, _, _ in cards}) == 1
    assert cards[-1][2] > OLD_LAPTOP[0] - 40
    expect(page).to_have_title('▲ SLIP thumb · slip_view')
    parts.tab(page, 'Spectrum').click()
    page.mouse.click(OLD_LAPTOP[0] / 2, 5)
    page.keyboard.press('Tab')
    skip = parts.button(page, 'To the threshold')
    expect(skip).to_be_focused()
    expect(skip).to_be_in_viewport(ratio=1)
    page.keyboard.press('Enter')
    expect(parts.threshold_line(page)).to_be_focused()
    # On a phone traces come early, and nothing overlaps.
    page.set_viewport_size({'width': PHONE[0], 'height': PHONE[1]})
    parts.tab(page, 'Traces').click()
    page.evaluate('scrollTo(0, 0)')
    touch = page.context.new_cdp_session(page)
    touch.send('Emulation.setTouchEmulationEnabled', {'enabled': True})
    expect(page.locator('.lane-name.channel').first).to_be_in_viewport(ratio=1)
    assert box(page.locator('#timeline'))[1] < 0.75 * PHONE[1]
    slip = parts.record_button(page, 'Slip')
    expect(slip.get_by_text('hold the button', exact=True)).to_be_visible()
    expect(page.locator('kbd:visible')).to_have_count(0)
    small = 'all => all.filter((one) => Math.min(one.clientWidth, one.clientHeight) < 38).length'
    pressed = page.locator(':is(button, select, summary, [role=slider], label:has(input)):visible')
    for name in ('Traces', 'Parameters', 'Spectrum'):
        parts.tab(page, name).click()
        assert pressed.evaluate_all(small) == 0
    labels = page.locator('#spectrum-frame .label')
    expect(labels).to_have_count(6)
    boxes, (left, _, right, _) = [*map(box, labels.all())], box(page.locator('#spectrum'))
    assert not any(overlap(one, other) for one, other in combinations(boxes, 2))
    assert all(left <= each[0] and each[2] <= right for each in boxes)


def test_drawings_follow_the_dark_mode_and_what_is_changed_most_often_stands_on_top(played):
    _, page = played({'index': rest_rows()}, size=LAPTOP)
    expect(page.locator('.lane-name.channel')).to_have_count(4)
    for tab in ('Traces', 'Spectrum'):
        parts.tab(page, tab).click()
        for scheme in ('light', 'dark'):
            page.emulate_media(color_scheme=scheme)
            for part in map(page.locator, ('body', '.taxels', f'#{tab.lower()}')):
                # The drawings change with the next frame.
                while not (light(part) > 200 if scheme == 'light' else light(part) < 70):
                    page.wait_for_timeout(50)
    parts.tab(page, 'Parameters').click()
    threshold = parts.field(page, 'threshold')
    presets = parts.tool(page, 'grasp'), parts.tool(page, 'As first seen')
    for each in (threshold, parts.field(page, 'vote'), *presets):
        expect(each).to_be_in_viewport(ratio=1)
    before = box(threshold)
    parts.tool(page, 'onset').click()
    expect(parts.changes(page)).to_contain_text('passband_hz from 7, 50 to 45, 0')
    expect(parts.tool(page, 'onset')).to_have_attribute('aria-pressed', 'true')
    expect(threshold).to_have_value('0.0265')
    assert box(threshold) == before
    page.get_by_role('searchbox').fill('mains')
    expect(parts.field(page, 'mains_hz')).to_be_in_viewport(ratio=1)
    expect(threshold).to_be_hidden()
    page.get_by_role('searchbox').fill('')
    expect(threshold).to_be_visible()
    expect(parts.field(page, 'mains_hz')).to_be_hidden()
    # Nothing scrolls but the page.
    scrollers = '/auto|scroll/.test(getComputedStyle(each).overflowY)'
    count = f'all => all.filter((each) => {scrollers}).length'
    assert page.locator('#parameters *').evaluate_all(count) == 0
