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

"""The live page for who does not see it, or has no mouse: axe-core, names, and keys alone."""

import importlib.util
from pathlib import Path

import pytest

from slip_detector.view.access import Access
from support.browsers import expect
from support.finger_states import STATES, rest_rows

#: Rules of WCAG 2.2 up to level AA, contrast among them, and what is good practice beyond.
RULES = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice')


@pytest.fixture(scope='module')
def axe():
    found = importlib.util.find_spec('axe_core_python')
    if found is None or found.origin is None:
        pytest.skip('needs the Python package axe-core-python')
    return (Path(found.origin).parent / 'axe.min.js').read_text(encoding='utf-8')


@pytest.fixture
def violations(axe):
    """Return what gives the violations that axe-core finds on a page, in words."""

    def found_on(page):
        page.evaluate(axe)
        result = page.evaluate('(tags) => axe.run(document, {runOnly: tags})', list(RULES))
        assert len(result['passes']) > 20
        return [
            f'{each["id"]}: {each["help"]}: {node["html"][:200]}'
            for each in result['violations']
            for node in each['nodes']
        ]

    return found_on


def test_axe_finds_nothing_in_any_state_of_the_fingers(played, violations):
    _, page = played(STATES)
    expect(page.locator('[data-state=slip]')).to_be_visible(timeout=60_000)
    expect(page.locator('[data-state=noInput]')).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_in_any_panel(played, violations):
    served, page = played({'index': STATES['dead']})
    expect(page.locator('.dead.some')).to_be_visible(timeout=60_000)
    page.get_by_role('button', name='Keys').click()
    page.get_by_text('Channels in words').click()
    page.get_by_role('tab', name='Spectrum').click()
    page.get_by_role('button', name='Hold as rest').click()
    expect(page.get_by_role('slider')).to_have_count(6)
    assert violations(page) == []
    page.get_by_role('tab', name='Parameters').click()
    expect(page.locator('#parameters')).to_contain_text('threshold')
    assert violations(page) == []
    # Refused, and set.
    page.get_by_role('tab', name='Traces').click()
    line = page.get_by_role('slider', name='Threshold')
    line.focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    expect(page.locator('#parameters .changes')).to_contain_text('threshold from')
    assert violations(page) == []
    served.call(served.hand.remove, 'index')
    expect(page.get_by_text('No detector yet')).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_on_a_narrow_page_that_may_change_nothing(played, violations):
    rows_of = {'index': rest_rows(), 'thumb': None}
    _, page = played(rows_of, access=Access(read_only=True), width=420)
    expect(page.locator('[data-state=rest]')).to_be_visible(timeout=60_000)
    assert violations(page) == []


def test_each_part_has_a_role_and_a_name(played):
    _, page = played({'index': rest_rows(), 'thumb': STATES['slip']})
    expect(page.get_by_role('img', name='thumb: SLIP')).to_be_visible(timeout=60_000)
    for role, name in (
        ('heading', 'slip_view'), ('region', 'Fingers'), ('heading', 'index'), ('button', 'thumb'),
        ('region', 'Signals'), ('tab', 'Traces'), ('tab', 'Spectrum'), ('tabpanel', 'Traces'),
        ('region', 'Set up'), ('tab', 'Teach'), ('tab', 'Parameters'), ('tabpanel', 'Teach'),
        ('slider', 'Threshold'), ('button', 'Pause'), ('button', 'Shorter stretch of time'),
        ('button', 'Longer stretch of time'), ('group', 'Channels with traces'),
        ('button', 'Traces of ch14'), ('group', 'Traces of the chosen channels'),
    ):  # fmt: skip
        expect(page.get_by_role(role, name=name).first).to_be_visible()


def focused(page):
    """Return the role or element and the name of what has the focus."""
    return page.evaluate("""() => {
      const at = document.activeElement;
      return `${at.role ?? at.tagName.toLowerCase()} ${at.ariaLabel ?? at.textContent.trim()}`;
    }""")


def test_the_tab_key_comes_to_everything(played):
    _, page = played({'index': rest_rows(), 'thumb': STATES['slip']})
    expect(page.locator('[data-state=slip]')).to_be_visible(timeout=60_000)
    page.evaluate('document.activeElement.blur()')
    visited = []
    for _ in range(80):
        page.keyboard.press('Tab')
        now = focused(page)
        if visited and now == visited[0]:
            break
        visited.append(now)
    said = '\n'.join(visited)
    for part in (
        'button Keys', 'button index', 'button thumb', 'summary Channels in words', 'tab Traces',
        'button Pause', 'button Traces of ch14', 'group Traces of the chosen channels',
        'slider Threshold', 'tab Teach', 'button Rest',
    ):  # fmt: skip
        assert part.lower() in said.lower(), said
    # Of tabs the chosen one; arrows come to the others.
    assert 'tab Spectrum' not in said


def test_keys_alone_choose_a_finger_look_at_it_and_change_its_threshold(played):
    served, page = played({'index': rest_rows(), 'thumb': STATES['slip']})
    expect(page.locator('[data-state=slip]')).to_be_visible(timeout=60_000)
    page.keyboard.press('2')
    expect(page.get_by_role('button', name='thumb')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.press('p')
    expect(page.get_by_role('button', name='Go on')).to_be_visible()
    page.keyboard.press('p')
    page.keyboard.press('?')
    expect(page.locator('#keys')).to_contain_text('pause the traces')
    page.keyboard.press('?')
    expect(page.locator('#keys')).to_be_hidden()
    page.get_by_role('tab', name='Traces').focus()
    page.keyboard.press('ArrowRight')
    expect(page.get_by_role('tabpanel', name='Spectrum')).to_be_visible()
    page.keyboard.press('ArrowRight')
    expect(page.get_by_role('tabpanel', name='Traces')).to_be_visible()
    while 'Threshold' not in focused(page):
        page.keyboard.press('Tab')
    page.keyboard.press('PageDown')
    page.keyboard.press('Enter')
    expect(page.locator('#parameters .changes')).to_contain_text('threshold from 0.5 to 0.307')
    thumb = served.hand.fingers['/thumb/slip_detector']
    assert served.call(lambda: thumb.config.threshold) == 0.307


def test_what_was_moved_for_one_finger_is_not_set_for_another(played):
    served, page = played({'index': rest_rows(), 'thumb': STATES['slip']})
    expect(page.locator('[data-state=slip]')).to_be_visible(timeout=60_000)
    line = page.get_by_role('slider', name='Threshold')
    line.focus()
    page.keyboard.press('PageDown')
    page.keyboard.press('2')
    page.keyboard.press('1')
    expect(page.locator('#parameters .changes')).to_contain_text('threshold from 0.5 to 0.307')
    page.keyboard.press('2')
    expect(line).to_have_attribute('aria-valuetext', 'threshold 0.5')
    fingers = served.hand.fingers
    assert served.call(lambda: fingers['/index/slip_detector'].config.threshold) == 0.307
    assert served.call(lambda: fingers['/thumb/slip_detector'].config.threshold) == 0.5


def test_letters_that_are_typed_are_no_keys(played):
    _, page = played({'index': rest_rows()})
    page.get_by_role('tab', name='Parameters').click()
    field = page.get_by_label('threshold', exact=True)
    field.fill('')
    field.press_sequentially('p?2')
    expect(field).to_have_value('p?2')
    expect(page.get_by_role('button', name='Pause')).to_be_visible()
