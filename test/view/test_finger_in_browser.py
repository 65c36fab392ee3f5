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
import re

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.hand import Diagnosis
from slip_detector.view.server import FRAME_S
from support.browsers import expect
from support.finger_states import STATES, Player, rest_rows, slip_rows


def card(page, label):
    return page.locator(f'[data-finger="/{label}/slip_detector"]')


WORDS = {
    'rest': ('rest', 'all channels valid'),
    'slip': ('SLIP', 'all channels valid'),
    'dead': ('rest', 'ch7 is not valid'),
    'none': ('no input', 'no sample has come yet'),
    'invalid': ('not valid', '12 more are not valid'),
}


def test_each_state_is_told_in_words(played):
    _, page = played(STATES)
    for label, words in WORDS.items():
        for word in words:
            expect(card(page, label)).to_contain_text(word, timeout=60_000)
        # And a screen reader hears the same of the picture.
        named = card(page, label).get_by_role('img', name=f'{label}: {words[0]}')
        expect(named).to_be_visible()
    expect(card(page, 'dead').locator('.dead.some')).to_have_count(1)
    expect(card(page, 'rest').locator('.dead.some')).to_have_count(0)


def picture(page, label):
    """Return a card as it is seen: its luminance from 0 to 1."""
    image = pytest.importorskip('PIL.Image')
    box = card(page, label)
    seen = image.open(io.BytesIO(box.screenshot(scale='css'))).convert('L').resize((260, 330))
    return np.asarray(seen, float) / 255.0


def test_states_differ_in_what_is_seen_without_red_and_green(played):
    _, page = played(STATES)
    for label, words in WORDS.items():
        expect(card(page, label)).to_contain_text(words[1], timeout=60_000)
    session = page.context.new_cdp_session(page)
    for kind in ('none', 'deuteranopia', 'protanopia', 'achromatopsia'):
        session.send('Emulation.setEmulatedVisionDeficiency', {'type': kind})
        pictures = {label: picture(page, label) for label in STATES}
        for one, other in itertools.combinations(STATES, 2):
            # Where the picture itself stands, below the names.
            differs = np.abs(pictures[one][60:, :] - pictures[other][60:, :]) > 0.2
            assert differs.mean() > 0.003, (kind, one, other)


def test_a_taxel_is_filled_by_its_level_outlined_when_on_hatched_and_grey(played):
    config = DetectorConfig(channels=4, disabled_channels=(4,), groups={'a': (1, 2, 3)}, vote=1)
    rows = rest_rows()[:, :4]
    rows[:, 1] = slip_rows()[:, 1]
    rows[:, 2] = np.nan
    _, page = played({'index': rows}, config=config)
    expect(card(page, 'index')).to_contain_text('SLIP', timeout=60_000)
    page.get_by_text('Channels in words').click()
    told = card(page, 'index').get_by_role('list', name='Channels', exact=True)
    told = told.get_by_role('listitem')
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
    assert len(set(colors['disabled'])) <= 3
    assert max(colors['disabled']) - min(colors['disabled']) < 10


def test_groups_tell_their_votes(played):
    rows = rest_rows()
    rows[:, [13, 15, 10, 8]] = slip_rows()[:, :4]  # The channels of TP, ...
    rows[:, [0, 2]] = slip_rows()[:, :2]  # ... and two of TD, ...
    rows[:, 7] = np.nan  # ... of which one is not valid.
    _, page = played({'index': rows})
    groups = card(page, 'index').get_by_role(
        'list', name='Groups: channels that are ON of those that are valid'
    )
    expect(groups.get_by_role('listitem')).to_have_text(
        ['TP4/4 ON', 'TD2/3', 'LR0/4', 'LU0/4'], timeout=60_000
    )
    expect(card(page, 'index')).to_contain_text('valid; slip since')


def test_five_fingers_stand_side_by_side_on_a_laptop(played):
    _, page = played(STATES)
    boxes = [card(page, label).bounding_box() for label in STATES]
    assert len({box['y'] for box in boxes}) == 1
    boxes.sort(key=lambda box: box['x'])
    for left, right in itertools.pairwise(boxes):
        assert left['x'] + left['width'] <= right['x']
    assert boxes[0]['x'] >= 0
    assert boxes[-1]['x'] + boxes[-1]['width'] <= 1366
    assert boxes[0]['y'] + boxes[0]['height'] <= 768
    assert page.evaluate('document.documentElement.scrollWidth') <= 1366


# 320 pixels are a laptop's window that is enlarged four times, as WCAG 1.4.10 wants it.
@pytest.mark.parametrize('width', [320, 400, 800, 1366])
def test_the_page_is_no_wider_than_its_window(played, width):
    _, page = played(STATES, width=width)
    page.get_by_role('button', name='Keys').click()
    for name in ('Traces', 'Teach', 'Spectrum', 'Parameters'):
        page.get_by_role('tab', name=name).click()
        assert page.evaluate('document.documentElement.scrollWidth') <= width, name


def names_of(config, channels, groups):
    """Give a configuration names that no detector would take."""
    object.__setattr__(config, 'channel_names', channels)
    object.__setattr__(config, 'groups', groups)
    return config


@pytest.mark.parametrize('name', ['<img src=x onerror="document.title=1">', 'x' * 120])
def test_names_are_shown_as_text_whatever_they_are_and_however_long(played, open_page, name):
    config = names_of(
        DetectorConfig(channels=2),
        channels=(f'one {name}', f'two {name}'),
        groups={f'of {name}': (1,), f'no {name}': (2,)},
    )
    served, page = played({f'index{name}': rest_rows()[:, :2]}, config=config)
    expect(page.locator('[data-state=rest]')).to_be_visible(timeout=60_000)
    expect(page.get_by_role('heading', name=f'index{name}', exact=True)).to_be_visible()
    page.get_by_text('Channels in words').click()
    expect(page.locator('details li').first).to_contain_text(f'one {name}, group of {name}')
    expect(page.get_by_role('button', name=f'Traces of one {name}')).to_be_visible()
    expect(page.locator('.lane-name.channel')).to_have_text(f'one {name}')
    narrow = open_page(served, width=400)
    for each in (page, narrow):
        each.get_by_role('tab', name='Spectrum').click()
        expect(each.get_by_label('Channel', exact=True)).to_contain_text(f'two {name}')
        assert each.locator('img').count() == 0
        assert each.title() == 'slip_view'
        width = each.viewport_size['width']
        assert each.evaluate('document.documentElement.scrollWidth') <= width
    # Before the server ends, which a page would complain of.
    narrow.close()


def test_many_channels_have_their_places_and_as_many_traces_as_are_sent_at_once(played):
    rows = np.tile(rest_rows(), 6)
    rows[:, 90] = np.nan
    _, page = played({'index': rows}, config=DetectorConfig(channels=96))
    expect(card(page, 'index')).to_contain_text('ch91 is not valid', timeout=60_000)
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


@pytest.mark.parametrize('frame_s', [FRAME_S])
def test_a_picture_is_painted_only_when_it_shows_something_else(played):
    served, page = played({'index': rest_rows()})
    expect(card(page, 'index')).to_contain_text('rest', timeout=60_000)
    # While 30 frames are drawn.
    count = """() => new Promise((resolve) => {
      const {prototype} = CanvasRenderingContext2D, clear = prototype.clearRect;
      const send = WebSocket.prototype.send;
      let painted = 0, frames = 0;
      prototype.clearRect = function (...where) {
        painted += Number(Boolean(this.canvas.closest('.picture')));
        clear.apply(this, where);
      };
      WebSocket.prototype.send = function (message) {
        send.call(this, message);
        if (!String(message).includes('"drawn"') || ++frames < 30) return;
        Object.assign(prototype, {clearRect: clear});
        Object.assign(WebSocket.prototype, {send});
        resolve(painted);
      };
    })"""
    assert page.evaluate(count) == 0
    player = next(call for call in served.server.each_tick if isinstance(call, Player))
    # At some times near the threshold, at others far below it.
    rows = rest_rows() + (slip_rows() - 4.3) * np.sin(np.arange(380) / 60.0)[:, np.newaxis] * 0.03
    served.call(setattr, player, 'rows', rows)
    assert any(page.evaluate(count) > 3 for _ in range(20))


def test_input_that_stops_and_a_detector_that_is_not_heard_or_gone_are_told(played):
    served, page = played({'index': rest_rows(), 'thumb': slip_rows()})
    expect(card(page, 'index')).to_contain_text('rest', timeout=60_000)
    for player in [call for call in served.server.each_tick if isinstance(call, Player)]:
        served.call(served.server.each_tick.remove, player)
    for label in ('index', 'thumb'):
        expect(card(page, label)).to_contain_text('no input')
        expect(card(page, label)).to_contain_text('no sample for')
    served.hand.heard = False
    expect(card(page, 'index')).to_contain_text('detector silent')
    expect(card(page, 'index')).to_contain_text('has not been heard for')
    served.call(served.hand.remove, 'index')
    expect(card(page, 'index')).to_have_count(0)
    expect(page.locator('#news')).to_contain_text('index: detector gone')
    served.call(served.hand.remove, 'thumb')
    expect(page.get_by_text('No detector yet')).to_be_visible()


def test_a_change_is_announced_politely_and_once(played):
    served, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    news = page.locator('#news')
    expect(news).to_have_attribute('role', 'status')
    expect(news).to_contain_text('index: rest', timeout=60_000)
    # A slip that is over before it is announced is announced all the same.
    player = next(call for call in served.server.each_tick if isinstance(call, Player))
    served.call(setattr, player, 'rows', slip_rows())
    expect(card(page, 'index')).to_contain_text('SLIP')
    served.call(setattr, player, 'rows', rest_rows())
    expect(news).to_contain_text('index: SLIP')
    expect(news).to_contain_text('rest')
    said = page.evaluate("""() => new Promise((resolve) => {
      let count = 0;
      const watch = new MutationObserver(() => count++);
      watch.observe(document.getElementById('news'), {childList: true});
      setTimeout(() => resolve(count), 3000);
    })""")
    assert said <= 2  # Nothing is said while nothing changes.


def test_diagnostics_and_notices_are_shown_as_text_whatever_they_are(played):
    bad = '<img src=x onerror="document.title=1">'

    def prepare(hand):
        finger = hand.fingers['/index/slip_detector']
        finger.diagnostics = (Diagnosis(0, 'clock', 'steady'), Diagnosis(1, bad, f'{bad} & lost'))
        finger.no_volts = f'no volts are shown {bad}'

    _, page = played({'index': rest_rows()}, prepare)
    lines = card(page, 'index').locator('.diagnostics li')
    expect(lines).to_have_count(2)
    expect(lines.nth(0)).to_contain_text('clock: steady')
    expect(lines.nth(1)).to_contain_text(f'{bad}: {bad} & lost')
    expect(lines.nth(1).get_by_role('img', name='warning')).to_be_visible()
    expect(card(page, 'index').locator('.notice')).to_have_text(f'no volts are shown {bad}')
    assert page.locator('article img').count() == 0


def test_a_detector_that_starts_again_with_other_channels_is_drawn_with_those(played):
    served, page = played({'index': rest_rows()})
    expect(card(page, 'index')).to_contain_text('rest', timeout=60_000)

    def again():
        served.server.each_tick.clear()
        served.hand.remove('index')
        served.hand.add('index', DetectorConfig(channels=3), rows=rest_rows()[:, :3])
        served.server.each_tick.append(Player(served.hand, 'index', rest_rows()[:, :3]))

    served.call(again)
    # Until it is drawn so, what is clicked may move away.
    expect(card(page, 'index').locator('.groups li')).to_have_text(['all0/3'])
    page.get_by_text('Channels in words').click()
    expect(card(page, 'index').locator('details li')).to_have_count(3)
    expect(page.locator('.chooser [data-channel]')).to_have_count(3)


def test_a_taxel_that_is_clicked_gets_traces_or_loses_them(played):
    _, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    expect(card(page, 'thumb')).to_contain_text('rest', timeout=60_000)
    box = card(page, 'thumb').locator('canvas').bounding_box()
    # ch1 is the first of the grid: at the upper left of the picture's middle.
    page.mouse.click(
        box['x'] + box['width'] / 2 - 1.5 * box['height'] / 4, box['y'] + box['height'] / 8
    )
    expect(page.get_by_role('button', name='thumb')).to_have_attribute('aria-pressed', 'true')
    one = page.get_by_role('button', name='Traces of ch1', exact=True)
    expect(one).to_have_attribute('aria-pressed', 'true')


def test_diagnostics_that_do_not_fit_are_scrolled_to_by_keys(played):
    def prepare(hand):
        hand.fingers['/index/slip_detector'].diagnostics = tuple(
            Diagnosis(0, f'part {i}', 'as it should be') for i in range(12)
        )

    _, page = played({'index': rest_rows()}, prepare)
    lines = card(page, 'index').get_by_role('list', name='Diagnostics')
    expect(lines.get_by_role('listitem')).to_have_count(12)
    lines.focus()
    page.keyboard.press('End')
    page.wait_for_function('() => document.querySelector(".diagnostics").scrollTop > 0')


def test_the_finger_that_was_chosen_stays_chosen(played):
    served, page = played({'index': rest_rows(), 'thumb': rest_rows(seed=1)})
    thumb = page.get_by_role('button', name='thumb')
    page.keyboard.press('2')
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    expect(page.get_by_role('heading', name='Set up thumb')).to_be_visible()
    page.get_by_role('button', name='Traces of ch1', exact=True).click()
    page.keyboard.press('1')
    expect(page.get_by_role('heading', name='Signals of index')).to_be_visible()
    page.keyboard.press('2')
    # With the channels that were chosen for it.
    lanes = page.locator('.lane-name.channel')
    expect(lanes).to_have_text(['ch1', 'ch9', 'ch11', 'ch14', 'ch16'])
    page.reload()
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    # What is gone is waited for: no key is meant for another finger.
    rest = page.get_by_role('button', name=re.compile('^Rest'))
    expect(rest).to_be_enabled()
    served.call(served.hand.remove, 'thumb')
    expect(page.get_by_role('heading', name='Set up thumb, which is gone')).to_be_visible()
    expect(rest).to_be_disabled()
    expect(page.get_by_role('button', name='index')).to_have_attribute('aria-pressed', 'false')
    served.call(lambda: served.hand.add('thumb', DetectorConfig(), rows=rest_rows()))
    expect(thumb).to_have_attribute('aria-pressed', 'true')
    expect(page.get_by_role('heading', name='Signals of thumb', exact=True)).to_be_visible()
    expect(rest).to_be_enabled()
