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

"""The cards of fingers in a real browser: their state is seen without colours, read and heard."""

import io
import itertools

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Diagnosis
from support.browsers import expect
from support.finger_states import STATES, Player, rest_rows, slip_rows
from support.page_parts import card, tool

WORDS = {
    'rest': ('rest', 'all channels valid'),
    'slip': ('SLIP', 'all channels valid'),
    'dead': ('rest', 'ch7 is not valid'),
    'none': ('no input', 'no sample has come yet'),
    'invalid': ('not valid', '12 more are not valid'),
}


def luminance(page, label):
    """Return a card as it is seen, from 0 to 1, below the names."""
    image = pytest.importorskip('PIL.Image')
    seen = image.open(io.BytesIO(card(page, label).screenshot(scale='css')))
    return np.asarray(seen.convert('L').resize((260, 330)), float)[60:] / 255.0


def wait_until_it_fits(page, *widths):
    """Give the window each width, and wait until the page is no wider."""
    for width in widths:
        page.set_viewport_size({'width': width, 'height': 768})
        page.wait_for_function(
            'width => document.documentElement.scrollWidth <= width', arg=width, timeout=10_000
        )


def test_each_state_is_told_in_words_and_seen_without_colours_side_by_side(played):
    _, page = played(STATES)
    for label, words in WORDS.items():
        for word in words:
            expect(card(page, label)).to_contain_text(word)
        # A screen reader hears the same of the picture.
        named = card(page, label).get_by_role('img', name=f'{label}: {words[0]}')
        expect(named).to_be_visible()
    session = page.context.new_cdp_session(page)
    for kind in ('none', 'deuteranopia', 'protanopia', 'achromatopsia'):
        session.send('Emulation.setEmulatedVisionDeficiency', {'type': kind})
        pictures = {label: luminance(page, label) for label in STATES}
        for one, other in itertools.combinations(STATES, 2):
            differs = np.abs(pictures[one] - pictures[other]) > 0.2
            assert differs.mean() > 0.003, (kind, one, other)
    boxes = sorted((card(page, label).bounding_box() for label in STATES), key=lambda b: b['x'])
    assert len({box['y'] for box in boxes}) == 1
    for left, right in itertools.pairwise(boxes):
        assert left['x'] + left['width'] <= right['x']
    page.get_by_role('button', name='Keys').click()
    # 320 pixels are a laptop's window that is enlarged four times, as WCAG 1.4.10 wants it.
    for name in ('Traces', 'Teach', 'Spectrum', 'Parameters'):
        page.get_by_role('tab', name=name).click()
        wait_until_it_fits(page, 1366, 800, 400, 320)


def test_a_taxel_is_filled_by_its_level_outlined_when_on_hatched_and_grey(played):
    config = DetectorConfig(channels=4, disabled_channels=(4,), groups={'a': (1, 2, 3)}, vote=1)
    rows = rest_rows()[:, :4]
    rows[:, 1] = slip_rows()[:, 1]
    rows[:, 2] = np.nan
    _, page = played({'index': rows}, config=config)
    expect(card(page)).to_contain_text('valid; slip since')
    groups = card(page).locator('.groups li')
    expect(groups).to_have_text(['a1/2 ON'])
    page.get_by_text('Channels in words').click()
    told = card(page).get_by_role('list', name='Channels', exact=True).get_by_role('listitem')
    expect(told).to_contain_text(
        [
            'ch1, group a, less than 0.01',
            'ch2, group a,',
            'ch3, group a, not valid',
            'ch4, disabled',
        ]
    )
    expect(told.nth(1)).to_contain_text('of the threshold, ON')
    colors = page.evaluate("""async () => {
      const {paintFinger} = await import('/page/finger.js');
      const canvas = document.createElement('canvas');
      Object.assign(canvas, {width: 200, height: 50});
      const context = canvas.getContext('2d', {willReadFrequently: true});
      const usual = {on: false, valid: true, disabled: false};
      const states = [{...usual, level: 2 ** -2.5}, {...usual, level: 3, on: true},
        {...usual, level: NaN, valid: false}, {...usual, level: 0, disabled: true}];
      const places = states.map((_, i) => ({x: 25 + 50 * i, y: 25, side: 40}));
      paintFinger(context, places, states, new Set());
      const at = (x, y) => [...context.getImageData(x, y, 1, 1).data].slice(0, 3);
      return {
        upper: at(10, 15), lower: at(10, 35), on: at(60, 15), rim: at(55, 25),
        quietRim: at(5, 25), disabled: at(160, 15),
        hatched: new Set(Array.from({length: 12}, (_, i) => at(108 + i, 12).join())).size,
      };
    }""")
    # At 2.5 of 5 octaves below the threshold half of it is filled.
    assert sum(colors['lower']) < sum(colors['upper']) - 200
    assert colors['on'] == [0xD5, 0x5E, 0x00]
    assert sum(colors['rim']) < 60 < sum(colors['quietRim'])
    assert colors['hatched'] > 2
    assert max(colors['disabled']) - min(colors['disabled']) < 10


@pytest.mark.parametrize('name', ['<img src=x onerror="document.title=1">', 'x' * 120])
def test_names_and_diagnostics_are_shown_as_text_of_any_length(played, name):
    config = DetectorConfig(channels=2)
    # No detector would take such names.
    object.__setattr__(config, 'channel_names', (f'one {name}', f'two {name}'))
    object.__setattr__(config, 'groups', {f'of {name}': (1,), f'no {name}': (2,)})

    def prepare(detectors):
        (finger,) = detectors.fingers.values()
        finger.diagnostics = (Diagnosis(1, name, f'{name} & lost'),)
        finger.no_volts = f'no volts are shown {name}'

    _, page = played({f'index{name}': rest_rows()[:, :2]}, prepare, config=config)
    expect(page.locator('[data-state=rest]')).to_be_visible()
    expect(page.get_by_role('heading', name=f'index{name}', exact=True)).to_be_visible()
    page.get_by_text('Channels in words').click()
    expect(page.locator('details li').first).to_contain_text(f'one {name}, group of {name}')
    expect(page.get_by_role('button', name=f'Traces of one {name}')).to_be_visible()
    expect(page.locator('.lane-name.channel')).to_have_text(f'one {name}')
    line = page.locator('.diagnostics li')
    expect(line).to_contain_text(f'{name}: {name} & lost')
    expect(line.get_by_role('img', name='warning')).to_be_visible()
    expect(page.locator('.finger .notice')).to_have_text(f'no volts are shown {name}')
    page.get_by_role('tab', name='Spectrum').click()
    expect(page.get_by_label('Channel', exact=True)).to_contain_text(f'two {name}')
    assert page.locator('img').count() == 0
    assert page.title() == 'slip_view'
    wait_until_it_fits(page, 1366, 400)


def test_many_channels_have_their_places_and_as_many_traces_as_are_sent_at_once(played):
    rows = np.tile(rest_rows(), 6)
    rows[:, 90] = np.nan
    _, page = played({'index': rows}, config=DetectorConfig(channels=96))
    expect(card(page)).to_contain_text('ch91 is not valid')
    sides = page.evaluate("""async () => {
      const {placesOf} = await import('/page/finger.js');
      const place = (_, c) => [(c % 10) * 0.0025, Math.floor(c / 10) * -0.0025, 0];
      const grid = Array.from({length: 96}, place);
      const {clientWidth: width, clientHeight: height} = document.querySelector('.picture');
      return placesOf(grid, width, height).map(({side}) => side);
    }""")
    assert min(sides) > 12
    page.get_by_role('button', name='all', exact=True).click()
    expect(page.locator('.lane-name.channel')).to_have_count(64)
    expect(page.get_by_role('button', name='Traces of ch65')).to_be_disabled()
    page.get_by_role('button', name='Traces of ch1', exact=True).click()
    page.get_by_role('button', name='Traces of ch65').click()
    expect(page.locator('.lane-name.channel').last).to_have_text('ch65')


def test_changes_are_announced_politely_a_short_slip_too(played):
    served, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    news = page.locator('#news')
    expect(news).to_have_attribute('role', 'status')
    expect(news).to_contain_text('index: rest')
    # A slip that is over before it is announced.
    player = next(call for call in served.server.each_tick if isinstance(call, Player))
    served.call(setattr, player, 'rows', slip_rows())
    expect(card(page)).to_contain_text('SLIP')
    served.call(setattr, player, 'rows', rest_rows())
    expect(news).to_contain_text('index: SLIP')
    expect(news).to_contain_text('rest')
    served.call(served.detectors.remove, 'index')
    expect(news).to_contain_text('index: detector gone')


def test_a_finger_that_was_chosen_stays_so_with_its_channels_and_is_waited_for(played):
    served, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    expect(card(page, 'thumb')).to_contain_text('rest')
    box = card(page, 'thumb').locator('canvas').bounding_box()
    # ch1 is the first of the grid: at the upper left of the picture's middle.
    page.mouse.click(
        box['x'] + box['width'] / 2 - 1.5 * box['height'] / 4, box['y'] + box['height'] / 8
    )
    thumb = page.get_by_role('button', name='thumb')
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    expect(page.get_by_role('heading', name='Set up thumb')).to_be_visible()
    page.keyboard.press('1')
    expect(page.get_by_role('heading', name='Signals of index')).to_be_visible()
    page.keyboard.press('2')
    lanes = page.locator('.lane-name.channel')
    expect(lanes).to_have_text(['ch1', 'ch9', 'ch11', 'ch14', 'ch16'])
    page.reload()
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    # No key is meant for another finger while it is gone.
    expect(tool(page, 'Rest')).to_be_enabled()
    served.call(served.detectors.remove, 'thumb')
    expect(page.get_by_role('heading', name='Set up thumb, which is gone')).to_be_visible()
    expect(tool(page, 'Rest')).to_be_disabled()
    expect(page.get_by_role('button', name='index')).to_have_attribute('aria-pressed', 'false')
    served.call(lambda: served.detectors.add('thumb', DetectorConfig(), rows=rest_rows()))
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    expect(page.get_by_role('heading', name='Signals of thumb', exact=True)).to_be_visible()
    expect(tool(page, 'Rest')).to_be_enabled()
