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

"""The driver node: plays a source in time, or passes on the samples of a sensor."""

import contextlib
import itertools
import math
import threading
import time
from array import array
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait

import numpy as np
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray, MultiArrayDimension, String

from slip_detector.chain.samples import Floats, Samples
from slip_detector.nodes.health import ERROR, WARN, Diagnostics, make_status
from slip_detector.nodes.messages import STEADY, sensor_qos, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.parameters import DriverConfig
from slip_detector.recordings.messages import BATCH_LABELS, JointStateWriter
from slip_detector.sources import Source, open_source

#: Number of samples that are read from the source at a time.
READ_ROWS = 32

#: Delay of a sample, in seconds, above which a warning is logged.
LATE_S = 0.05

#: Longest time, in seconds, that a driver waits to begin together with others.
ALIGNED_S = 0.1

#: Period, in seconds, at which the driver checks for the subscribers that it waits for.
POLL_S = 0.02

#: Period, in seconds, at which the driver checks whether everything has been played.
CHECK_S = 0.1

#: Period, in seconds, of the reports on a sensor (on ``/diagnostics``, and in the log if something
#: was dropped or lost), and shortest time between two warnings of the same event.
REPORT_S = 1.0

#: Counts of a sensor that are not faults.
NO_FAULTS = ('packets', 'samples')

#: Time, in seconds, for which a driver stays after the last sample, so that subscribers receive
#: the sample; shorter than the input timeout of a detector, which would report silence.
LINGER_S = 0.2

#: Longest time, in seconds, for which the end of a thread that plays is waited for: a thread that
#: compiles or loads code does not see that it is to stop, but publishes nothing.
STOP_S = 0.3


class Driver(Node):
    """Publishes each sample when it is due, however late the samples before it were.

    Sample k is due at start + k / rate, or at its own time if the source gives the times of its
    samples (a recording may have gaps and another rate).

    A scene with an object takes the grip force from ``grip_force``, a scene with the part
    ``orders`` takes orders from ``scene_order``. Each of its samples is computed only when it is
    due, so that it depends on all commands up to then.

    The samples of a sensor (serial, udp) are published as they arrive.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('slip_driver', cli_args=cli_args)
        self.config = config = declare(self, DriverConfig)
        clock = self.get_clock()
        self.source = source = open_source(config, now_ns=lambda: clock.now().nanoseconds)
        message_type = JointState if config.samples_per_message == 1 else Float32MultiArray
        self._voltages = self.create_publisher(message_type, 'voltages', sensor_qos())
        self._writer = JointStateWriter(config.frame_id, source.channel_names)
        # Samples that wait for their batch.
        self._rows: list[Floats] = []
        self._truth = self.create_publisher(Bool, 'slip_truth', state_qos())
        self._last_truth: bool | None = None
        self._position = self.create_publisher(JointState, 'platform_position', sensor_qos())
        moving = 'object' if source.has_object else 'platform'
        self._position_writer = JointStateWriter(config.frame_id, [moving])
        # The last grip force or order, and the last one that the scene has obeyed.
        self._command: float | str | None = None
        self._obeyed: float | str | None = None
        if source.has_object:
            self.create_subscription(JointState, 'grip_force', self._on_grip_force, state_qos())
        if source.takes_orders:
            self.create_subscription(String, 'scene_order', self._on_order, state_qos())
        #: The work of the thread that publishes the samples, once it was started.
        self.runs: list[Future[None]] = []
        self._stop = threading.Event()
        if source.is_live:
            self._diagnostics = Diagnostics(self)
        else:
            what = f'{len(source.channel_names)} channels at {source.sample_rate_hz:g} Hz'
            words = f'playing {source.name}: {what}, {config.rate:g} times real time'
            self.get_logger().info(words)

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        self._stop.set()
        wait(self.runs, STOP_S)
        super().destroy_node()

    def _on_grip_force(self, message: JointState) -> None:
        if len(message.effort) == 1:
            self._command = message.effort[0]
        else:
            self._ignore(f'grip_force has {len(message.effort)} efforts, allowed: 1')

    def _on_order(self, message: String) -> None:
        self._command = message.data

    def _ignore(self, words: str) -> None:
        self.get_logger().warning(f'{words}; ignored', throttle_duration_sec=REPORT_S)

    def relay(self) -> None:
        """Publish the samples of a sensor as they arrive, until the node is destroyed."""
        self._wait_for_subscribers()
        source = self.source
        logged_state, reported_s, reported = '', time.monotonic(), Counter[str]()
        source.start()
        with contextlib.closing(source):
            while not self._stop.is_set():
                if source.state != logged_state:
                    logged_state = source.state
                    if source.connected:
                        self.get_logger().info(logged_state)
                    else:
                        self._publish_batch()
                        self.get_logger().warning(logged_state)
                if time.monotonic() - reported_s >= REPORT_S:
                    reported_s = time.monotonic()
                    self._report(source, source.counts - reported)
                    reported = source.counts.copy()
                samples = source.read(1)
                for stamp_ns, row in zip(samples.stamps_ns.tolist(), samples.volts, strict=True):
                    self._publish_row(stamp_ns, row)

    def _report(self, source: Source, since: Counter[str]) -> None:
        """Publish the state of the sensor; log what was dropped or lost since the last report."""
        complaints = []
        if not source.connected:
            complaints.append((ERROR, source.state))
        elif not since['samples']:
            complaints.append((ERROR, f'no samples come; {source.state}'))
        values = {event: str(n) for event, n in sorted(source.counts.items()) if n}
        faults = [f'{event} {n}' for event, n in sorted(since.items()) if event not in NO_FAULTS]
        if faults:
            complaints.append((WARN, f'dropped or lost in the last second: {", ".join(faults)}'))
            so_far = ', '.join(map(' '.join, values.items()))
            self.get_logger().warning(f'counted so far: {so_far}')
        sensor = make_status('sensor', source.state, complaints, values)
        self._diagnostics.publish([sensor], self.config.frame_id)

    def _wait_for_subscribers(self) -> None:
        """Wait for the configured subscribers and the grip."""
        if self.config.wait_for_subscribers:
            self.get_logger().info(f'waiting for {self.config.wait_for_subscribers} subscribers')
        while self._voltages.get_subscription_count() < self.config.wait_for_subscribers:
            self._sleep(POLL_S)
        if self.source.has_object and self.config.wait_for_grip:
            self.get_logger().info('waiting for a grip force')
            while self._obeyed is None:
                self._sleep(POLL_S)
                self._obey(self.source)

    def play(self) -> None:
        """Play the source, repeatedly with ``loop``, until the node is destroyed."""
        self._wait_for_subscribers()
        source, config, start_s = self.source, self.config, 0.0
        obeys = source.has_object or source.takes_orders
        period_s = config.samples_per_message / (source.sample_rate_hz * config.rate)
        played = begin_ns = end_ns = first_stamp_ns = 0
        for repetition in itertools.count(1):
            self._obey(source)
            with contextlib.closing(source):
                while len((samples := source.read(1 if obeys else READ_ROWS)).stamps_ns):
                    if not played:  # After the first read, which opens the file and loads code.
                        now_s, now_ns = time.monotonic(), self.get_clock().now().nanoseconds
                        start_s = align(now_s, period_s)
                        # The stamps are the samples' own times, from this time of the clock on.
                        first_stamp_ns = now_ns + round((start_s - now_s) * 1e9)
                    for i, sample_ns in enumerate((begin_ns + samples.stamps_ns).tolist()):
                        # Of a batch only the last sample is waited for: waking up costs most.
                        if len(self._rows) + 1 >= config.samples_per_message:
                            self._wait_until(start_s + sample_ns * 1e-9 / config.rate)
                        self._publish(samples, i, first_stamp_ns + sample_ns)
                        played, end_ns = played + 1, sample_ns
                    end_ns += round(1e9 / source.sample_rate_hz)
                    if obeys:
                        self._wait_until(start_s + end_ns * 1e-9 / config.rate)
                        self._obey(source)
            if source.damage and repetition == 1:
                self.get_logger().warning(f'{source.name}: {source.damage}')
            if not config.loop:
                break
            source, begin_ns, self._obeyed = open_source(config, repetition), end_ns, None
        self._publish_batch()
        self.get_logger().info(f'played all {played} samples')
        # When a publisher ends, subscribers lose the samples that they have not received.
        self._sleep(LINGER_S)

    def _sleep(self, seconds: float) -> None:
        """Wait, if the time is not negative; end this thread if the node is destroyed."""
        if self._stop.wait(max(0.0, seconds)):
            raise ExternalShutdownException

    def _wait_until(self, due_s: float) -> None:
        """Wait until a sample is due; warn if the wait has ended much later."""
        self._sleep(due_s - time.monotonic())
        late_s = time.monotonic() - due_s
        if late_s > LATE_S:
            words = f'{late_s * 1e3:.0f} ms late: the pace cannot be kept'
            self.get_logger().warning(words, throttle_duration_sec=REPORT_S)

    def _obey(self, source: Source) -> None:
        """Let the scene obey the last command, if it is a new one."""
        command = self._command
        if command is None or command == self._obeyed:
            return
        try:
            source.obey(command)
            self._obeyed = command
        except ValueError as error:
            self._ignore(f'{"scene_order" if source.takes_orders else "grip_force"}: {error}')

    def _publish(self, samples: Samples, i: int, stamp_ns: int) -> None:
        """Publish sample ``i`` with its truth and position, if it has them."""
        # Also in a bag a truth applies to the samples after it, so the truth comes first.
        if samples.truth is not None and bool(samples.truth[i]) != self._last_truth:
            self._last_truth = bool(samples.truth[i])
            self._truth.publish(Bool(data=self._last_truth))
        self._publish_row(stamp_ns, samples.volts[i])
        if samples.position_m is not None:
            position_m = samples.position_m[i : i + 1]
            self._position.publish(self._position_writer.serialize(stamp_ns, position_m))

    def _publish_row(self, stamp_ns: int, volts: Floats) -> None:
        """Publish a sample, or keep it until its batch is complete."""
        if self.config.samples_per_message == 1:
            self._voltages.publish(self._writer.serialize(stamp_ns, volts))
            return
        self._rows.append(volts)
        if len(self._rows) == self.config.samples_per_message:
            self._publish_batch()

    def _publish_batch(self) -> None:
        """Publish the samples kept so far, however few, without stamp and names."""
        if not self._rows:
            return
        rows, self._rows = np.array(self._rows, np.float32), []
        message = Float32MultiArray(data=array('f', rows.tobytes()))
        dimensions = zip(BATCH_LABELS, rows.shape, (rows.size, rows.shape[1]), strict=True)
        message.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=stride)
            for label, size, stride in dimensions
        ]
        self._voltages.publish(message)


def align(now_s: float, period_s: float) -> float:
    """Return when to begin with periodic messages: soon, and all drivers at the same moments.

    The detectors of all fingers then wake up once for all; with rare messages that saves nothing.
    """
    period_s = min(period_s, ALIGNED_S)
    return math.ceil(now_s / period_s) * period_s


def play_all(nodes: Sequence[Driver]) -> None:
    """Let the drivers of a process publish, each in a thread of its own.

    The main thread spins the nodes.
    """
    threads = ThreadPoolExecutor(len(nodes))
    for node in nodes:
        node.runs.append(threads.submit(node.relay if node.source.is_live else node.play))
    runs = [run for node in nodes for run in node.runs]

    def check() -> None:
        """Raise the exception of a thread; end the spinning when everything has been played."""
        ended, playing = wait(runs, 0.0)
        for run in ended:
            run.result()
        if not playing:
            raise ExternalShutdownException

    nodes[0].create_timer(CHECK_S, check, clock=STEADY)
