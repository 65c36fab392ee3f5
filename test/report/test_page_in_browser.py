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

from slip_detector.report import page as report
from support import report_scenes as scenes
from support.browsers import complaints_of, expect

#: Pixels of the names at the left and of the margin at the right, as in timeline.js.
NAMES_WIDTH, RIGHT_MARGIN = 92, 16


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('report')
    variants = scenes.variants()
    report.write_page(folder / 'both.html', 'A title', variants, scenes.trials(), ['A note.'])
    report.write_page(folder / 'one.html', 'A title', variants[:1])
    report.write_page(
        folder / 'coarse.html', 'A title', scenes.variants(('a.npz',), most_cells=16 * 256)
    )
    report.write_page(folder / 'unlabelled.html', 'A title', [unlabelled()])
    report.write_page(folder / 'evidence.html', 'A title', [variants[0], by_evidence()])
    return folder


def by_evidence():
    names = ('a.npz', 'b.npz')
    seen = [
        scenes.overview(name, scenes.EVIDENCE, *scenes.tapped(seed=i))
        for i, name in enumerate(names)
    ]
    return report.Variant('evidence', scenes.EVIDENCE, seen, {})


def unlabelled():
    volts, _ = scenes.volts_and_truth(800, 96)
    volts[200:300, 4] = float('nan')
    config = scenes.GIVEN.__class__(channels=96, disabled_channels=(96,))
    seen = scenes.overview('skin.npz', config, volts, None)
    return report.Variant('given', config, [seen], {})


@pytest.fixture
def opened(browser, folder):
    """Return what opens a report; whatever the page complains of fails the test at its end."""
    opened = []

    def open_(name, anchor='', width=1280):
        page = browser.new_page()
        page.set_viewport_size({'width': width, 'height': 900})
        opened.append((page, complaints_of(page, ('file://', 'data:'))))
        page.goto((folder / name).as_uri() + anchor)
        page.locator('html[data-ready-ms]').wait_for(state='attached')
        return page

    yield open_
    for page, _ in opened:
        page.close()
    assert [complaints for _, complaints in opened if complaints] == []


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


def colors(page, selector):
    """Return how many pixels of each colour there are."""
    settle(page)
    return page.evaluate(
        """(selector) => {
          const canvas = document.querySelector(selector), counts = {};
          const all = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
          for (let i = 0; i < all.length; i += 4) {
            const key = [all[i], all[i + 1], all[i + 2]].join();
            counts[key] = (counts[key] ?? 0) + 1;
          }
          return counts;
        }""",
        selector,
    )


def point(page, share, y=0.5, selector='#timeline'):
    """Return where on the page a share of the time in view is."""
    page.locator(selector).scroll_into_view_if_needed()
    box = page.locator(selector).bounding_box()
    x = box['x'] + NAMES_WIDTH + share * (box['width'] - NAMES_WIDTH - RIGHT_MARGIN)
    return x, box['y'] + (y * box['height'] if y <= 1 else y)


def test_it_renders(opened):
    page = opened('both.html')
    assert page.title() == 'A title'
    assert view(page) == (0, 1, 0.0, 20.0)
    for selector in ('#timeline canvas', '#minimap'):
        seen = colors(page, selector)
        assert seen.get('213,94,0', 0) > 100, selector  # ON
        assert len(seen) > 5
    assert page.locator('#failure').is_hidden()
    images = page.evaluate('[...document.images].map((image) => image.naturalWidth)')
    assert len(images) == 2
    assert min(images) > 300
    heads = page.locator('section h2').all_inner_texts()
    assert heads == ['Timeline', 'Figures', 'Trade-off', 'Filter', 'Parameters']
    assert page.locator('table.figures tbody').count() == 2 * 3


@pytest.mark.parametrize('name', ['both.html', 'one.html', 'unlabelled.html'])
@pytest.mark.parametrize('width', [800, 1280])
def test_the_page_is_no_wider_than_its_window(opened, name, width):
    page = opened(name, width=width)
    assert page.evaluate('document.documentElement.scrollWidth') <= width


def test_the_wheel_zooms_at_the_pointer(opened):
    page = opened('both.html')
    before = pixels(page)
    page.mouse.move(*point(page, 0.25))
    page.mouse.wheel(0, -400)
    expect(page.locator('#timeline')).not_to_have_attribute('data-to-s', '20')
    _, _, start, stop = view(page)
    assert stop - start < 10.0
    assert start + 0.25 * (stop - start) == pytest.approx(5.0, abs=0.05)
    assert pixels(page) != before
    page.mouse.wheel(0, 2000)
    expect(page.locator('#timeline')).to_have_attribute('data-to-s', '20')
    assert view(page)[2:] == (0.0, 20.0)
    assert pixels(page) == before


def test_dragging_moves_and_with_shift_chooses_a_stretch(opened):
    page = opened('both.html')
    page.keyboard.down('Shift')
    page.mouse.move(*point(page, 0.2))
    page.mouse.down()
    page.mouse.move(*point(page, 0.4), steps=4)
    page.mouse.up()
    page.keyboard.up('Shift')
    assert view(page)[2:] == pytest.approx((4.0, 8.0), abs=0.05)
    page.mouse.move(*point(page, 0.75))
    page.mouse.down()
    page.mouse.move(*point(page, 0.25), steps=4)
    page.mouse.up()
    assert view(page)[2:] == pytest.approx((6.0, 10.0), abs=0.1)


def test_dragging_in_the_strip_chooses_a_stretch_and_a_click_moves_there(opened):
    page = opened('both.html')
    page.mouse.move(*point(page, 0.5, selector='#minimap'))
    page.mouse.down()
    page.mouse.move(*point(page, 0.6, selector='#minimap'), steps=4)
    page.mouse.up()
    assert view(page)[2:] == pytest.approx((10.0, 12.0), abs=0.05)
    page.mouse.click(*point(page, 0.2, selector='#minimap'))
    assert view(page)[2:] == pytest.approx((3.0, 5.0), abs=0.1)


def test_keys_and_buttons_move_as_well(opened):
    page = opened('both.html')
    page.click('#zoom-in')
    assert view(page)[2:] == (5.0, 15.0)
    page.focus('#timeline')
    page.keyboard.press('ArrowRight')
    assert view(page)[2:] == pytest.approx((6.0, 16.0))
    page.keyboard.press('+')
    assert view(page)[2:] == pytest.approx((8.5, 13.5))
    page.keyboard.press('-')
    page.keyboard.press('ArrowLeft')
    assert view(page)[2:] == pytest.approx((5.0, 15.0))
    page.keyboard.press('Home')
    assert view(page)[2:] == (0.0, 20.0)
    page.click('#zoom-in')
    page.click('#zoom-out')
    assert view(page)[2:] == (0.0, 20.0)
    page.click('#zoom-in')
    page.click('#whole')
    assert view(page)[2:] == (0.0, 20.0)


def test_a_false_alarm_of_the_list_is_shown_when_clicked(opened):
    page = opened('both.html')
    page.check('input[name=variant] >> nth=0')
    alarms = page.locator('#event-list a', has_text='false alarm')
    assert alarms.count() == 2  # one of each recording
    before = pixels(page)
    alarms.first.click()
    recording, variant, start, stop = view(page)
    assert (recording, variant) == (0, 0)
    assert start < 2.0
    assert stop > 2.2
    assert stop - start < 2.0
    assert pixels(page) != before
    assert 'false alarm' in page.locator('#event-list tr.chosen').inner_text()
    # Away from it and back again, though the address stays.
    page.click('#whole')
    alarms.first.click()
    assert view(page) == (recording, variant, start, stop)


def test_an_event_of_another_recording_opens_that(opened):
    page = opened('both.html')
    page.check('input[name=variant] >> nth=0')
    page.locator('#event-list a', has_text='late').nth(1).click()
    recording, _, start, stop = view(page)
    assert recording == 1
    assert page.input_value('#recording') == '1'
    # From before the slip until after its alarm.
    assert start < 15.0
    assert stop > 15.4
    where = page.locator('#event-list tr.chosen').nth(1).inner_text()
    assert where.replace('\xa0', ' ') == 'filter 12 ms, vote 388 ms'


def test_an_event_can_be_linked_to(opened):
    page = opened('both.html', '#event-0-1-2')
    recording, variant, start, stop = view(page)
    assert (recording, variant) == (1, 0)
    assert start < 9.0 < stop < 12.0
    assert 'missed' in page.locator('#event-list tr.chosen').first.inner_text()


def test_next_and_previous_go_through_the_list(opened):
    page = opened('one.html')
    starts = []
    for _ in range(4):
        page.click('#next')
        recording, _, start, _ = view(page)
        starts.append((recording, round(start + 0.3, 3)))
    assert starts == [(0, 2.0), (0, 9.0), (0, 15.0), (1, 2.0)]
    page.keyboard.press('p')
    assert view(page)[0] == 0
    assert view(page)[2] == pytest.approx(14.7)


def test_a_mark_in_the_timeline_chooses_its_event(opened):
    page = opened('one.html')
    page.mouse.click(*point(page, 9.0 / 20.0, 32))
    assert 'missed' in page.locator('#event-list tr.chosen').first.inner_text()


def test_kinds_of_events_can_be_left_out_of_the_list(opened):
    page = opened('one.html')
    links = page.locator('#event-list a')
    assert links.count() == 6
    page.uncheck('#kinds input >> nth=0')
    page.check('#kinds input >> nth=3')
    assert sorted(set(links.all_inner_texts())) == ['◆ late', '● detected', '✕ missed']
    for kind in (1, 2, 3):
        page.uncheck(f'#kinds input >> nth={kind}')
    assert page.locator('#event-list tbody').inner_text() == 'none of the kinds that are ticked'


def test_before_and_after_can_be_switched(opened):
    page = opened('both.html')
    after = pixels(page)
    assert page.locator('#kinds').inner_text().count('(0)') == 3
    page.check('input[name=variant] >> nth=0')
    assert view(page)[1] == 0
    assert pixels(page) != after
    assert page.locator('#kinds').inner_text().count('(0)') == 0
    page.check('input[name=variant] >> nth=1')
    assert pixels(page) == after


def test_channels_show_volts_or_levels_on_their_own_or_on_one_scale(opened):
    page = opened('both.html')
    volts = pixels(page)
    page.check('#same-scale')
    assert pixels(page) != volts
    page.uncheck('#same-scale')
    assert pixels(page) == volts
    page.select_option('#signal', 'level')
    assert pixels(page) != volts
    assert page.locator('#scale-choice').is_hidden()


def read_out(page, share, y):
    settle(page)
    page.mouse.move(*point(page, share, y))
    expect(page.locator('#readout')).to_contain_text('threshold')
    return page.inner_text('#readout')


def test_of_evidence_excess_floor_and_impacts_are_shown(opened):
    page = opened('evidence.html')
    pictures = [pixels(page)]
    for signal in ('level', 'excess', 'floor'):
        page.select_option('#signal', signal)
        pictures.append(pixels(page))
    assert len(set(pictures)) == 4
    names = page.evaluate('timeline.lanes.map((lane) => lane.name)')
    assert names[:5] == ['events', 'label', 'slip given', 'slip evidence', 'after impact']
    y = page.evaluate('timeline.lanes.find((lane) => lane.curve).top + 10')
    text = read_out(page, 4.6 / 20.0, y)  # amid the first slip
    shown = re.search(r'excess ([-\d.]+) dB \u00b7 floor ([-\d.]+) dB', text)
    excess_db, floor_db = shown.groups()
    assert float(excess_db) == pytest.approx(13.0, abs=0.1)
    assert -80.0 < float(floor_db) < -60.0
    # The other variant has neither: its level is shown instead.
    page.check('input[name=variant] >> nth=0')
    assert 'excess' not in read_out(page, 4.6 / 20.0, y)
    assert 'after impact' not in page.evaluate('timeline.lanes.map((lane) => lane.name)')


def test_the_scale_of_excess_and_floor_is_told(opened):
    page = opened('evidence.html')
    assert page.locator('#signal option').all_inner_texts() == [
        'volts', 'level or evidence / threshold', 'excess above the noise floor', 'noise floor',
    ]  # fmt: skip
    told = page.locator('#resolution')
    expect(told).not_to_contain_text('dB')
    page.select_option('#signal', 'excess')
    expect(told).to_contain_text(
        'The excess is drawn from -8.7 to 13.0 dB, with a line at 3.5 dB, above which'
    )
    page.select_option('#signal', 'floor')
    expect(told).to_contain_text('The floor is drawn from -70.5 to -10.5 dB.')
    page.get_by_label('given').check()  # it decides by the mean of its envelope
    expect(told).not_to_contain_text('dB')


def test_where_nothing_decides_by_evidence_there_is_no_choice_of_it(opened):
    page = opened('one.html')
    assert page.locator('#signal option').all_inner_texts() == ['volts', 'level / threshold']


@pytest.mark.parametrize('name', ['one.html', 'coarse.html'])
def test_the_read_out_about_an_event_is_the_very_sample(opened, name):
    page = opened(name, '#event-0-0-1')
    _, _, start, stop = view(page)
    # The first channel of the first group is ch14.
    volts, truth = scenes.volts_and_truth(seed=0)
    row = 1520 + 5
    assert truth[row]
    y = page.evaluate('timeline.lanes.find((lane) => lane.curve).top + 10')
    text = read_out(page, ((row + 0.5) / 380.0 - start) / (stop - start), y)
    time_s, channel, value, ratio = re.fullmatch(
        r'([\d.]+) s · (\w+) · ([\d.]+) V · level / threshold (.+)', text
    ).groups()
    assert channel == 'ch14'
    assert float(time_s) == pytest.approx(row / 380.0, abs=0.003)
    assert float(value) == pytest.approx(volts[row, 13], abs=6e-4)
    assert ratio


def test_where_bins_are_coarse_the_page_says_how_coarse(opened):
    page = opened('coarse.html')
    assert 'each 84 ms' in page.inner_text('#resolution')
    assert 'row by row about the start of 3 of 3 events' in page.inner_text('#resolution')
    page = opened('one.html')
    assert 'Each row is drawn' in page.inner_text('#resolution')


def test_data_that_are_broken_are_said_to_be(browser, folder):
    text = (folder / 'one.html').read_text(encoding='utf-8')
    broken = re.sub(r'(id="data-0">.{200}).{8}', r'\1AAAAAAAA', text)
    (folder / 'broken.html').write_text(broken, encoding='utf-8')
    page = browser.new_page()
    page.goto((folder / 'broken.html').as_uri())
    expect(page.locator('#failure')).to_contain_text('a.npz cannot be drawn')
    page.close()


def test_many_channels_without_labels_or_events(opened):
    page = opened('unlabelled.html')
    names = page.evaluate('timeline.lanes.map((lane) => lane.name)')
    assert 'label' not in names
    assert len([name for name in names if name and name.startswith('ch')]) == 95
    assert 'Disabled channels, 1 of them' in page.inner_text('#resolution')
    assert page.locator('#event-list tbody').inner_text() == 'no events'
    assert page.locator('#variant-choice').is_hidden()
    before = pixels(page)
    page.click('#zoom-in')
    assert pixels(page) != before
