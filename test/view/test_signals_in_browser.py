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


"""The tabs of the signals in a real browser: traces and the threshold, the spectrum and bands."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view import server
from slip_detector.view.detectors import RESTART
from support import page_parts as parts
from support.browsers import expect
from support.finger_states import rest_rows
from support.simulated_detectors import SimulatedDetectors

#: Period of the frames that a user gets.
FRAME_S = server.FRAME_S

#: Pixels of the names at the left and of the scales at the right.
NAMES_WIDTH, RIGHT_MARGIN = 92, 60
#: Toggles channels and presses keys on the timeline before anything can be drawn or received.
CHOOSE_AND_PRESS = """([names, keys]) => {
  for (const name of names) document.querySelector(`[aria-label="Traces of ${name}"]`).click();
  const place = document.getElementById('timeline');
  place.focus();
  for (const key of keys) {
    place.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true}));
  }
}"""


def stretch(page):
    """Return from when to when is drawn."""
    data = page.evaluate('({...document.getElementById("timeline").dataset})')
    return float(data['fromS']), float(data['toS'])


def test_time_goes_on_and_never_back_and_stands_still_without_samples(serve, monkeypatch):
    monkeypatch.setattr(server, 'FRAME_S', FRAME_S)
    served, page = serve(SimulatedDetectors())
    parts.until(page, 'data.toS > 0')
    ends_of_a_second = """async (seconds) => {
      const {dataset} = document.getElementById('timeline'), ends = [];
      const begin = performance.now();
      while (performance.now() < begin + 1000 * seconds) {
        await new Promise(requestAnimationFrame);
        ends.push(Number(dataset.toS));
      }
      return ends;
    }"""
    steps = np.diff(page.evaluate(ends_of_a_second, 2.0))
    assert (steps >= 0).all()
    assert steps.sum() > 0
    # Columns are drawn at whole columns, each as it was drawn before.
    width = page.locator('#timeline').bounding_box()['width'] - NAMES_WIDTH - RIGHT_MARGIN
    columns = steps * width / 10.0
    assert columns == pytest.approx(columns.round(), abs=0.02)
    served.call(setattr, served.detectors, 'real_time', False)
    expect(parts.card(page)).to_contain_text(re.compile(r'no sample for ([2-9]|\d\d)'))
    assert len(set(page.evaluate(ends_of_a_second, 1.0))) == 1
    served.call(served.detectors.simulated.clear)  # No heart beats any more.
    expect(parts.card(page)).to_contain_text('was it killed, or stopped?')


def test_traces_are_chosen_paused_read_and_the_threshold_is_moved(serve):
    served, page = serve(SimulatedDetectors())
    names, lanes = page.locator('.lane-name'), page.locator('.lane-name.channel')
    readout = page.locator('#traces .readout')
    parts.until(page, 'data.toS > 0')  # Times are those since the first minute that is drawn.
    served.call(served.detectors.simulated[parts.NAME].play, 31.0)  # It slips from 3.8 s on.
    parts.until(page, 'data.toS > 71')  # Stamps begin at 1000 s.
    expect(names.get_by_text('truth', exact=True)).to_be_visible()
    assert names.all_inner_texts()[:3] == ['slip', 'truth', 'ch9']
    # The threshold is set when the line is let go, or with Enter.
    line = parts.threshold_line(page)
    box = line.bounding_box()
    x, y = box['x'] + 60, box['y'] + box['height'] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y + 12, steps=3)
    expect(line).not_to_have_attribute('aria-valuetext', 'threshold 0.5')
    assert parts.config_of(served).threshold == 0.5
    page.mouse.up()
    page.mouse.move(0, 0)  # What follows is done by keys alone.
    expect(parts.changes(page)).to_contain_text('threshold from 0.5')
    before = parts.config_of(served).threshold
    assert before < 0.45
    parts.press(line, 'ArrowUp', 'Escape', 'ArrowUp', 'Enter')
    expect(parts.changes(page)).to_contain_text(f'from {before:g} to {1.05 * before:.3g}')
    parts.button(page, 'LU').click()
    expect(lanes).to_have_text(['ch2', 'ch4', 'ch13', 'ch15'])
    live = stretch(page)

    # Paused it stands still, can be zoomed and moved, and stays though the detector starts again.
    # No key is lost while the channels chosen last have not come yet. One channel stays.
    page.evaluate(CHOOSE_AND_PRESS, [['ch2', 'ch4', 'ch13', 'ch15'], ['p', '+', 'ArrowLeft']])
    expect(lanes).to_have_text(['ch15'])
    expect(parts.button(page, 'Go on')).to_be_visible()
    parts.until(page, f'data.toS - data.fromS < {0.9 * (live[1] - live[0])}')
    from_s, to_s = stretch(page)
    assert to_s - from_s == pytest.approx((live[1] - live[0]) / 2)
    (connection,) = served.server.pages
    while served.call(lambda: connection.view.until_ns is None):
        page.wait_for_timeout(20)
    finger = served.detectors.fingers[parts.NAME]
    volts = served.call(finger.track.samples.field('volts')[:, 14].copy)
    served.call(finger.track.samples.clear)
    served.call(finger.update_config, finger.config, RESTART)
    expect(parts.card(page).locator('.notice')).to_contain_text('started again')
    assert stretch(page) == (from_s, to_s)
    page.keyboard.press('Shift+ArrowLeft')
    # A column has one sample, or the range of several.
    words = re.compile(r'^[\d.]+ s · ch15 · ([\d.]+)( V)? .*level')
    expect(readout).to_have_text(words)
    expect(readout).to_have_attribute('aria-live', 'polite')
    read_v = float(words.search(readout.inner_text()).group(1))
    assert np.abs(volts - read_v).min() < 6e-4
    # What is pointed at stays when the finger is described again.
    served.call(finger.update_config, replace(finger.config, threshold=0.3), RESTART)
    expect(line).to_have_attribute('aria-valuetext', 'threshold 0.3')
    page.keyboard.press('Shift+ArrowDown')
    expect(readout).to_contain_text('of the threshold')
    page.keyboard.press('p')
    parts.until(page, f'data.toS > {live[1]}')
    page.keyboard.press('Home')
    expect(page.locator('#trace-span')).to_have_text('10 s')


def seen_in(page, lane):
    """Return the pixels right of a lane's name, as numbers: rows, columns, colours."""
    image = pytest.importorskip('PIL.Image')
    plot, lane = page.locator('#timeline').bounding_box(), lane.bounding_box()
    left, width = plot['x'] + NAMES_WIDTH, plot['width'] - NAMES_WIDTH - RIGHT_MARGIN
    seen = page.screenshot(clip={**lane, 'x': left, 'width': width})
    return np.asarray(image.open(io.BytesIO(seen)).convert('RGB'), int)


def test_a_slip_is_one_bar_where_samples_are_far_apart_and_two_fingers_zoom(played):
    config = DetectorConfig(
        sample_rate_hz=60.0, passband_hz=(5.0, 20.0), stopbands_hz=(), threshold=1e-9
    )
    _, page = played({'index': rest_rows()}, config=config)
    parts.until(page, 'data.toS > 44')
    touch, box = page.context.new_cdp_session(page), page.locator('#timeline').bounding_box()

    def put(kind, *xs):
        points = [{'x': x, 'y': box['y'] + 60, 'id': i} for i, x in enumerate(xs)]
        touch.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': points})

    middle = box['x'] + box['width'] / 2
    put('touchStart', middle - 40)
    put('touchStart', middle - 40, middle + 40)
    for apart in (80, 160, 320):
        put('touchMove', middle - apart, middle + apart)
    put('touchEnd')
    expect(page.locator('#trace-span')).to_have_text('1.25 s')
    parts.until(page, 'data.toS - data.fromS < 2')
    orange = (seen_in(page, page.locator('.lane-name').first)[6] == (213, 94, 0)).all(axis=1)
    assert orange[:-3].all()


def rows_with_lines(*frequencies_hz):
    """Return noise with lines in channels 1 to 8."""
    seconds = np.arange(3800) / 380.0
    rows = 4.3 + 1e-3 * np.random.default_rng(3).normal(size=(3800, 16))
    for hz in frequencies_hz:
        rows[:, :8] += 0.05 * np.sin(2 * np.pi * hz * seconds)[:, np.newaxis]
    return rows


def test_the_spectrum_is_read_kept_as_rest_and_its_bands_are_dragged(serve):
    served, page = serve(SimulatedDetectors(rows=rows_with_lines(31.0, 110.0)))
    simulated = served.detectors.simulated[parts.NAME]
    served.call(simulated.play, 6.0)
    parts.tab(page, 'Spectrum').click()
    page.get_by_label('Channel', exact=True).select_option('ch1')
    picture = page.locator('#spectrum-plot')
    words = 'Spectrum of ch1; pass-band 7 to 50 Hz; strongest at 31 Hz'
    expect(picture).to_have_accessible_name(words)
    readout = page.locator('#spectrum .readout')
    picture.focus()
    for key, words in (('ArrowRight', '31'), ('ArrowRight', '31.5'), ('PageDown', '21.5')):
        page.keyboard.press(key)
        expect(readout).to_contain_text(f'{words} Hz · ')
    served.call(setattr, simulated, 'rows', rows_with_lines())
    served.call(simulated.play, 8.0)
    parts.button(page, 'Hold as rest').click()
    expect(picture).to_have_accessible_name(re.compile('with the one at rest behind it'))
    served.call(setattr, simulated, 'rows', rows_with_lines(31.0))
    served.call(simulated.play, 8.0)
    box = page.locator('.spectrum-plot .u-over').bounding_box()
    least, most = np.log([0.5, 190.0])
    x = box['x'] + box['width'] * (np.log(31.0) - least) / (most - least)
    page.mouse.move(x, box['y'] + box['height'] - 20)
    expect(readout).to_have_text(re.compile(r'dB · at rest .* · (1[5-9]|[2-9]\d)\.\d dB above'))
    # Where edges of two bands meet, the line is the pass-band's, and each has a label.
    low, high = (parts.slider(page, f'Pass-band, {end} edge') for end in ('low', 'high'))
    line = low.bounding_box()
    label = parts.slider(page, 'Stop-band 1, high edge').locator('.label').bounding_box()
    at_line = line['x'] + line['width'] / 2, line['y'] + line['height'] - 20
    at_label = label['x'] + label['width'] / 2, label['y'] + 6
    for x, y in (at_line, at_label):
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(line['x'] + 60, y, steps=4)
        page.mouse.up()
    expect(parts.changes(page)).to_contain_text('stopbands_hz')
    from_hz, to_hz = parts.config_of(served).passband_hz
    assert (8.0 < from_hz < 20.0, to_hz) == (True, 50.0)
    (_, stop_hz), others = parts.config_of(served).stopbands_hz
    assert (8.0 < stop_hz < 20.0, others) == (True, (50.0, 180.0))
    # An edge stops where no band would be left, and says so.
    parts.press(low, *(12 * ['PageUp']))
    expect(low).to_have_attribute('aria-valuetext', 'pass from 47.5 Hz: no farther')
    parts.press(low, 'Escape')
    parts.press(high, *(9 * ['PageUp']))
    expect(high).to_have_attribute('aria-valuetext', 'pass to all above')
    page.keyboard.press('Enter')
    expect(parts.changes(page)).to_contain_text(f'to {from_hz:g}, 0')
    config = replace(parts.config_of(served), stopbands_hz=((0.5, 7.0),))
    served.call(simulated.change, config)
    expect(parts.slider(page, 'Stop-band 2, low edge')).to_have_count(0)
    mains = parts.mains(page)
    mains.select_option('mains 60 Hz')
    expect(parts.changes(page)).to_contain_text('mains_hz from 0 to 60')
    # No whole periods of 61 Hz: the detector says so, the choice goes back. When the parameters
    # change, or their finger goes, the refusal says nothing any more.
    mains.evaluate('(mains) => mains.append(new Option("mains 61 Hz", 61))')
    refusal, detectors = page.locator('#refusal'), served.detectors
    finger = detectors.fingers[parts.NAME]
    other = finger.config.with_values({'gain': 5.0})
    for change in (lambda: finger.update_config(other), lambda: detectors.remove('index')):
        mains.select_option('mains 61 Hz')
        expect(refusal).to_contain_text('parameter mains_hz is 61 Hz')
        expect(mains).to_have_value('60')
        served.call(change)
        expect(refusal).to_be_hidden()
