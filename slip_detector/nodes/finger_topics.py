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


"""Receives the topics of one finger that a page shows."""

import contextlib
import time
from bisect import bisect_right
from collections import deque
from operator import itemgetter
from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.nodes.inputs import Input
from slip_detector.nodes.messages import sensor_qos, state_qos
from slip_detector.nodes.rclpy_internals import ROS_ERRORS, PolledTopics
from slip_detector.parameters import DetectorConfig, fitting, names_that_affect, rates_differ
from slip_detector.recordings.messages import JointStateReader
from slip_detector.recordings.rates import measure_rate
from slip_detector.view.detectors import Diagnosis, Finger

#: Parameters on which the subscriptions depend.
TOPIC_PARAMETERS = names_that_affect(DetectorConfig, 'display')


#: Seconds of messages by which the page finds the parameters that fit the input.
FIT_PERIOD_S = 2.0

#: Most changes of a state that are kept: in the queue until a poll, then until their rows come.
MOST_STATES = 1000


#: Latest states of a topic, each with the time at which it was published.
States = deque[tuple[int, bool]]


def find_state(states: States, published_ns: int) -> bool:
    """Return the last state that was published before a row of the same process.

    A busy detector publishes levels late, after the decisions on the next samples. A change is
    then found a few rows early.
    """
    before = bisect_right(states, published_ns, key=itemgetter(0))
    return before > 0 and states[before - 1][1]


class FingerTopics(PolledTopics):
    """Subscribes to the topics of a finger, and keeps the finger up to date."""

    def __init__(self, node: Node, finger: Finger, voltages: str) -> None:
        super().__init__(node)
        self.finger = finger
        # Stamps and rows of the messages since the input was last noted; when, and the rate then.
        self._messages: list[tuple[int, int]] = []
        self._noted_s, self._rate_hz = time.monotonic(), 0.0
        self._slip: States = deque(maxlen=MOST_STATES)
        self._truth: States = deque(maxlen=MOST_STATES)
        self._levels, self._decisions = JointStateReader(), JointStateReader('effort')
        #: Nodes that publish the samples.
        self.senders: list[str] = []
        #: By label, the last diagnosis by the detector and by these nodes, and its time.
        self.health: dict[str, tuple[float, Diagnosis]] = {}
        finger.heard_s, finger.sample_s = time.monotonic(), float('-inf')
        self.subscribe(voltages)

    def subscribe(self, voltages: str) -> None:
        """Replace all subscriptions; ``voltages`` is the topic of the input, empty without one."""
        self.close()
        self.voltages, self._config = voltages, self.finger.config
        config, states = self._config, state_qos(depth=MOST_STATES)
        if voltages:
            self._subscribe_to_samples(voltages)
        envelope = f'{self.finger.name}/envelope'
        self.add(JointState, envelope, sensor_qos(), 'envelope', raw=True)
        slip = f'{self.finger.name.rpartition("/")[0]}/slip'
        self.add(Bool, slip, states, 'slip')
        self.add(Bool, f'{slip}_valid', states, 'slip_valid')
        for name in config.groups if config.publish_groups else ():
            self.add(Bool, f'{slip}/group/{name}', states, f'group/{name}')
        self.finger.groups[:] = False  # The last states come again, where they are published.

    def _subscribe_to_samples(self, voltages: str) -> None:
        """Subscribe to the input; if that fails, the finger is shown without volts."""
        self.finger.no_volts = ''
        try:
            self._input = Input(self._config)
            self.add(self._input.message_class, voltages, sensor_qos(), 'voltages', raw=True)
            truth = f'{voltages.rpartition("/")[0]}/slip_truth'
            self.add(Bool, truth, state_qos(depth=MOST_STATES), 'slip_truth')
        except (ValueError, *ROS_ERRORS):
            # A process can use a topic with one type only.
            words = 'is not installed here, or the topic had another type'
            self.finger.no_volts = f'no volts are shown: {self._config.input_type} {words}'

    def poll(self) -> None:
        """Process received messages; subscribe again if the detector's parameters require it."""
        before, self._config = self._config, self.finger.config
        if any(getattr(self._config, name) != getattr(before, name) for name in TOPIC_PARAMETERS):
            self.subscribe(self.voltages)
        finger, now_s = self.finger, time.monotonic()
        # Rows are taken first: the states that were published before them have arrived by then.
        volts, levels = self.take('voltages'), self.take('envelope')
        for message, info in self.take('slip'):
            self._slip.append((info['source_timestamp'], message.data))
            if message.data and not finger.slip:
                finger.onset_s = now_s
            finger.slip = message.data
        for message, info in self.take('slip_truth'):
            self._truth.append((info['source_timestamp'], message.data))
        for message, _ in self.take('slip_valid'):
            finger.valid, finger.heard_s = message.data, now_s
        for g, name in enumerate(self._config.groups):
            for message, _ in self.take(f'group/{name}'):
                finger.groups[g] = message.data
        self._append_samples(volts)
        self._append_levels(levels)

    def _fit_to_input(self, samples: Samples) -> None:
        """Find out from time to time which parameters fit the samples that come."""
        n, channels = samples.volts.shape
        self._messages.append((max(samples.stamps_ns.tolist()[-1:], default=0), n))
        if time.monotonic() - self._noted_s < FIT_PERIOD_S or not n:
            return
        stamps_ns, counts = np.array(self._messages).T
        rate_hz, before_hz = self._config.sample_rate_hz, self._rate_hz
        with contextlib.suppress(ValueError):  # Stamps that do not rise.
            rate_hz = measure_rate(stamps_ns, 'stamps') * float(np.mean(counts))
        # On a busy machine, or with several senders, each measurement gives another rate.
        if not rates_differ(rate_hz, before_hz) and len(self.senders) < 2:
            self.finger.to_fit = fitting(self.finger.config, channels, rate_hz, samples.names)
        self._messages, self._noted_s, self._rate_hz = [], time.monotonic(), rate_hz

    def _append_samples(self, messages: list[tuple[bytes, dict[str, Any]]]) -> None:
        """Append the samples of messages to the track."""
        received: list[tuple[int, Samples]] = []
        for raw, info in messages:
            try:
                samples, _ = self._input.read(raw, info)
                n, channels = samples.volts.shape
                self._fit_to_input(samples)
                if n and channels != (wanted := self._config.channels):
                    advice = self._input.advice(channels, wanted)
                    differ = f'they have {channels} channels, the detector {wanted}'
                    raise ValueError(f'{differ}{advice}')
                if n:
                    received.append((info['source_timestamp'], samples))
            except ValueError as error:
                # The detector counts and reports such messages, too.
                self.finger.unfit = time.monotonic(), f'samples come, but {error}'
        if not received:
            return
        first, *others = (samples for _, samples in received)
        counts = [len(samples.volts) for _, samples in received]
        truth = np.repeat([find_state(self._truth, at_ns) for at_ns, _ in received], counts)
        self.finger.frame_id = received[-1][1].frame_id
        self.finger.sample_s = time.monotonic()
        self.finger.track.add_samples(first.then(*others)._replace(truth=truth))

    def _append_levels(self, messages: list[tuple[bytes, dict[str, Any]]]) -> None:
        """Append the detector's levels and decisions to the track."""
        if not messages:
            return
        slip = np.array([find_state(self._slip, info['source_timestamp']) for _, info in messages])
        raws = [raw for raw, _ in messages]
        try:
            levels, decided = self._levels.read(raws), self._decisions.read(raws)
        except ValueError:  # the channels have just changed
            return
        channels_on = decided.volts > 0.0
        if levels.volts.shape == channels_on.shape == (len(messages), self._config.channels):
            # The detector has samples, even if their volts cannot be shown.
            self.finger.sample_s = time.monotonic()
            self.finger.track.add_levels(levels.stamps_ns, levels.volts, channels_on, slip)
