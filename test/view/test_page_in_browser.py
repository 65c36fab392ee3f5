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


"""The page in a real browser: states of fingers, its connection, and who cannot see or click."""

import copy
import threading
import time
from pathlib import Path

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.access import Access
from slip_detector.view.detectors import Diagnosis
from slip_detector.view.server import NO_TOKEN
from support import page_parts as parts
from support.browsers import PATIENCE_MS, expect
from support.finger_states import STATES, rest_rows, slip_rows
from support.simulated_detectors import SimulatedDetectors, served_beside
from support.training import write_recordings

#: Rules of WCAG 2.2 up to level AA, contrast among them, and what is good practice beyond.
RULES = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice')

WORDS = {
    'rest': ('rest', 'all channels valid'),
    'slip': ('SLIP', 'all channels valid'),
    'dead': ('rest', 'ch7 is not valid'),
    'none': ('no input', 'no sample has come yet'),
    'invalid': ('not valid', '12 more are not valid'),
}


def wait_until_it_fits(page, *widths):
    """Give the window each width, and wait until the page is no wider."""
    for width in widths:
        page.set_viewport_size({'width': width, 'height': 768})
        fits = 'width => document.documentElement.scrollWidth <= width'
        page.wait_for_function(fits, arg=width, timeout=10_000)


def violations(page):
    """Return the violations that axe-core finds on a page, in words."""
    package = pytest.importorskip('axe_core_python')
    page.evaluate((Path(package.__file__).parent / 'axe.min.js').read_text(encoding='utf-8'))
    result = page.evaluate('(tags) => axe.run(document, {runOnly: tags})', list(RULES))
    assert len(result['passes']) > 20
    return [
        f'{each["id"]}: {each["help"]}: {node["html"][:200]}'
        for each in result['violations']
        for node in each['nodes']
    ]


def test_each_state_is_in_words_the_page_fits_any_width_and_axe_finds_nothing(played, tmp_path):
    write_recordings(tmp_path / 'dead', slips=1)
    served, page = played(STATES)
    for label, words in WORDS.items():
        for word in words:
            expect(parts.card(page, label)).to_contain_text(word)
        # A screen reader hears the same of the picture.
        named = parts.card(page, label).get_by_role('img', name=f'{label}: {words[0]}')
        expect(named).to_be_visible()
    expect(parts.card(page, 'none').locator(':is(.groups, .onset):visible')).to_have_count(0)
    expect(parts.recording(page, 'slip_1')).to_be_visible()
    page.get_by_text('Keys', exact=True).click()
    parts.card(page, 'dead').get_by_text('Channels in words', exact=True).click()
    parts.tab(page, 'Spectrum').click()
    parts.button(page, 'Hold as rest').click()
    expect(page.get_by_role('slider')).to_have_count(8)  # Two are the ends of the label.
    assert violations(page) == []
    # 320 pixels are a laptop's window that is enlarged four times, as WCAG 1.4.10 wants it.
    for name in ('Traces', 'Teach', 'Spectrum', 'Parameters'):
        parts.tab(page, name).click()
        wait_until_it_fits(page, 1366, 800, 400, 320)
    finger = served.detectors.fingers['/dead/slip_detector']
    served.call(finger.update_config, finger.config.with_values({'threshold': 0.4}), 'outside')
    # No file is known.
    expect(page.locator('[data-name="threshold"]')).to_contain_text('As first seen: 0.5.')
    assert violations(page) == []
    wait_until_it_fits(page, 1366)
    for scheme in ('light', 'dark'):
        page.emulate_media(color_scheme=scheme)
        assert violations(page) == []
    for label in STATES:
        served.call(served.detectors.remove, label)
    expect(page).to_have_title('slip_view')
    expect(page.locator('#no-finger')).to_be_visible()
    assert violations(page) == []


def test_what_is_wrong_stands_first_and_whole_and_nothing_stands_twice(played):
    unplugged = ', '.join(f'ch{c} is flat' for c in range(1, 17))

    def prepare(detectors):
        rest, dead, none = detectors.fingers.values()
        rest.diagnostics = Diagnosis(0, 'decisions', 'slip is ON'), Diagnosis(0, 'input', 'well')
        dead.diagnostics = (
            *rest.diagnostics,
            Diagnosis(1, 'clock', 'is slow'),
            Diagnosis(2, 'channels', unplugged),
        )
        none.unfit = time.monotonic() + 3600.0, 'samples come, but they have 8 channels'

    states = {name: STATES[name] for name in ('rest', 'dead', 'none')}
    _, page = played(states, prepare, (1024, 768))

    def lines(label):
        return parts.card(page, label).locator('.diagnostics li')

    expect(lines('rest')).to_have_text('\u2713 input: well')
    expect(lines('dead')).to_have_text([f'\u2715 channels: {unplugged}', '\u25b2 clock: is slow'])
    expect(parts.card(page, 'none')).to_contain_text('samples come, but they have 8 channels')
    expect(lines('none')).to_be_hidden()
    dead = parts.card(page, 'dead')
    listed, picture = dead.locator('.diagnostics'), dead.locator('.picture').bounding_box()
    below = lines('dead').last.bounding_box()
    assert picture['y'] >= below['y'] + below['height']
    assert listed.evaluate('(list) => list.scrollHeight <= list.clientHeight')


def test_names_and_diagnostics_are_shown_as_text(played, monkeypatch):
    name = '<img src=x onerror="document.title=1">'
    config = DetectorConfig(channels=2, groups={'a': (1,), 'b': (2,)})
    # No detector would take such names, nor say what is allowed beside them.
    monkeypatch.setattr(DetectorConfig, 'limits', lambda config: {})
    forged = copy.copy(config)
    object.__setattr__(forged, 'channel_names', (f'one {name}', f'two {name}'))
    object.__setattr__(forged, 'groups', {f'of {name}': (1,), f'no {name}': (2,)})

    def prepare(detectors):
        (finger,) = detectors.fingers.values()
        finger.config = forged
        finger.diagnostics = (Diagnosis(1, name, f'{name} & lost'),)
        finger.no_volts = f'no volts are shown {name}'

    _, page = played({f'index{name}': rest_rows()[:, :2]}, prepare, config=config)
    expect(page.locator('[data-state=rest]')).to_be_visible()
    expect(page.get_by_role('heading', name=f'index{name}', exact=True)).to_be_visible()
    page.locator('.finger').get_by_text('Channels in words', exact=True).click()
    first = page.locator('.finger details li').first
    expect(first).to_contain_text(f'one {name}, group of {name}')
    expect(parts.button(page, f'Traces of one {name}')).to_be_visible()
    expect(page.locator('.lane-name.channel')).to_have_text(f'one {name}')
    line = page.locator('.diagnostics li')
    expect(line).to_contain_text(f'{name}: {name} & lost')
    expect(line.get_by_role('img', name='warning', exact=True)).to_be_visible()
    expect(page.locator('.finger .notice')).to_have_text(f'no volts are shown {name}')
    parts.tab(page, 'Spectrum').click()
    expect(page.get_by_label('Channel', exact=True)).to_contain_text(f'two {name}')
    assert page.locator('img').count() == 0
    expect(page).to_have_title(f'○ rest index{name} · slip_view')
    wait_until_it_fits(page, 1366, 400)


def keep_texts(page, selector):
    """Keep what an element shows from now on, as a busy machine may not see all of it."""
    page.evaluate(
        """(selector) => {
          const place = document.querySelector(selector);
          window.shown = [place.textContent];
          new MutationObserver(() => shown.push(place.textContent))
            .observe(place, {childList: true, characterData: true, subtree: true});
        }""",
        selector,
    )


def wait_until_shown(page, words):
    """Wait for words among the texts that were kept; look only at later ones the next time."""
    page.wait_for_function(
        """(words) => {
          const at = shown.findIndex((each) => each.includes(words));
          return shown.splice(0, at + 1).length > 0;
        }""",
        arg=words,
        timeout=PATIENCE_MS,
    )


def test_changes_are_announced_politely_a_short_slip_too(played):
    served, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    news = page.locator('#news')
    expect(news).to_have_attribute('role', 'status')
    keep_texts(page, '#news')
    wait_until_shown(page, 'index: rest')
    # A slip that is over before it is announced.
    index = served.detectors.simulated[parts.NAME]
    served.call(setattr, index, 'rows', slip_rows())
    expect(parts.card(page)).to_contain_text('SLIP')
    served.call(setattr, index, 'rows', rest_rows())
    wait_until_shown(page, 'index: SLIP')
    wait_until_shown(page, 'index: rest')
    served.call(served.detectors.remove, 'index')
    expect(news).to_contain_text('index: detector gone')
    expect(page.locator('#gone')).to_contain_text('index: its detector has ended')


def test_keys_change_only_the_chosen_finger_which_stays_chosen_while_it_is_gone(played):
    served, page = played({'index': rest_rows(), 'thumb': STATES['slip']})
    expect(page.locator('[data-state=slip]')).to_be_visible()
    page.keyboard.press('?')
    expect(page.locator('#keys')).to_contain_text('pause the traces')
    page.keyboard.press('?')
    expect(page.locator('#key-list')).to_be_hidden()
    parts.tab(page, 'Traces').focus()
    for name in ('Spectrum', 'Traces'):
        page.keyboard.press('ArrowRight')
        expect(page.get_by_role('tabpanel', name=name, exact=True)).to_be_visible()
    parts.press(parts.threshold_line(page), 'PageDown', '2', '1')
    expect(parts.changes(page)).to_contain_text('threshold from 0.5 to 0.307')
    box = parts.card(page, 'thumb').locator('.taxels').bounding_box()
    # ch1 is the first of the grid: at the upper left of the picture's middle.
    page.mouse.click(
        box['x'] + box['width'] / 2 - 1.5 * box['height'] / 4, box['y'] + box['height'] / 8
    )
    thumb = parts.button(page, 'thumb')
    expect(page.get_by_role('heading', name='Set up thumb', exact=True)).to_be_visible()
    expect(parts.threshold_line(page)).to_have_attribute('aria-valuetext', 'threshold 0.5')
    assert parts.config_of(served).threshold == 0.307
    assert parts.config_of(served, '/thumb/slip_detector').threshold == 0.5
    page.keyboard.press('1')
    expect(page.get_by_role('heading', name='Signals of index', exact=True)).to_be_visible()
    page.keyboard.press('2')
    lanes = page.locator('.lane-name.channel')
    expect(lanes).to_have_text(['ch1', 'ch9', 'ch11', 'ch14', 'ch16'])
    page.reload()
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    # No key is meant for another finger while it is gone.
    expect(parts.record_button(page, 'Rest')).to_be_enabled()
    served.call(served.detectors.remove, 'thumb')
    expect(page.locator('#tools-title')).to_have_text('Set up thumb, which is gone')
    expect(parts.record_button(page, 'Rest')).to_be_disabled()
    expect(parts.button(page, 'index')).to_have_attribute('aria-pressed', 'false')
    served.call(lambda: served.detectors.add('thumb', DetectorConfig(), rows=rest_rows()))
    expect(page.get_by_role('heading', name='Signals of thumb', exact=True)).to_be_visible()
    expect(parts.record_button(page, 'Rest')).to_be_enabled()


def test_when_slip_view_ends_the_page_says_so_and_connects_again_by_itself(browser):
    page = browser.new_page()
    with served_beside(SimulatedDetectors(), access=Access(token='word')) as served:
        page.goto(served.url)
        expect(parts.card(page)).to_have_attribute('data-state', 'rest')
        keep_texts(page, '#connection')
    words = page.locator('#connection')
    wait_until_shown(page, 'slip_view was stopped')
    expect(words).to_contain_text('slip_view cannot be reached')
    # What is shown of the finger is old, and it does not look as if it were not.
    expect(parts.card(page)).to_have_attribute('data-state', 'lost')
    expect(parts.card(page)).to_contain_text('not connected')
    port = int(served.url.split(':')[2].partition('/')[0])
    with served_beside(SimulatedDetectors(('thumb',)), access=Access(token='word'), port=port):
        expect(words).to_have_text('connected')
        expect(parts.card(page, 'thumb')).to_have_attribute('data-state', 'rest')
    with served_beside(SimulatedDetectors(), access=Access(token='another'), port=port):
        expect(words).to_contain_text(NO_TOKEN)
        page.close()


def test_a_slip_view_that_hangs_is_reported_and_no_button_looks_as_if_it_worked(serve):
    served, page = serve(SimulatedDetectors())
    words = page.locator('#connection')
    buttons = parts.record_button(page, 'Rest'), parts.tool(page, 'Save')
    expect(parts.threshold_line(page)).to_have_attribute('aria-disabled', 'false')
    goes_on = threading.Event()
    hanging = threading.Thread(target=served.call, args=(goes_on.wait, PATIENCE_MS / 1e3))
    hanging.start()
    try:
        expect(words).to_have_text('slip_view does not answer')
        expect(parts.card(page)).to_have_attribute('data-state', 'lost')
        for button in buttons:
            expect(button).to_be_disabled()
        expect(parts.threshold_line(page)).to_have_attribute('aria-disabled', 'true')
        expect(parts.recording_now(page)).to_contain_text('what is recorded is not known')
    finally:
        goes_on.set()
        hanging.join()
    expect(words).to_have_text('connected')
    expect(parts.card(page)).not_to_have_attribute('data-state', 'lost')
    for button in buttons:
        expect(button).to_be_enabled()


def test_with_read_only_nothing_can_be_changed_in_any_tab(serve, tmp_path):
    write_recordings(tmp_path / 'index', slips=2)
    served, page = serve(SimulatedDetectors(), access=Access(read_only=True))
    before = parts.config_of(served)
    served.detectors.fingers[parts.NAME].to_fit = {'channels': 6}
    expect(parts.button(page, 'Take 6 channels at 380 Hz: index')).to_be_disabled()
    for word in ('Rest', 'Slip', 'Taps'):
        expect(parts.record_button(page, word)).to_be_disabled()
    for name in ('Tune', 'Delete slip_1', 'Save'):
        expect(parts.tool(page, name)).to_be_disabled()
    expect(parts.recording_now(page)).to_contain_text('--read-only')
    parts.press(parts.threshold_line(page), 'PageUp', 'Enter')
    expect(parts.threshold_line(page)).to_have_attribute('aria-valuetext', 'threshold 0.5')
    parts.tab(page, 'Parameters').click()
    expect(page.locator('#parameters')).to_contain_text('--read-only')
    expect(parts.tool(page, 'Set')).to_be_disabled()
    expect(page.locator('#parameters form :is(input, select):enabled')).to_have_count(0)
    parts.tab(page, 'Spectrum').click()
    expect(parts.mains(page)).to_be_disabled()
    assert parts.config_of(served) == before
