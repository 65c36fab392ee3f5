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

"""Traces in a real browser: they scroll, stand still, and tell the very samples; the threshold."""

import asyncio
import re
import threading

import numpy as np
import pytest

from slip_detector.view.server import FRAME_S
from support.browsers import expect
from support.page_parts import NAME, card, changes, config_of, threshold_line
from support.simulated_detectors import SimulatedDetectors

#: Pixels of the names at the left and of the margin at the right, as in timeline.js.
NAMES_WIDTH, RIGHT_MARGIN = 92, 16


@pytest.fixture
def served(serve):
    """Serve a finger that plays a scene with a slip."""
    return serve(SimulatedDetectors())


@pytest.fixture
def page(served, open_page):
    page = open_page(served)
    until(page, 'data.toS > 0')
    return page


def until(page, condition):
    """Wait until something holds of the data of the timeline."""
    data = 'const data = document.getElementById("timeline").dataset;'
    page.wait_for_function(f'() => {{ {data} return {condition}; }}', timeout=60_000)


def play_seconds(served, page, seconds):
    """Play so much of the scene and wait until it is drawn; its stamps begin at 1000 s."""
    served.call(served.detectors.simulated[NAME].play, seconds)
    until(page, f'data.toS > {40 + seconds}')


def stretch(page):
    """Return from when to when is drawn."""
    data = page.evaluate('({...document.getElementById("timeline").dataset})')
    return float(data['fromS']), float(data['toS'])


def readout(page):
    return page.locator('#traces .readout')


def draw_twenty_times(page):
    page.evaluate("""async () => {
      for (let i = 0; i < 20; i++) await new Promise(requestAnimationFrame);
    }""")


@pytest.mark.parametrize('frame_s', [FRAME_S])
def test_time_goes_on_and_never_back_and_stands_still_without_samples(served, page):
    ends = page.evaluate("""() => new Promise((resolve) => {
      const root = document.getElementById('timeline'), ends = [];
      const watch = new MutationObserver(() => {
        ends.push(Number(root.dataset.toS));
        if (ends.length >= 60) {
          watch.disconnect();
          resolve(ends);
        }
      });
      watch.observe(root, {attributeFilter: ['data-to-s']});
    })""")
    steps = np.diff(ends)
    assert (steps >= 0).all()
    assert steps.sum() > 0
    # Columns are drawn at whole columns, each as it was drawn before.
    width = page.locator('#timeline').bounding_box()['width'] - NAMES_WIDTH - RIGHT_MARGIN
    columns = steps * width / 10.0
    assert columns == pytest.approx(columns.round(), abs=0.02)
    served.call(setattr, served.detectors, 'real_time', False)
    ends = page.evaluate("""async () => {
      const {dataset} = document.getElementById('timeline'), ends = [];
      const begin = performance.now();
      while (performance.now() < begin + 2500) {
        await new Promise(requestAnimationFrame);
        ends.push(Number(dataset.toS));
      }
      return ends;
    }""")
    assert (np.diff(ends) >= 0).all()
    assert ends[-1] - ends[0] < 1.0
    assert ends[-1] == ends[len(ends) // 2]
    served.call(setattr, served.detectors, 'real_time', True)
    until(page, f'data.toS > {ends[-1]}')


def test_slip_truth_and_chosen_channels_have_traces(served, page):
    names, lanes = page.locator('.lane-name'), page.locator('.lane-name.channel')
    play_seconds(served, page, 5.0)  # It slips from 3.8 s on.
    expect(names.get_by_text('truth')).to_be_visible()
    assert names.all_inner_texts()[:6] == ['slip', 'truth', 'ch9', 'ch11', 'ch14', 'ch16']
    counts = page.evaluate("""() => {
      const canvas = document.querySelector('#timeline canvas'), {width, height} = canvas;
      const copy = Object.assign(document.createElement('canvas'), {width, height});
      const context = copy.getContext('2d', {willReadFrequently: true});
      context.drawImage(canvas, 0, 0);
      const all = context.getImageData(0, 0, width, height).data, counts = {};
      for (let i = 0; i < all.length; i += 4) {
        const key = [all[i], all[i + 1], all[i + 2]].join();
        counts[key] = (counts[key] ?? 0) + 1;
      }
      return counts;
    }""")
    for color in ('213,94,0', '127,178,214', '232,242,249'):  # slip, truth, and truth under curves
        assert counts.get(color, 0) > 100
    page.get_by_role('button', name='Traces of ch14').click()
    expect(lanes).to_have_text(['ch9', 'ch11', 'ch16'])
    page.get_by_role('button', name='LU', exact=True).click()
    expect(lanes).to_have_text(['ch2', 'ch4', 'ch13', 'ch15'])
    expect(page.locator('.chooser [aria-pressed=true]')).to_have_text(['2', '4', '15', '13'])
    # One stays.
    for name in ('ch2', 'ch4', 'ch13', 'ch15'):
        page.get_by_role('button', name=f'Traces of {name}', exact=True).click()
    expect(lanes).to_have_text(['ch15'])


def test_paused_it_stands_still_can_be_moved_and_zoomed_and_goes_on(page):
    page.keyboard.press('p')
    expect(page.get_by_role('button', name='Go on')).to_be_visible()
    before = stretch(page)
    draw_twenty_times(page)
    assert stretch(page) == before
    page.focus('#timeline')
    page.keyboard.press('+')
    zoomed = stretch(page)
    assert zoomed[1] - zoomed[0] == pytest.approx((before[1] - before[0]) / 2)
    page.keyboard.press('ArrowLeft')
    moved = stretch(page)
    assert moved[0] == pytest.approx(zoomed[0] - 0.1 * (zoomed[1] - zoomed[0]))
    box = page.locator('#timeline').bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + 60)
    page.mouse.wheel(0, -300)
    until(page, f'data.fromS != {moved[0]}')
    assert stretch(page)[1] - stretch(page)[0] < moved[1] - moved[0]
    page.keyboard.press('p')
    until(page, f'data.toS > {before[1]}')
    page.keyboard.press('Home')
    expect(page.locator('#trace-span')).to_have_text('10 s')


def test_a_chosen_stretch_stays_though_it_is_not_kept_and_the_detector_starts_again(served, page):
    # Nothing moves under the mouse: the lane of the truth, which comes with the first slip, is
    # there, and nothing more comes; a minute later than that in which the page's times begin.
    play_seconds(served, page, 31.0)
    served.call(setattr, served.detectors, 'real_time', False)
    expect(page.locator('.lane-name').get_by_text('truth')).to_be_visible()
    box = page.locator('#timeline').bounding_box()
    page.keyboard.down('Shift')
    page.mouse.move(box['x'] + box['width'] - 120, box['y'] + 60)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] - 40, box['y'] + 60, steps=4)
    page.mouse.up()
    page.keyboard.up('Shift')
    expect(page.locator('#trace-span')).to_contain_text('paused')
    # The server keeps what is there for the page as soon as it knows.
    (connection,) = served.server.pages
    while served.call(lambda: connection.view.until_ns is None):
        page.wait_for_timeout(20)
    chosen = stretch(page)
    assert chosen[1] - chosen[0] < 3.0
    finger = served.detectors.fingers[NAME]
    served.call(finger.track.samples.clear)
    served.call(finger.started_again, finger.config)
    expect(card(page).locator('.notice')).to_contain_text('started again')
    draw_twenty_times(page)
    assert stretch(page) == chosen
    page.mouse.wheel(0, 200)
    page.mouse.move(box['x'] + box['width'] - 60, box['y'] + 60)
    expect(readout(page)).to_contain_text(' V')


def test_the_very_sample_is_read_at_the_pointer_and_by_keys(served, page):
    play_seconds(served, page, 2.0)
    page.keyboard.press('p')
    end_s = stretch(page)[1]
    page.focus('#timeline')
    page.keyboard.press('Shift+ArrowLeft')
    expect(readout(page)).to_have_text(re.compile(r'^[\d.]+ s · ch9 · [\d.]+ V.* · level'))
    first = readout(page).inner_text()
    page.keyboard.press('Shift+ArrowLeft')
    assert readout(page).inner_text().partition(' s')[0] < first.partition(' s')[0]
    page.keyboard.press('Shift+ArrowDown')
    expect(readout(page)).to_contain_text(' ch11 ')
    expect(readout(page)).to_have_attribute('aria-live', 'polite')
    box = page.locator('#timeline').bounding_box()
    width = box['width'] - NAMES_WIDTH - RIGHT_MARGIN
    x = box['x'] + NAMES_WIDTH + 0.9 * width
    page.mouse.move(x, box['y'] + 70)  # in the lane of the first channel, ch9
    for _ in range(9):
        page.mouse.wheel(0, -400)
    expect(page.locator('#trace-span')).to_contain_text(re.compile(r'^0\.0\d+ s, paused'))
    expect(readout(page)).to_contain_text('of the threshold')
    page.mouse.move(x + 1, box['y'] + 70)
    # A column has one sample, when those of this stretch have come.
    alone = re.compile(r'([\d.]+) s · ch9 · ([\d.]+) V · level')
    expect(readout(page)).to_have_text(alone)
    at_s, shown_v = map(float, alone.search(readout(page).inner_text()).groups())
    assert at_s < 960.0 + end_s
    samples = served.call(lambda: served.detectors.fingers[NAME].track.samples)
    row = np.searchsorted(samples.stamps_ns(), at_s * 1e9, side='right') - 1
    near = samples.field('volts')[row - 1 : row + 2, 8]
    assert np.abs(near - shown_v).min() < 6e-4
    page.keyboard.press('p')
    # What changes all the time is not read aloud.
    expect(readout(page)).to_have_attribute('aria-live', 'off')


def test_the_threshold_is_dragged_on_a_logarithmic_scale_and_moved_by_keys(served, page):
    line = threshold_line(page)
    ratios = []
    for _ in range(2):
        before = config_of(served).threshold
        # The line stands still where the mouse takes it.
        box = line.bounding_box()
        x, y = box['x'] + 60, box['y'] + box['height'] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y + 12, steps=3)
        expect(line).not_to_have_attribute('aria-valuetext', f'threshold {before:g}')
        assert config_of(served).threshold == before  # It is set when it is let go.
        page.mouse.up()
        expect(changes(page)).to_contain_text(f'threshold from {before:g}')
        ratios.append(config_of(served).threshold / before)
    assert ratios[0] < 0.9
    assert ratios[0] == pytest.approx(ratios[1], rel=0.25)
    before = config_of(served).threshold
    # At once: it is set when no key was pressed for a while.
    line.evaluate("""(element) => {
      for (const key of ['ArrowUp', 'ArrowUp', 'Escape']) {
        element.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true}));
      }
    }""")
    expect(line).to_have_attribute('aria-valuetext', f'threshold {before:g}')
    line.focus()
    page.keyboard.press('ArrowUp')
    expect(changes(page)).to_contain_text(f'threshold from {before:g} to {1.05 * before:.3g}')


def test_the_line_stays_where_it_was_let_go_until_the_detector_has_it(served, page):
    answers = threading.Event()
    set_parameters = served.detectors.set_parameters

    async def set_later(name, values):
        await asyncio.to_thread(answers.wait, 60.0)
        return await set_parameters(name, values)

    line = threshold_line(page)
    served.detectors.set_parameters = set_later
    line.focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    draw_twenty_times(page)
    expect(line).to_have_attribute('aria-valuetext', 'threshold 0.814')
    assert config_of(served).threshold == 0.5
    answers.set()
    expect(changes(page)).to_contain_text('to 0.814')
    expect(line).to_have_attribute('aria-valuetext', 'threshold 0.814')
