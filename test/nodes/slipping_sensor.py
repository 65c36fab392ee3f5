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

"""A sensor of the test's own for a detector: noise that slips or rests, with any fault."""

import functools
import math
import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import sensor_qos, state_qos
from support.harness import sample

RATE_HZ = 380.0
PERIOD_S = 1 / RATE_HZ
TIMEOUT_S = 0.5

#: Seconds that a busy machine may add to a time guaranteed by the detector.
SLACK_S = 0.5


class Sensor:
    """A sensor of the test's own: noise that slips, sent in real time, with any fault."""

    def __init__(self, bench, output=None, **parameters):
        self.bench, self._output = bench, output
        self.reports = bench.listen(DiagnosticArray, '/diagnostics', 10)
        # Each message with the time of its receipt.
        self.slip, self.valid = [], []
        for topic, heard in (('slip', self.slip), ('slip_valid', self.valid)):
            hear = functools.partial(self._hear, heard)
            bench.node.create_subscription(Bool, topic, hear, state_qos(100))
        self._voltages = bench.node.create_publisher(JointState, 'voltages', sensor_qos())
        self._parameters = parameters
        self.start()
        self.random = np.random.default_rng(0)
        self.next_s = time.monotonic()
        # The clock of the sensor's stamps.
        self.clock_s = time.time()
        self.sent_s = -math.inf

    def _hear(self, heard, message):
        heard.append((time.monotonic(), message.data))

    def start(self):
        options = {'parameters': self._parameters, 'output': self._output}
        self.process, known = self.bench.start('slip_detector', **options), len(self.slip)
        subscribed = self._voltages.get_subscription_count
        self.bench.wait_for(lambda: len(self.slip) > known and subscribed(), 'the detector')

    def row(self, slipping=True):
        """Return a row that slips, or one of a finger at rest."""
        return 4.0 + (0.3 if slipping else 1e-4) * self.random.standard_normal(16)

    def send(self, row, *, after_s=PERIOD_S, stamped_after_s=PERIOD_S):
        """Publish a row, some time after the one before and stamped some time after it."""
        self.next_s = max(self.next_s + after_s, time.monotonic() - 0.05)
        while (ahead_s := self.next_s - time.monotonic()) > 0:
            self.bench.executor.spin_once(timeout_sec=ahead_s)
        self.clock_s += stamped_after_s
        self._voltages.publish(sample(row, round(self.clock_s * 1e9)))
        self.sent_s = time.monotonic()

    def play(self, until, what):
        """Send good samples until something holds."""
        deadline_s = time.monotonic() + 60.0
        while not until():
            assert time.monotonic() < deadline_s, f'no {what}:\n{self.process.log()}'
            self.send(self.row())

    def slips(self):
        """Play until slip is ON and valid."""
        self.play(self.says_slip, 'slip')

    def says_slip(self):
        return all(heard and heard[-1][1] for heard in (self.slip, self.valid))

    def fell(self):
        return not self.valid[-1][1] and not self.slip[-1][1]

    def fell_in_time(self):
        """Check that slip_valid and slip fell in time after the last sample, by themselves."""
        self.bench.wait_for(self.fell, 'slip_valid and slip to fall')
        at_s = next(at for at, valid in reversed(self.valid) if valid)
        assert at_s - self.sent_s < TIMEOUT_S + SLACK_S

    def told(self, part, words):
        """Return whether the diagnostics contain a text."""
        return any(
            status.name.endswith(f': {part}') and words in status.message
            for report in self.reports
            for status in report.status
        )

    def goes_on(self):
        """Check that the detector works as before."""
        self.slips()
        assert not self.process.ended()
        assert 'Traceback' not in self.process.log()
