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
"""The detector node against a bare relay node, for ``python -m benchmarks soak``.

There are three processes: the detector as it ships, a relay that runs no chain, and a meter that
sends the samples and receives ``slip`` from both. How they are compared, and why:

- The two nodes take turns within each sample period: sample k goes to the detector when it is due
  and to the relay half a period later, with the same content. Other load of the machine
  affects both alike, and neither works while the other does.
- The relay publishes a Bool on those samples on which the detector publishes a change, not on
  every sample: a Bool for every sample would cost the relay more than the chain costs the detector
  and make the ratio look better. What the relay has to publish is in ``effort`` of the messages to
  both nodes; the detector does not read that field. So the relay is the least that a node can do
  for the same input and output, and the detector's heartbeat, ``slip_valid`` and ``slip_onset``
  count against the detector.
- The detector has all topics and the chain that it ships with, but short windows and a
  threshold at which a tone within the band toggles ``slip`` about fifty times a second. Only one
  channel toggles, and its group with it, while the others of the group stay ON and all other
  channels OFF: so a change of ``slip`` brings one message on ``slip/group/*`` and one on
  ``slip/channel/*``, not twenty.
- The k-th change received belongs to the sample of the k-th change of the same chain, run offline
  on the same rows. Latency counts from just before that sample is given to ``publish``, not from
  its stamp: the meter is late by the same time for both, which would only bring the ratio closer
  to one.
- Processor time is the user and system time of the whole process over the measured span.
"""

import itertools
import os
import sys
import threading
import time
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from benchmarks.processes import nodes_running, processor_time_s, spin_until
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.nodes.messages import sensor_qos, time_message
from slip_detector.parameters.detector import DetectorConfig

#: The parameters of the detector that differ from the defaults.
PARAMETERS = {'envelope_window_s': 0.008, 'decision_window_s': 0.008, 'threshold': 1.0}

BASELINE_V, NOISE_V, TONE_HZ, TOGGLING_V = 4.3, 1e-4, 12.0, 0.02
#: A tone of this amplitude is below the threshold only near its zero crossings, for a shorter time
#: than the windows.
STAYING_ON_V = 2.0

#: Until both nodes have answered, the relay has to publish ON and OFF in turn, for this many
#: samples each; then there is rest, in which late messages arrive; the begin of the tone is not
#: measured, as filters settle and processes warm up.
CALL_SAMPLES, REST_S, WARM_UP_S = 20, 0.5, 1.0

START_TIMEOUT_S, DRAIN_TIMEOUT_S = 300.0, 5.0

#: The nodes that are compared, in the order of their turns.
NODES = ('detector', 'relay')


class Meter(Node):
    """Sends the samples and keeps the changes of ``slip`` of both nodes, with their times."""

    def __init__(
        self, namespace: str, volts: NDArray[np.float64], slip: Any, config: DetectorConfig
    ) -> None:
        super().__init__('slip_meter', namespace=namespace)
        self._config = config
        self._samples = [
            (array('d', row), array('d', [state]))
            for row, state in zip(volts.tolist(), slip.tolist(), strict=True)
        ]
        self._answered: set[str] = set()
        # By node: when each sample of the tone was sent, and when each change was received.
        self.sent_ns: dict[str, list[int]] = {name: [] for name in NODES}
        self.received_ns: dict[str, list[int]] = {name: [] for name in NODES}
        self._last = dict.fromkeys(NODES, False)
        # A deeper queue than the nodes have: no change may be lost because this process is slow.
        every_state = QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        self._voltages = {}
        for name in NODES:
            self._voltages[name] = self.create_publisher(
                JointState, f'{name}/voltages', sensor_qos()
            )
            self.create_subscription(Bool, f'{name}/slip', self._on_slip(name), every_state)
        self.create_subscription(Bool, 'detector/slip_valid', self._on_valid, every_state)

    def _on_slip(self, name: str) -> Callable[[Bool], None]:
        def note(message: Bool) -> None:
            now_ns = time.time_ns()
            if message.data == self._last[name]:  # A heartbeat.
                return
            self._last[name] = message.data
            if self.sent_ns[name]:
                self.received_ns[name].append(now_ns)
            else:
                self._answered.add(name)

        return note

    def _on_valid(self, message: Bool) -> None:
        # At rest ``slip`` stays OFF; but a first sample makes the channels valid.
        if message.data:
            self._answered.add('detector')

    def play(self, on_span: Callable[[], None]) -> None:
        """Send sample k to the one node at start + k / rate, to the other half a period later.

        ``on_span`` is called at the begin and at the end of the measured span.
        """
        rate_hz = self._config.sample_rate_hz
        start_s, start_ns = time.monotonic(), time.time_ns()
        # A constant input leaves the chain as it was, however much of it is lost.
        rest = array('d', [BASELINE_V] * self._config.channels)
        tone_at: int | None = None
        for k in itertools.count():
            if tone_at is None and len(self._answered) == len(NODES):
                tone_at = k + round(REST_S * rate_hz)
            at = -1 if tone_at is None else k - tone_at
            if at in (round(WARM_UP_S * rate_hz), len(self._samples)):
                on_span()
            if at == len(self._samples) or not self.context.ok():
                return
            calls = tone_at is None and k // CALL_SAMPLES % 2
            position, effort = self._samples[at] if at >= 0 else (rest, array('d', [calls]))
            for i, name in enumerate(NODES):
                offset_s = (k + i / len(NODES)) / rate_hz
                time.sleep(max(0.0, start_s + offset_s - time.monotonic()))
                header = Header(stamp=time_message(start_ns + round(offset_s * 1e9)))
                message = JointState(
                    header=header, name=list(self._config.names), position=position, effort=effort
                )
                if at >= 0:
                    self.sent_ns[name].append(time.time_ns())
                self._voltages[name].publish(message)


def tone_v(config: DetectorConfig, rows: int) -> NDArray[np.float64]:
    """Return a tone that toggles one channel of the first group and keeps its others ON."""
    toggling, *staying_on = next(iter(config.groups.values()))
    amplitudes_v = np.zeros(config.channels)
    amplitudes_v[toggling - 1] = TOGGLING_V
    amplitudes_v[np.array(staying_on) - 1] = STAYING_ON_V
    tone = np.sin(2 * np.pi * TONE_HZ / config.sample_rate_hz * np.arange(rows))
    noise_v = NOISE_V * np.random.default_rng(0).standard_normal((rows, config.channels))
    return np.asarray(BASELINE_V + np.outer(tone, amplitudes_v) + noise_v)


def measure(seconds: float) -> dict[str, Any]:
    """Run detector, relay and meter; return the keys of ``relay``.

    Raises
    ------
    RuntimeError
        When a process ends too early, does not answer in time, or a change is lost.
    """
    config = DetectorConfig.from_parameters(PARAMETERS)
    rate_hz = config.sample_rate_hz
    warm_up = round(WARM_UP_S * rate_hz)
    volts = tone_v(config, warm_up + round(seconds * rate_hz))
    chain = SlipChain(config)
    chain.update(np.full((1, config.channels), BASELINE_V))
    slip = chain.update(volts).slip
    changes = np.flatnonzero(np.diff(slip, prepend=False))

    namespace = f'/slip_end_to_end_{os.getpid()}'
    modules = {'detector': 'slip_detector.nodes.run slip_detector'}
    modules['relay'] = 'benchmarks.soak.relay_node'
    commands = {}
    for name in NODES:
        ros = f'--ros-args --log-level warn -r __ns:={namespace}/{name}'
        commands[name] = [sys.executable, '-m', *modules[name].split(), *ros.split()]
    for name, value in PARAMETERS.items():
        commands['detector'] += ['-p', f'{name}:={value}']

    used_s: dict[str, list[float]] = {'meter': [], **{name: [] for name in NODES}}
    with nodes_running(commands) as processes:
        meter = Meter(namespace, volts, slip, config)

        def on_span() -> None:
            used_s['meter'].append(time.monotonic())
            for name, process in processes.items():
                used_s[name].append(processor_time_s(process.pid))

        thread = threading.Thread(target=meter.play, args=[on_span], daemon=True)
        thread.start()
        end_s = time.monotonic() + 2 * START_TIMEOUT_S + len(volts) / rate_hz
        received = meter.received_ns.values()
        spin_until(meter, processes, lambda: not thread.is_alive(), end_s, 'the tone')
        spin_until(
            meter, processes, lambda: min(map(len, received)) >= len(changes),
            time.monotonic() + DRAIN_TIMEOUT_S, 'changes of slip',
        )  # fmt: skip

    counted = changes >= warm_up
    result: dict[str, Any] = {'changes': int(counted.sum())}
    begin_s, end_s = used_s['meter']
    for name in NODES:
        sent_ns = np.array(meter.sent_ns[name])[changes]
        latencies_ms = (np.array(meter.received_ns[name]) - sent_ns)[counted] * 1e-6
        result[name] = {
            'median_ms': float(np.median(latencies_ms)),
            'cpu_percent': 100 * (used_s[name][1] - used_s[name][0]) / (end_s - begin_s),
        }
    for ratio, figure in (('latency_ratio', 'median_ms'), ('cpu_ratio', 'cpu_percent')):
        result[ratio] = result['detector'][figure] / result['relay'][figure]
    return result
