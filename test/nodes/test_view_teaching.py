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


"""From a sensor that nobody has seen to a detector that runs tuned, on the page, with nodes."""

import itertools
import re
import threading

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from scipy import signal
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, String

from slip_detector.chain.live_chain import HISTORY_S
from slip_detector.nodes.messages import event_qos, sensor_qos, stamp_ns, state_qos
from support.browsers import PATIENCE_MS, expect
from support.harness import sample
from support.page_parts import record_button, recording, tool

#: A search takes so long at most where other tests run beside it.
SEARCH_MS = 300_000

#: Seconds of a recording of rest, and of a slip with the rest before it.
REST_S, SLIP_S = 30, 4


def wait_until_it_has(page, name, seconds):
    at_least = '|'.join(map(str, range(seconds, 10 * seconds)))
    text = re.compile(rf'{name} of .*: ({at_least})\.')
    expect(page.locator('.teach-now')).to_have_text(text)


def slide(page, name):
    page.keyboard.down(' ')
    wait_until_it_has(page, name, SLIP_S)
    page.keyboard.up(' ')
    expect(recording(page, name)).to_be_visible()


def test_a_simulated_finger_does_what_is_recorded(bench, browser, tmp_path):
    truth = bench.listen(Bool, '/scene/index/slip_truth', state_qos())
    _, address = bench.start_view('--folder', str(tmp_path), '--scene', 'obedient')
    page = browser.new_page()
    page.goto(address)
    expect(record_button(page, 'Slip')).to_be_enabled()
    expect(page.locator('#teach')).to_contain_text('simulated, and does what you press')
    page.keyboard.down(' ')
    bench.wait_for(lambda: truth and truth[-1].data, 'a slide')
    page.keyboard.up(' ')
    bench.wait_for(lambda: not truth[-1].data, 'rest')
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
        self.row, self.done, self.onsets = 0, [(0, 'rest')], []
        self.node = node = Node('sensor', context=bench.context)
        self.voltages = node.create_publisher(JointState, 'voltages', sensor_qos())
        node.create_subscription(String, 'scene_order', self.obey, state_qos())
        node.create_subscription(Header, 'slip_onset', self.hear, event_qos(100))
        node.create_timer(self.PERIOD_S, self.send)
        self.executor = SingleThreadedExecutor(context=bench.context)
        self.executor.add_node(node)
        threading.Thread(target=self.executor.spin, daemon=True).start()

    def obey(self, order):
        self.done.append((self.row, order.data))

    def hear(self, onset):
        self.onsets.append((stamp_ns(onset.stamp) - self.BEGIN_NS) * 1e-9 * self.RATE_HZ)

    def send(self):
        done = [what for _, what in self.done]
        level = 10 ** (self.LEVELS_DB[done.count('slip') % 2] / 20) * (done[-1] == 'slip')
        for row in range(self.row, self.row + self.AT_ONCE):
            volts = self.still[row % self.ROWS] + level * self.slide[row % self.ROWS]
            at_ns = self.BEGIN_NS + round(1e9 * row / self.RATE_HZ)
            self.voltages.publish(sample(volts.tolist(), at_ns))
        self.row += self.AT_ONCE


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
    page.on('dialog', lambda dialog: dialog.accept())
    page.goto(address)
    page.get_by_role('button', name='Take 6 channels at 200 Hz, one group').click()
    finger = page.locator('.finger')
    expect(finger).to_have_attribute('data-state', re.compile('rest|slip'))
    for name in ('rest_1', 'rest_2'):
        page.keyboard.press('r')
        wait_until_it_has(page, name, REST_S)
        page.keyboard.press('r')
        expect(recording(page, name)).to_be_visible()
    for k in range(1, 7):
        slide(page, f'slip_{k}')
    tool(page, 'Tune').click()
    trials, answer = page.locator('.tuning-step'), page.locator('#tuning-answer')
    # Two slips are held out: one false alarm there outweighs the slip that is found more. What was
    # found is applied nevertheless, and has to find all slips that follow.
    found = re.compile('Finds [1-9]|the best that was tried is worse')
    expect(trials).to_have_text(re.compile(r'[2-9]\d of'), timeout=SEARCH_MS)
    page.locator('#stop-tuning').click()
    expect(answer).to_contain_text(found, timeout=SEARCH_MS)
    tool(page, 'Tune').click()
    expect(trials).to_have_text(re.compile(r'[1-3]\d\d of'), timeout=SEARCH_MS)
    expect(answer).to_contain_text(found, timeout=SEARCH_MS)
    # Whoever has pressed Tune sees the answer, and what to press next.
    for part in (answer, page.locator('#apply')):
        expect(part).to_be_in_viewport(ratio=1)
    page.locator('#apply').click()
    expect(page.locator('.teach-words')).to_contain_text('the detector runs with')
    # Before the new chain has seen as much as it remembers, slip that comes ON is no onset.
    lessons, settled = len(sensor.done), sensor.row + HISTORY_S * sensor.RATE_HZ
    bench.wait_for(lambda: sensor.row >= settled, 'the new chain to settle')
    for k in range(7, 11):
        slide(page, f'slip_{k}')
    expect(finger).to_have_attribute('data-state', 'rest')
    onsets = {'slip': [], 'rest': []}
    for (first, what), (last, _) in itertools.pairwise([*sensor.done, (sensor.row, '')][lessons:]):
        onsets[what].append(sum(first <= row < last for row in sensor.onsets))
    assert 0 not in onsets['slip']
    assert sum(onsets['rest']) <= 1
    page.close()
