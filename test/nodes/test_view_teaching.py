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


"""From a sensor that nobody has seen to a saved configuration, on the page, with real nodes."""

import itertools
import re
import threading

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from scipy import signal
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from slip_detector.nodes.messages import event_qos, sensor_qos, stamp_ns, state_qos, time_message
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameters import text_of
from support.browsers import PATIENCE_MS, expect
from support.page_parts import record_button, recording, tab, tool

#: A search takes so long at most where other tests run beside it.
SEARCH_MS = 300_000


def wait_until_it_has(page, name, seconds):
    at_least = '|'.join(map(str, range(seconds, 10 * seconds)))
    text = re.compile(rf'{name} of .*: ({at_least})\.')
    expect(page.locator('.teach-now')).to_have_text(text)


def recorded_for(page, key, name, seconds):
    """Record with a key until so many seconds are in it."""
    page.keyboard.press(key)
    wait_until_it_has(page, name, seconds)
    page.keyboard.press(key)
    expect(recording(page, name)).to_be_visible()


def slide(page, name, seconds):
    """Record a slip of so many seconds, with the rest before it."""
    page.keyboard.down(' ')
    wait_until_it_has(page, name, seconds)
    page.keyboard.up(' ')
    expect(recording(page, name)).to_be_visible()


def taught(page, rest_s, slips, slip_s, taps_s):
    """Record rest, slips and taps, tune on them with a short search, and apply what it finds."""
    recorded_for(page, 'r', 'rest_1', rest_s)
    recorded_for(page, 'r', 'rest_2', rest_s)
    for k in range(1, slips + 1):
        slide(page, f'slip_{k}', slip_s)
    recorded_for(page, 't', 'taps_1', taps_s)
    tool(page, 'Tune').click()
    searching = re.compile(r'([2-9]\d|[1-3]\d\d) of')
    expect(page.locator('.tuning-step')).to_have_text(searching, timeout=SEARCH_MS)
    page.locator('#stop-tuning').click()
    answer = page.locator('#tuning-answer')
    expect(answer).to_contain_text(re.compile('Finds [1-9]'), timeout=SEARCH_MS)
    # Whoever has pressed Tune sees the answer, and what to press next.
    for part in (answer, page.locator('#apply')):
        expect(part).to_be_in_viewport(ratio=1)
    page.locator('#apply').click()
    expect(page.locator('.teach-words')).to_contain_text('the detector runs with')


def test_rest_slip_taps_tune_apply_and_save_with_a_simulated_finger_that_obeys(
    bench, browser, tmp_path
):
    folder = tmp_path / 'taught'
    _, address = bench.start_view('--folder', str(folder), '--scene', 'obedient')
    page = browser.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address)
    expect(record_button(page, 'Rest')).to_be_enabled(timeout=PATIENCE_MS)
    expect(page.locator('#teach')).to_contain_text('simulated, and does what you press')
    finger = page.locator('.finger')
    expect(finger).to_have_attribute('data-state', re.compile('rest|slip'))
    taught(page, rest_s=6, slips=4, slip_s=4, taps_s=10)
    expect(finger).to_have_attribute('data-state', 'rest')
    page.keyboard.down(' ')
    expect(finger).to_have_attribute('data-state', 'slip')
    page.keyboard.up(' ')
    expect(finger).to_have_attribute('data-state', 'rest')
    tab(page, 'Parameters').click()
    tuned = DetectorConfig.from_yaml(folder / 'scene' / 'index' / 'tuning' / 'tuned.yaml')
    threshold = page.locator('[data-name=threshold] input')
    expect(threshold).to_have_value(text_of(tuned.threshold))
    tool(page, 'Save').click()
    expect(page.locator('.saved')).to_contain_text('config:=')
    saved = folder / 'scene_index.yaml'
    assert DetectorConfig.from_yaml(saved).to_parameters() == tuned.to_parameters()
    page.close()


class Sensor:
    """Six channels at 200 Hz with noise, hum, and a hand that does at once what is recorded.

    Every second slide is 15 dB above the noise in its band, the others 3 dB. Its time passes four
    times as fast as that of the clock: stamps count.
    """

    RATE_HZ, BEGIN_NS, ROWS, LEVELS_DB = 200.0, 1_000_000_000_000, 40_000, (3.0, 15.0)
    PERIOD_S, AT_ONCE = 0.02, 16

    def __init__(self, bench):
        noise_v = np.random.default_rng(0).standard_normal((2, self.ROWS, 6))
        still_v, slide_v = noise_v * np.linspace(0.5e-3, 2e-3, 6)
        hum_v = 5e-3 * np.sin(np.pi / 2 * np.arange(self.ROWS) + 0.4)  # 50 Hz
        band = signal.butter(4, (60.0, 90.0), 'bandpass', fs=self.RATE_HZ, output='sos')
        self.still = 2.5 + still_v + hum_v[:, np.newaxis]
        self.slide = signal.sosfilt(band, slide_v, axis=0)
        #: Number of rows so far; what is done, from which row on; rows in which slip went ON.
        self.row, self.began, self.onsets = 0, [(0, 'rest')], []
        self.node = node = Node('sensor', context=bench.context)
        self.voltages = node.create_publisher(JointState, 'voltages', sensor_qos())
        node.create_subscription(String, 'scene_order', self.obey, state_qos())
        node.create_subscription(Header, 'slip_onset', self.hear, event_qos(100))
        node.create_timer(self.PERIOD_S, self.send)
        self.executor = SingleThreadedExecutor(context=bench.context)
        self.executor.add_node(node)
        threading.Thread(target=self.executor.spin, daemon=True).start()

    def obey(self, order):
        self.began.append((self.row, order.data))

    def hear(self, onset):
        self.onsets.append((stamp_ns(onset.stamp) - self.BEGIN_NS) * 1e-9 * self.RATE_HZ)

    def send(self):
        done = [what for _, what in self.began]
        slide_v = 10 ** (self.LEVELS_DB[done.count('slip') % 2] / 20) * self.slide
        for _ in range(self.AT_ONCE):
            at, at_ns = self.row % self.ROWS, round(1e9 * self.row / self.RATE_HZ)
            knock_v = 0.2 * (-1) ** at * (at % 300 < 4)
            volts = self.still[at] + {'slip': slide_v[at], 'taps': knock_v}.get(done[-1], 0.0)
            message = JointState(position=volts.tolist())
            message.header.stamp = time_message(self.BEGIN_NS + at_ns)
            self.voltages.publish(message)
            self.row += 1

    def onsets_while(self, what, since):
        """Return the number of onsets in each time that something was done, after so many."""
        times = [*itertools.pairwise([*self.began, (self.row, '')])][since:]
        rows = [(first, last) for (first, its), (last, _) in times if its == what]
        return [sum(first <= row < last for row in self.onsets) for first, last in rows]


@pytest.fixture
def sensor(bench):
    one = Sensor(bench)
    yield one
    one.executor.shutdown()
    one.node.destroy_node()


def test_a_sensor_that_nobody_has_seen_is_taken_taught_tuned_and_its_slips_are_detected(
    bench, browser, sensor, tmp_path
):
    bench.start('slip_detector')  # for 16 channels at 380 Hz
    _, address = bench.start_view('--folder', str(tmp_path))
    page = browser.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address)
    page.get_by_role('button', name='Take 6 channels at 200 Hz, one group').click()
    finger = page.locator('.finger')
    expect(finger).to_have_attribute('data-state', re.compile('rest|slip'))
    taught(page, rest_s=12, slips=6, slip_s=4, taps_s=14)
    lessons = len(sensor.began)
    for k in range(7, 11):
        slide(page, f'slip_{k}', 4)
    expect(finger).to_have_attribute('data-state', 'rest')
    assert 0 not in sensor.onsets_while('slip', lessons)
    assert sum(sensor.onsets_while('rest', lessons)) <= 1
    page.close()
