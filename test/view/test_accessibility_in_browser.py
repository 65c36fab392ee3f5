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

"""The live page without seeing it, or without a mouse: axe-core, names, and keys alone."""

import importlib.util
from pathlib import Path

import pytest

from slip_detector.view.access import Access
from slip_detector.view.detectors import Diagnosis
from support.browsers import expect
from support.finger_states import STATES, rest_rows
from support.lessons import write_lesson
from support.page_parts import changes, config_of, recording, threshold_line

#: Rules of WCAG 2.2 up to level AA, contrast among them, and what is good practice beyond.
RULES = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice')

TWO_FINGERS = {'index': rest_rows(), 'thumb': STATES['slip']}


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


@pytest.mark.parametrize(('width', 'read_only'), [(1366, False), (420, True)])
def test_axe_finds_nothing_in_any_state_of_the_fingers(played, violations, width, read_only):
    def more_diagnostics_than_fit(detectors):
        detectors.fingers['/rest/slip_detector'].diagnostics = tuple(
            Diagnosis(0, f'part {i}', 'as it should be') for i in range(12)
        )

    access = Access(read_only=read_only)
    _, page = played(STATES, more_diagnostics_than_fit, access, width)
    expect(page.locator('[data-state=slip]')).to_be_visible()
    expect(page.locator('[data-state=noInput]')).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_in_any_panel(played, violations, tmp_path):
    write_lesson(tmp_path / 'index', slips=1)
    served, page = played({'index': STATES['dead']})
    expect(page.locator('.dead.some')).to_be_visible()
    expect(recording(page, 'slip_1')).to_be_visible()
    page.get_by_role('button', name='Keys').click()
    page.get_by_text('Channels in words').click()
    page.get_by_role('tab', name='Spectrum').click()
    page.get_by_role('button', name='Hold as rest').click()
    expect(page.get_by_role('slider')).to_have_count(6)
    assert violations(page) == []
    page.get_by_role('tab', name='Parameters').click()
    page.get_by_role('tab', name='Traces').click()
    threshold_line(page).focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    expect(changes(page)).to_contain_text('threshold from')
    assert violations(page) == []
    served.call(served.detectors.remove, 'index')
    expect(page.get_by_text('No detector yet')).to_be_visible()
    assert violations(page) == []


def focused(page):
    """Return the role or element and the name of what has the focus."""
    return page.evaluate("""() => {
      const at = document.activeElement;
      return `${at.role ?? at.tagName.toLowerCase()} ${at.ariaLabel ?? at.textContent.trim()}`;
    }""")


def test_the_tab_key_comes_to_everything_by_its_role_and_name(played):
    _, page = played(TWO_FINGERS)
    expect(page.locator('[data-state=slip]')).to_be_visible()
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
        'button Pause', 'button Shorter stretch of time', 'button Longer stretch of time',
        'button Traces of ch14', 'group Traces of the chosen channels', 'slider Threshold',
        'tab Teach', 'button Rest',
    ):  # fmt: skip
        assert part.lower() in said.lower(), said
    # Of tabs the chosen one; arrows come to the others.
    assert 'tab Spectrum' not in said


def test_keys_alone_open_tabs_and_the_list_of_keys(played):
    _, page = played(TWO_FINGERS)
    page.keyboard.press('?')
    expect(page.locator('#keys')).to_contain_text('pause the traces')
    page.keyboard.press('?')
    expect(page.locator('#keys')).to_be_hidden()
    page.get_by_role('tab', name='Traces').focus()
    for name in ('Spectrum', 'Traces'):
        page.keyboard.press('ArrowRight')
        expect(page.get_by_role('tabpanel', name=name)).to_be_visible()


def test_a_threshold_moved_for_one_finger_is_not_set_for_another(played):
    served, page = played(TWO_FINGERS)
    expect(page.locator('[data-state=slip]')).to_be_visible()
    threshold_line(page).focus()
    page.keyboard.press('PageDown')
    page.keyboard.press('2')
    page.keyboard.press('1')
    expect(changes(page)).to_contain_text('threshold from 0.5 to 0.307')
    page.keyboard.press('2')
    expect(threshold_line(page)).to_have_attribute('aria-valuetext', 'threshold 0.5')
    assert config_of(served).threshold == 0.307
    assert config_of(served, '/thumb/slip_detector').threshold == 0.5
