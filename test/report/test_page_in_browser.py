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

"""A report in a real browser, without a screen: it draws, it zooms, nothing fails."""

import re

import pytest
from report import report_scenes as scenes

from slip_detector.report import page as report
from slip_detector.report.overview import Event
from support.browsers import complaints_of, expect

#: Pixels of the names at the left and of the margin at the right, as in timeline.js.
NAMES_WIDTH, RIGHT_MARGIN = 92, 16


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('report')
    variants = scenes.variants()
    report.write_page(folder / 'both.html', 'A title', variants, ['A note.'])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('slip_detector.report.overview.MOST_CELLS', 16 * 256)
        report.write_page(folder / 'coarse.html', 'A title', scenes.variants(('a.npz',))[:1])
    volts, truth = scenes.volts_and_truth(800, 96)
    volts[200:300, 4] = float('nan')
    config = scenes.GIVEN.__class__(channels=96, disabled_channels=(96,))
    seen = scenes.overview('skin.npz', config, volts, truth)
    report.write_page(folder / 'skin.html', 'A title', [report.Variant('given', [seen], {})])
    bare = scenes.overview('bare.npz', scenes.GIVEN, *scenes.volts_and_truth(800))
    bare.labelled, bare.events = False, [Event('onset', 1.0, 1.5)]
    report.write_page(folder / 'bare.html', 'A title', [report.Variant('given', [bare], {})])
    given = scenes.variants(('a', 'b', 'c'))[0]
    given.overviews[0].events, given.overviews[1].events = (), scenes.EVENTS['given'][:2]
    report.write_page(folder / 'first.html', 'A title', [given], ['Finds 1.', 'Worst: c.'])
    return folder


@pytest.fixture
def opened(browser, folder):
    """Return what opens a report; whatever the page complains of fails the test at its end."""
    page = browser.new_page()
    complaints = complaints_of(page, ('file://', 'data:'))

    def open_(name, anchor='', width=1280):
        page.set_viewport_size({'width': width, 'height': 768})
        page.goto((folder / name).as_uri() + anchor)
        page.locator('html[data-ready-ms]').wait_for(state='attached')
        return page

    yield open_
    page.close()
    assert complaints == []


def settle(page):
    """Wait until what was asked for is drawn."""
    page.evaluate('new Promise(requestAnimationFrame)')
    page.locator('#timeline[aria-busy=false]').wait_for(state='attached')


def view(page):
    """Return the recording, the variant and the seconds from and to which the timeline shows."""
    settle(page)
    data = page.evaluate('({...document.getElementById("timeline").dataset})')
    return (
        int(data['recording']), int(data['variant']), float(data['fromS']), float(data['toS'])
    )  # fmt: skip


def pixels(page):
    settle(page)
    return page.evaluate('document.querySelector("#timeline canvas").toDataURL()')


def point(page, share, y=0.5):
    """Return where on the page a share of the time in view is."""
    timeline = page.locator('#timeline')
    timeline.scroll_into_view_if_needed()
    box = timeline.bounding_box()
    x = box['x'] + NAMES_WIDTH + share * (box['width'] - NAMES_WIDTH - RIGHT_MARGIN)
    return x, box['y'] + (y * box['height'] if y <= 1 else y)


def read_out(page, share):
    """Return what is said of the first channel at a share of the time in view."""
    settle(page)
    y = page.evaluate('timeline.lanes.find((lane) => lane.curve).top + 10')
    page.mouse.move(*point(page, share, y))
    expect(page.locator('#readout')).to_contain_text('threshold')
    return page.inner_text('#readout')


def names_of_lanes(page):
    settle(page)
    return page.evaluate('timeline.lanes.map((lane) => lane.name)')


def test_it_renders(opened):
    """The way of a user: look at the whole, at an event, before and after, at another signal."""
    page = opened('both.html')
    assert page.title() == 'A title'
    assert view(page)[:2] == (0, 1)
    assert page.locator('section h2').all_inner_texts() == ['Figures', 'Parameters']
    assert page.locator('#kinds').inner_text().count('(0)') == 3
    after = pixels(page)
    page.check('input[name=variant] >> nth=0')
    assert view(page)[1] == 0
    assert pixels(page) != after
    # The late slip of the other recording: from before the slip until after its alarm.
    page.locator('#event-list a', has_text='late').nth(1).click()
    recording, _, start, stop = view(page)
    assert (recording, start < 15.0, stop > 15.4) == (1, True, True)
    where = page.locator('#event-list tr.chosen').nth(1).inner_text()
    assert where.replace('\xa0', ' ') == 'filter 12 ms, vote 388 ms'
    before = pixels(page)
    page.select_option('#signal', 'level')
    assert pixels(page) != before
    page.uncheck('#kinds input >> nth=1')
    page.check('#kinds input >> nth=3')
    links = set(page.locator('#event-list a').all_inner_texts())
    assert links == {'◆ late', '● detected', '✕ missed'}


def test_the_first_screen_says_how_good_it_is_and_shows_the_first_miss(opened):
    page = opened('first.html', width=1366)
    recording, _, start, stop = view(page)
    assert (recording, start < 9.0 < stop < 12.0) == (2, True)
    for seen in ('text=Finds', 'text=Worst:', 'text=UTC', '.lane-name >> nth=6'):
        box = page.locator(seen).bounding_box()
        assert 0 <= box['y'] < 768 - box['height']


def test_nothing_is_cut_on_paper_and_the_dark_is_for_screens(opened):
    page = opened('both.html', width=1366)
    page.emulate_media(color_scheme='dark')
    expect(page.locator('body')).to_have_css('background-color', 'rgb(26, 26, 26)')
    page.emulate_media(media='print')
    expect(page.locator('body')).to_have_css('background-color', 'rgb(255, 255, 255)')
    page.evaluate('for (const one of document.querySelectorAll("details")) one.open = true')
    # At once: paper does not wait for what observes sizes.
    printed = 'window.dispatchEvent(new Event("beforeprint")), timeline.canvas.width'
    assert page.evaluate(printed) == 700
    # A4 between margins of 10 mm.
    page.set_viewport_size({'width': 718, 'height': 1000})
    settle(page)
    cut = 'one.getBoundingClientRect().right > 718 || one.scrollWidth > one.clientWidth + 1'
    every = '[...document.querySelectorAll("body :not(select)")].filter((one) => one.clientWidth)'
    assert page.evaluate(f'{every}.filter((one) => {cut}).map((one) => one.innerText)') == []


def test_without_labels_there_are_onsets_and_nothing_that_looks_like_a_score(opened):
    page = opened('bare.html')
    assert names_of_lanes(page)[:3] == ['events', 'slip', 'TP']
    assert page.locator('#kinds').inner_text().strip() == '▼ onset (1)'
    page.locator('#event-list a', has_text='onset').click()
    assert view(page)[2:] == pytest.approx((0.7, 1.9))


def test_many_channels_without_events_fit_into_the_window(opened):
    page = opened('skin.html', width=800)
    assert page.evaluate('document.documentElement.scrollWidth') <= 800
    names = names_of_lanes(page)
    assert len([name for name in names if name.startswith('ch')]) == 95
    assert 'Disabled channels, 1 of them' in page.inner_text('#resolution')
    assert page.locator('#event-list tbody').inner_text() == 'no events'
    assert page.locator('#signal option').all_inner_texts() == ['volts', 'level / threshold']


def test_wheel_mouse_keys_and_buttons_zoom_and_move(opened):
    page = opened('both.html')
    page.click('#whole')
    page.mouse.move(*point(page, 0.25))
    page.mouse.wheel(0, -400)
    expect(page.locator('#timeline')).not_to_have_attribute('data-to-s', '20')
    _, _, start, stop = view(page)
    assert stop - start < 10.0
    assert start + 0.25 * (stop - start) == pytest.approx(5.0, abs=0.05)
    page.mouse.wheel(0, 2000)
    expect(page.locator('#timeline')).to_have_attribute('data-to-s', '20')
    page.click('#whole')
    page.click('#zoom-in')
    page.mouse.move(*point(page, 0.75))
    page.mouse.down()
    page.mouse.move(*point(page, 0.25), steps=4)
    page.mouse.up()
    assert view(page)[2:] == pytest.approx((10.0, 20.0), abs=0.1)
    page.click('#whole')
    page.click('#zoom-in')
    settle(page)  # A key moves what is drawn.
    page.focus('#timeline')
    for key, seen in (
        ('ArrowRight', (6.0, 16.0)), ('+', (8.5, 13.5)), ('-', (6.0, 16.0)),
        ('ArrowLeft', (5.0, 15.0)), ('Home', (0.0, 20.0)),
    ):  # fmt: skip
        page.keyboard.press(key)
        assert view(page)[2:] == pytest.approx(seen)


def test_events_are_reached_by_link_by_mark_and_one_after_the_other(opened):
    page = opened('both.html', '#event-0-1-2')
    recording, variant, start, stop = view(page)
    assert (recording, variant, start < 9.0 < stop < 12.0) == (1, 0, True)
    assert 'missed' in page.locator('#event-list tr.chosen').first.inner_text()
    page.select_option('#recording', '0')
    for recording, start in ((0, 2.0), (0, 4.0), (0, 9.0), (0, 15.0), (1, 2.0)):
        page.click('#next')
        assert view(page)[0] == recording
        assert view(page)[2] == pytest.approx(start - 0.3)
    page.keyboard.press('p')
    assert view(page)[2] == pytest.approx(14.7)


def test_the_read_out_is_the_sample_itself_or_in_a_long_recording_the_range_of_its_bin(opened):
    page = opened('coarse.html', '#event-0-0-2')
    assert 'each 84 ms' in page.inner_text('#resolution')
    assert re.search(r'ch14 · [\d.]+ V to [\d.]+ V · level', read_out(page, 0.5))
    page = opened('both.html', '#event-0-0-2')
    _, _, start, stop = view(page)
    # The first channel of the first group is ch14.
    volts, truth = scenes.volts_and_truth(seed=0)
    row = 3420 + 5
    assert truth[row]
    text = read_out(page, ((row + 0.5) / 380.0 - start) / (stop - start))
    time_s, channel, value = re.fullmatch(
        r'([\d.]+) s · (\w+) · ([\d.]+) V · level / threshold .+', text
    ).groups()
    assert channel == 'ch14'
    assert float(time_s) == pytest.approx(row / 380.0, abs=0.003)
    assert float(value) == pytest.approx(volts[row, 13], abs=6e-4)


def test_data_that_are_broken_are_said_to_be(browser, folder):
    text = (folder / 'coarse.html').read_text(encoding='utf-8')
    broken = re.sub(r'("data":".{200}).{8}', r'\1AAAAAAAA', text, count=1)
    (folder / 'broken.html').write_text(broken, encoding='utf-8')
    page = browser.new_page()
    page.goto((folder / 'broken.html').as_uri())
    expect(page.locator('#failure')).to_contain_text('a.npz cannot be drawn')
    page.close()
