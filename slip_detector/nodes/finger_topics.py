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
import functools
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.nodes.inputs import Input
from slip_detector.nodes.joint_states import Sample, read_joint_states
from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.nodes.polled_topics import PolledTopics
from slip_detector.nodes.rclpy_internals import ROS_ERROR
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fields import names_that_affect
from slip_detector.view.detectors import Finger

#: Parameters on which the subscriptions depend.
OF_TOPICS = names_that_affect(DetectorConfig, 'display')

#: Most changes of a state that wait, in a queue until they are taken, and then for their rows.
STATES = 1000


class Topics(NamedTuple):
    """The topics on which a detector and its sensor publish.

    Attributes
    ----------
    namespace : str
        Namespace of the decisions, without a slash at the end.
    voltages, truth, envelope : str
        Full names; ``voltages`` is empty while the detector has no input.
    """

    namespace: str
    voltages: str
    truth: str
    envelope: str


class States:
    """Finds the state that belongs to each row of a stream, such as slip to levels.

    States and rows are published by the same process, so a row has the last state that was
    published before it. A busy detector publishes levels late, after the decisions on the next
    samples: then a change is found a few rows early.

    Examples
    --------
    >>> slip = States()
    >>> slip.change(True, 25)
    >>> slip.beside([10, 20, 30, 40]).tolist(), slip.now
    ([False, False, True, True], True)
    """

    def __init__(self) -> None:
        self.now = False
        self._before = False
        self._changes: list[tuple[int, bool]] = []

    def change(self, state: bool, published_ns: int) -> None:
        """Note a state, which may be the same as before."""
        if state != self.now:
            self._changes.append((published_ns, state))
        self.now = state
        if len(self._changes) > STATES:  # There have been no rows.
            self._before = self._changes.pop(0)[1]

    def beside(self, published_ns: Iterable[int]) -> NDArray[np.bool_]:
        """Return the state of each row; later changes are kept for the next rows."""
        rows_ns = np.fromiter(published_ns, np.int64)
        if not self._changes:
            return np.full(len(rows_ns), self._before)
        times_ns = np.array([at_ns for at_ns, _ in self._changes])
        states = np.array([self._before, *(state for _, state in self._changes)])
        found: NDArray[np.bool_] = states[np.searchsorted(times_ns, rows_ns, side='right')]
        if len(rows_ns):
            past = int(np.searchsorted(times_ns, rows_ns[-1], side='right'))
            self._before = bool(states[past])
            del self._changes[:past]
        return found


class FingerTopics:
    """Subscribes to the topics of a finger, and keeps the finger up to date.

    Parameters
    ----------
    node
        The node that subscribes.
    finger
        The finger.
    names
        Its topics.
    """

    def __init__(self, node: Node, finger: Finger, names: Topics) -> None:
        self._finger = finger
        self._topics = PolledTopics(node)
        self._samples: list[tuple[int, Sample]] = []
        self._levels: list[tuple[int, bytes]] = []
        self._slip, self._truth = States(), States()
        finger.heard_s, finger.sample_s = time.monotonic(), float('-inf')
        self.subscribe(names)

    def subscribe(self, names: Topics) -> None:
        """Replace all subscriptions by those to these topics."""
        self._topics.close()
        self.names, self._config = names, self._finger.config
        config, topics, states = self._config, self._topics, state_qos(depth=STATES)
        if names.voltages:
            self._subscribe_to_samples(names)
        topics.add(JointState, names.envelope, sensor_qos(), self._on_envelope, raw=True)
        slip = f'{names.namespace}/slip'
        topics.add(Bool, slip, states, self._on_slip)
        topics.add(Bool, f'{slip}_valid', states, self._on_slip_valid)
        topics.add(Header, f'{slip}_onset', event_qos(), self._on_onset)
        if config.publish_groups:
            for g, name in enumerate(config.groups):
                topics.add(Bool, f'{slip}/group/{name}', states, self._on_group(g))
        else:
            self._finger.groups[:] = False  # No message will change their last states.

    def _subscribe_to_samples(self, names: Topics) -> None:
        """Subscribe to the input; if that fails, the finger is shown without volts."""
        kind, self._finger.no_volts = self._config.input_type, ''
        try:
            source = Input(self._config)
        except ValueError:
            self._finger.no_volts = f'no volts are shown: {kind} is not installed here'
            return
        take = functools.partial(self._on_voltages, source)
        try:
            self._topics.add(source.message_class, names.voltages, sensor_qos(), take, raw=True)
        except ROS_ERROR:
            # A process can use a topic with one type only.
            self._finger.no_volts = (
                f'no volts are shown: {names.voltages} was of a type other than {kind}'
            )
            return
        self._topics.add(Bool, names.truth, state_qos(depth=STATES), self._on_truth)

    def close(self) -> None:
        """End the subscriptions."""
        self._topics.close()

    def poll(self) -> None:
        """Process received messages; subscribe again if the detector's parameters require it."""
        before, config = self._config, self._finger.config
        if config is not before:
            self._config = config
            if any(getattr(config, name) != getattr(before, name) for name in OF_TOPICS):
                self.subscribe(self.names)
        self._topics.poll()
        if self._samples:
            self._keep_samples()
        if self._levels:
            self._keep_levels()

    def _on_voltages(self, source: Input, raw: bytes, info: dict[str, Any]) -> None:
        # A message that does not fit is counted and reported by the detector.
        with contextlib.suppress(ValueError):
            sample = source.read(raw, info)
            n, channels = sample.rows.shape
            if n and channels == self._config.channels:
                self._samples.append((info['source_timestamp'], sample))

    def _on_truth(self, message: Bool, info: dict[str, Any]) -> None:
        self._truth.change(message.data, info['source_timestamp'])

    def _on_envelope(self, raw: bytes, info: dict[str, Any]) -> None:
        self._levels.append((info['source_timestamp'], raw))

    def _on_slip(self, message: Bool, info: dict[str, Any]) -> None:
        self._slip.change(message.data, info['source_timestamp'])
        self._finger.slip = message.data

    def _on_slip_valid(self, message: Bool) -> None:
        self._finger.valid = message.data
        self._finger.heard_s = time.monotonic()

    def _on_onset(self, message: Header) -> None:
        self._finger.onset_s = time.monotonic()

    def _on_group(self, g: int) -> Any:
        def take(message: Bool) -> None:
            self._finger.groups[g] = message.data

        return take

    def _keep_samples(self) -> None:
        """Append the samples to the track."""
        period_ns = 1e9 / self._config.sample_rate_hz
        counts = [len(sample.rows) for _, sample in self._samples]
        rows = np.concatenate([sample.rows for _, sample in self._samples])
        last_ns = np.array([sample.stamp_ns or 0 for _, sample in self._samples], np.int64)
        published_ns = [at_ns for at_ns, _ in self._samples]
        truth = self._truth.beside(published_ns)
        if len(rows) > len(counts):
            # The stamp of a batch is that of its last row.
            behind = np.concatenate([np.arange(n)[::-1] for n in counts])
            last_ns = np.repeat(last_ns, counts) - np.round(behind * period_ns).astype(np.int64)
            truth = np.repeat(truth, counts)
        self._finger.frame_id = self._samples[-1][1].frame_id
        self._finger.sample_s = time.monotonic()
        self._samples = []
        self._finger.track.add_samples(last_ns, rows, truth)

    def _keep_levels(self) -> None:
        """Append the detector's levels and decisions to the track."""
        taken, self._levels = self._levels, []
        read = read_joint_states([raw for _, raw in taken], self._config.channels)
        slip = self._slip.beside(at_ns for at_ns, _ in taken)
        # If the number of channels has just changed, some messages were not read: drop all.
        if len(read.stamps_ns) == len(taken):
            self._finger.track.add_levels(read.stamps_ns, read.position, read.effort > 0.0, slip)
