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

"""The node that sends samples to detector and relay and takes the times of their answers."""

import itertools
import threading
import time
from array import array
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from benchmarks.processes import processor_time_s
from slip_detector.nodes.messages import sensor_qos, time_message

#: The nodes that are compared, in the order of their turns.
NODES = ('detector', 'relay')

#: The volts of all channels at rest.
BASELINE_V = 4.3

#: Until both nodes have answered, the relay has to publish ON and OFF in turn, for this many
#: samples each.
CALL_SAMPLES = 20

#: Rest before the tone, in which late messages arrive.
REST_S = 0.5

#: Start of the tone that is not measured: filters settle and processes warm up.
WARM_UP_S = 1.0


class Meter(Node):
    """Sends the samples and keeps the answers of both nodes, with their times.

    Parameters
    ----------
    namespace
        Namespace of the three nodes; detector and relay each have their own within it.
    rows
        Volts of each sample of the tone.
    states
        What the relay has to publish on each sample.
    names
        Names of the channels.
    rate_hz
        Rate of the samples.
    pids
        Processes of the nodes, whose processor time is read.
    """

    def __init__(
        self,
        namespace: str,
        rows: Any,
        states: Any,
        names: tuple[str, ...],
        rate_hz: float,
        pids: dict[str, int],
    ) -> None:
        super().__init__('slip_meter', namespace=namespace)
        self._messages = [
            (array('d', row), array('d', [float(state)]))
            for row, state in zip(rows.tolist(), states.tolist(), strict=True)
        ]
        self._names = list(names)
        self._rate_hz = rate_hz
        self._pids = pids
        self._stop = threading.Event()
        self.connected = threading.Event()
        self.error: BaseException | None = None
        # By node: when each sample of the tone was sent, the changes received since the first
        # sample (time and state), and the processor time at both ends of the measured span.
        self.sent_ns: dict[str, list[int]] = {name: [] for name in NODES}
        self.received: dict[str, list[tuple[int, bool]]] = {name: [] for name in NODES}
        self.processor_times_s: dict[str, list[float]] = {name: [] for name in NODES}
        self.measured_s: list[float] = []
        self._answered = dict.fromkeys(NODES, False)
        self._voltages = [
            self.create_publisher(JointState, f'{name}/voltages', sensor_qos()) for name in NODES
        ]
        # A deeper queue than the nodes have: no change may be lost because this process is slow.
        every_state = QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        for name in NODES:
            self.create_subscription(Bool, f'{name}/slip', self._noter(name), every_state)
        self.create_subscription(Bool, 'detector/slip_valid', self._on_detector_valid, every_state)
        self.thread = threading.Thread(target=self._play_guarded, daemon=True)
        self.thread.start()

    def destroy_node(self) -> None:
        """Stop sending, then take the node down."""
        self._stop.set()
        self.thread.join()
        super().destroy_node()

    def _noter(self, name: str) -> Any:
        received = self.received[name]
        last = False

        def note(message: Bool) -> None:
            nonlocal last
            now_ns = time.time_ns()
            if message.data == last:  # A heartbeat.
                return
            last = message.data
            # A change received before the tone is an answer to the call, however late.
            if self.sent_ns[name]:
                received.append((now_ns, last))
            else:
                self._answer(name)

        return note

    def _on_detector_valid(self, message: Bool) -> None:
        # At rest ``slip`` stays OFF; but a first sample makes the channels valid.
        if message.data:
            self._answer('detector')

    def _answer(self, name: str) -> None:
        self._answered[name] = True
        if all(self._answered.values()):
            self.connected.set()

    def _play_guarded(self) -> None:
        try:
            self._play()
        except Exception as error:  # The main thread raises it.
            self.error = error

    def _play(self) -> None:
        """Send sample k to the one node at start + k / rate, to the other half a period later."""
        period_s = 1 / self._rate_hz
        start_s, start_ns = time.monotonic(), time.time_ns()
        # A constant input leaves the chain as it was, however much of it is lost.
        rest = array('d', [BASELINE_V] * len(self._names))
        rest_samples = round(REST_S * self._rate_hz)
        warm_up, end = round(WARM_UP_S * self._rate_hz), len(self._messages)
        tone_at: int | None = None
        for k in itertools.count():
            if tone_at is None and self.connected.is_set():
                tone_at = k + rest_samples
            if tone_at is None:
                position, effort = rest, array('d', [float(k // CALL_SAMPLES % 2)])
            elif k < tone_at:
                position, effort = rest, array('d', [0.0])
            elif k - tone_at < end:
                position, effort = self._messages[k - tone_at]
            if tone_at is not None and k - tone_at in (warm_up, end):
                for name, pid in self._pids.items():
                    self.processor_times_s[name].append(processor_time_s(pid))
                self.measured_s.append(time.monotonic())
                if k - tone_at == end:
                    return
            for i, name in enumerate(NODES):
                offset_s = (k + i / len(NODES)) * period_s
                if self._stop.wait(max(0.0, start_s + offset_s - time.monotonic())):
                    return
                header = Header(stamp=time_message(start_ns + round(offset_s * 1e9)))
                message = JointState(
                    header=header, name=self._names, position=position, effort=effort
                )
                if tone_at is not None and k >= tone_at:
                    self.sent_ns[name].append(time.time_ns())
                self._voltages[i].publish(message)
