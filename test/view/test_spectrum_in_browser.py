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

from support.browsers import expect
from support.page_parts import NAME, changes, config_of
from support.simulated_detectors import SimulatedDetectors

AT_REST = re.compile('with the one at rest behind it')


def rows_with_lines(*frequencies_hz):
    """Return noise with lines in channels 1 to 8."""
    seconds = np.arange(3800) / 380.0
    rows = 4.3 + 1e-3 * np.random.default_rng(3).normal(size=(3800, 16))
    for hz in frequencies_hz:
        rows[:, :8] += 0.05 * np.sin(2 * np.pi * hz * seconds)[:, np.newaxis]
    return rows


@pytest.fixture
def served(serve):
    """Serve a finger with lines at 31 and 110 Hz."""
    served = serve(SimulatedDetectors(rows=rows_with_lines(31.0, 110.0)))
    # What the detector has heard so far, so that no test waits for it.
    served.call(served.detectors.simulated[NAME].play, 6.0)
    return served


@pytest.fixture
def page(served, open_page):
    page = open_page(served)
    page.get_by_role('tab', name='Spectrum').click()
    page.get_by_label('Channel', exact=True).select_option('ch1')
    return page


def picture(page):
    return page.get_by_role('img', name='Spectrum of')


def edge(page, name):
    return page.get_by_role('slider', name=name)


def test_lines_are_found_and_read_by_pointer_and_keys_and_above_rest(served, page):
    expect(picture(page)).to_have_accessible_name(
        'Spectrum of ch1; pass-band 7 to 50 Hz; strongest at 31 Hz'
    )
    readout = page.locator('#spectrum .readout')
    picture(page).focus()
    for key, words in (('ArrowRight', '31'), ('ArrowRight', '31.5'), ('PageDown', '21.5')):
        page.keyboard.press(key)
        expect(readout).to_contain_text(f'{words} Hz · ')
    simulated = served.detectors.simulated[NAME]
    served.call(setattr, simulated, 'rows', rows_with_lines())
    served.call(simulated.play, 8.0)
    page.get_by_role('button', name='Hold as rest').click()
    expect(picture(page)).to_have_accessible_name(AT_REST)
    served.call(setattr, simulated, 'rows', rows_with_lines(31.0))
    served.call(simulated.play, 8.0)
    box = page.locator('.spectrum-plot .u-over').bounding_box()
    least, most = np.log([0.5, 190.0])
    x = box['x'] + box['width'] * (np.log(31.0) - least) / (most - least)
    page.mouse.move(x, box['y'] + box['height'] - 20)
    expect(readout).to_have_text(re.compile(r'dB · at rest .* · (1[5-9]|[2-9]\d)\.\d dB above'))
    # It is held by the server: a page that is loaded again has it too.
    page.reload()
    page.get_by_role('tab', name='Spectrum').click()
    expect(picture(page)).to_have_accessible_name(AT_REST)


def test_edges_of_bands_are_dragged_and_moved_by_keys(served, page):
    # Where edges of two bands meet, each has a label to be gripped by.
    low, high = edge(page, 'Pass-band, low edge'), edge(page, 'Pass-band, high edge')
    grip = low.locator('.label').bounding_box()
    page.mouse.move(grip['x'] + 30, grip['y'] + 6)
    page.mouse.down()
    page.mouse.move(grip['x'] + 70, grip['y'] + 6, steps=4)
    assert config_of(served).passband_hz == (7.0, 50.0)
    page.mouse.up()
    expect(changes(page)).to_contain_text('passband_hz')
    from_hz, to_hz = config_of(served).passband_hz
    assert 8.0 < from_hz < 20.0
    assert to_hz == 50.0
    expect(low).to_have_attribute('aria-valuetext', f'pass from {from_hz:g} Hz')
    high.focus()
    page.keyboard.press('ArrowDown')
    page.keyboard.press('Enter')
    expect(changes(page)).to_contain_text(f'from {from_hz:g}, 50 to {from_hz:g}, 49')
    for _ in range(8):
        page.keyboard.press('PageUp')
    expect(high).to_have_attribute('aria-valuetext', 'pass to all above')
    page.keyboard.press('Enter')
    expect(changes(page)).to_contain_text(f'to {from_hz:g}, 0')
    assert config_of(served).passband_hz == (from_hz, 0.0)


def test_stop_bands_and_mains_come_and_go(served, page):
    page.get_by_role('button', name='Remove stop-band 2: 50 to 180 Hz').click()
    expect(edge(page, 'Stop-band')).to_have_count(2)
    assert config_of(served).stopbands_hz == ((0.5, 7.0),)
    page.get_by_role('button', name='Add stop-band').click()
    expect(edge(page, 'Stop-band')).to_have_count(4)
    assert len(config_of(served).stopbands_hz) == 2
    mains = edge(page, 'Mains')
    expect(mains).to_have_count(0)
    page.get_by_label('Hum of the mains that is taken off').select_option('mains 50 Hz')
    expect(mains).to_have_attribute('aria-valuetext', 'mains 50 Hz')
    assert config_of(served).mains_hz == 50.0
    mains.focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    expect(mains).to_have_attribute('aria-valuetext', 'mains 60 Hz')
    page.keyboard.press('ArrowUp')
    page.keyboard.press('Enter')
    # No whole periods of 61 Hz: the detector says so, and the line goes back.
    expect(page.get_by_role('alert')).to_contain_text('parameter mains_hz is 61 Hz')
    expect(mains).to_have_attribute('aria-valuetext', 'mains 60 Hz')
