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

"""The spectrum in a real browser: how bands are chosen by eye."""

import re

import numpy as np
import pytest

from slip_detector.view.access import Access
from slip_detector.view.parameter_requests import ParameterRequests
from support.browsers import expect
from support.simulated_hand import SimulatedHand, served_beside

NAME = '/index/slip_detector'

AT_REST = re.compile('with the one at rest behind it')


def lines_at(*frequencies_hz):
    seconds = np.arange(3800) / 380.0
    rows = 4.3 + 1e-3 * np.random.default_rng(3).normal(size=(3800, 16))
    for hz in frequencies_hz:
        rows[:, :8] += 0.05 * np.sin(2 * np.pi * hz * seconds)[:, np.newaxis]
    return rows


@pytest.fixture
def served(tmp_path):
    """Serve a finger whose channels 1 to 8 have lines at 31 and 110 Hz."""
    prepare = lambda server: ParameterRequests(server, tmp_path)  # noqa: E731
    with served_beside(SimulatedHand(rows=lines_at(31.0, 110.0)), prepare=prepare) as served:
        # What the detector has heard so far, so that no test waits for it.
        served.call(served.hand.simulated[NAME].play, 6.0)
        yield served


@pytest.fixture
def page(served, open_page):
    page = open_page(served)
    page.get_by_role('tab', name='Spectrum').click()
    expect(picture(page)).to_be_visible()
    page.get_by_label('Channel', exact=True).select_option('ch1')
    return page


def picture(page):
    return page.get_by_role('img', name='Spectrum of')


def edge(page, name):
    return page.get_by_role('slider', name=name)


def config(served):
    return served.call(lambda: served.hand.fingers[NAME].config)


def changed(page, words):
    expect(page.locator('#parameters .changes')).to_contain_text(words)


def test_the_strongest_line_of_a_channel_is_found_and_read(page):
    expect(picture(page)).to_have_accessible_name(
        'Spectrum of ch1; pass-band 7 to 50 Hz; strongest at 31 Hz', timeout=60_000
    )
    box = page.locator('.spectrum-plot .u-over').bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    readout = page.locator('#spectrum .readout')
    expect(readout).to_contain_text('Hz')
    expect(readout).to_contain_text('dB')
    expect(readout).not_to_contain_text('rest')


def test_frequencies_are_read_by_keys_too(page):
    expect(picture(page)).to_have_accessible_name(re.compile('strongest at 31 Hz'), timeout=60_000)
    picture(page).focus()
    readout = page.locator('#spectrum .readout')
    page.keyboard.press('ArrowRight')
    expect(readout).to_contain_text('31 Hz · ')
    page.keyboard.press('ArrowRight')
    expect(readout).to_contain_text('31.5 Hz · ')
    page.keyboard.press('PageDown')
    expect(readout).to_contain_text('21.5 Hz · ')


def test_rest_is_held_as_a_shadow_and_what_is_above_it_is_read(served, page):
    rest = lines_at()
    served.call(setattr, served.hand.simulated[NAME], 'rows', rest)
    served.call(served.hand.simulated[NAME].play, 8.0)
    page.get_by_role('button', name='Hold as rest').click()
    expect(picture(page)).to_have_accessible_name(AT_REST, timeout=60_000)
    served.call(setattr, served.hand.simulated[NAME], 'rows', lines_at(31.0))
    served.call(served.hand.simulated[NAME].play, 8.0)
    box = page.locator('.spectrum-plot .u-over').bounding_box()
    least, most = np.log([0.5, 190.0])
    x = box['x'] + box['width'] * (np.log(31.0) - least) / (most - least)
    page.mouse.move(x, box['y'] + box['height'] - 20)
    readout = page.locator('#spectrum .readout')

    def above_db():
        return float(readout.inner_text().split('·')[-1].split()[0])

    expect(readout).to_contain_text('dB above')
    page.wait_for_function(
        """() => {
          const words = document.querySelector('#spectrum .readout').textContent.split('\u00b7');
          return parseFloat(words.at(-1)) > 15;
        }"""
    )
    assert above_db() > 15.0
    # It is held by the server: another channel, and a page that is loaded again, have it too.
    page.reload()
    page.get_by_role('tab', name='Spectrum').click()
    expect(picture(page)).to_have_accessible_name(AT_REST, timeout=60_000)


def test_the_edges_of_the_bands_are_dragged(served, page):
    # Where edges of two bands meet, each has a label to be gripped by.
    grip = edge(page, 'Pass-band, low edge').locator('.label').bounding_box()
    page.mouse.move(grip['x'] + 30, grip['y'] + 6)
    page.mouse.down()
    page.mouse.move(grip['x'] + 70, grip['y'] + 6, steps=4)
    assert config(served).passband_hz == (7.0, 50.0)
    page.mouse.up()
    changed(page, 'passband_hz')
    low, high = config(served).passband_hz
    assert 8.0 < low < 20.0
    assert high == 50.0
    expect(edge(page, 'Pass-band, low edge')).to_have_attribute(
        'aria-valuetext', f'pass from {low:g} Hz'
    )


def test_edges_are_moved_by_keys_and_an_upper_edge_can_be_left_out(served, page):
    high = edge(page, 'Pass-band, high edge')
    high.focus()
    page.keyboard.press('ArrowDown')
    page.keyboard.press('Enter')
    changed(page, 'passband_hz from 7, 50 to 7, 49')
    for _ in range(8):
        page.keyboard.press('PageUp')
    expect(high).to_have_attribute('aria-valuetext', 'pass to all above')
    page.keyboard.press('Enter')
    changed(page, 'to 7, 0')
    assert config(served).passband_hz == (7.0, 0.0)


def test_stop_bands_and_mains_come_and_go(served, page):
    page.get_by_role('button', name='Remove stop-band 2: 50 to 180 Hz').click()
    expect(page.get_by_role('slider', name='Stop-band')).to_have_count(2)
    assert config(served).stopbands_hz == ((0.5, 7.0),)
    page.get_by_role('button', name='Add stop-band').click()
    expect(page.get_by_role('slider', name='Stop-band')).to_have_count(4)
    assert len(config(served).stopbands_hz) == 2
    expect(edge(page, 'Mains')).to_have_count(0)
    page.get_by_label('Hum of the mains that is taken off').select_option('mains 50 Hz')
    expect(edge(page, 'Mains')).to_have_attribute('aria-valuetext', 'mains 50 Hz')
    assert config(served).mains_hz == 50.0
    edge(page, 'Mains').focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    expect(edge(page, 'Mains')).to_have_attribute('aria-valuetext', 'mains 60 Hz')
    page.keyboard.press('ArrowUp')
    page.keyboard.press('Enter')
    # No whole periods of 61 Hz: the detector says so, and the line goes back.
    expect(page.get_by_role('alert')).to_contain_text('parameter mains_hz is 61 Hz')
    expect(edge(page, 'Mains')).to_have_attribute('aria-valuetext', 'mains 60 Hz')


def test_with_read_only_nothing_can_be_moved(open_page):
    with served_beside(SimulatedHand(), access=Access(read_only=True)) as served:
        page = open_page(served)
        page.get_by_role('tab', name='Spectrum').click()
        expect(page.get_by_role('slider', name='Pass-band, low edge')).to_have_attribute(
            'aria-disabled', 'true'
        )
        expect(page.get_by_role('button', name='Add stop-band')).to_be_disabled()
        expect(page.get_by_role('button', name='Remove stop-band 1')).to_be_disabled()
