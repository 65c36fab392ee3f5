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

import math
import threading
import time
from array import array
from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray, MultiArrayDimension

from slip_detector.chain.samples import Samples
from slip_detector.nodes.health import Diagnostics, Level, Status
from slip_detector.nodes.messages import sensor_qos, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings.messages import BATCH_LABELS, JointStateWriter
from slip_detector.sources import Source, open_source

#: Number of samples that are read from the source at a time.
READ_ROWS = 32

#: Delay of a sample, in seconds, above which a warning is logged.
LATE_S = 0.05

#: Shortest time, in seconds, between two warnings of a kind.
LOG_S = 1.0

#: Period, in seconds, at which the driver checks for the subscribers that it waits for.
POLL_S = 0.02

#: Period, in seconds, at which the driver checks whether everything has been played.
LOOK_S = 0.1

#: Period, in seconds, of the reports on a sensor: on ``/diagnostics``, and in the log if something
#: was dropped or lost.
REPORT_S = 1.0

#: Counts of a sensor that are not faults.
GOOD = ('packets', 'samples')

#: Time, in seconds, for which a driver stays after the last sample, so that subscribers receive
#: it; shorter than the input timeout of a detector, which would report silence.
LINGER_S = 0.2


class Driver(Node):
    """Publishes each sample when it is due, however late the samples before it were.

    Sample k is due at start + k / rate, or at its own time if the source gives the times of its
    samples (its clock may be wrong, and samples may be lost).

    A scene with an object takes the grip force from ``grip_force``. Each of its samples is
    computed only when it is due, so that it depends on all commands up to then.

    The samples of a sensor (serial, udp) are published as they arrive.

    Parameters
    ----------
    cli_args
        ROS arguments for this node, which override those of the process.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('slip_driver', cli_args=cli_args)
        self.config = config = declare(self, DriverConfig)
        self.source = source = open_source(
            config, now_ns=lambda: self.get_clock().now().nanoseconds
        )
        self._voltages = Voltages(self, config.frame_id, config.samples_per_message)
        self._truth = self.create_publisher(Bool, 'slip_truth', state_qos())
        self._position = self.create_publisher(JointState, 'platform_position', sensor_qos())
        self._position_writer = JointStateWriter(
            config.frame_id, ['object' if source.has_object else 'platform']
        )
        self._grip_n: float | None = None
        if source.has_object:
            self.create_subscription(JointState, 'grip_force', self._on_grip_force, state_qos())
        self._last_truth: bool | None = None
        #: The threads that publish the samples, once they run.
        self.playing: Playing | None = None
        if source.is_live:
            self._diagnostics = Diagnostics(self)
        else:
            self.get_logger().info(
                f'playing {source.name}: {len(source.channel_names)} channels at '
                f'{source.sample_rate_hz:g} Hz, {config.rate:g} times real time'
            )

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        if self.playing is not None:
            self.playing.end()
        super().destroy_node()

    def _on_grip_force(self, message: JointState) -> None:
        if len(message.effort) == 1:
            self._grip_n = message.effort[0]
        else:
            self.get_logger().warning(
                f'grip_force has {len(message.effort)} efforts, allowed: 1; ignored',
                throttle_duration_sec=LOG_S,
            )

    def play(self) -> Iterator[float]:
        """Play once the awaited subscribers exist; yields when to be resumed."""
        yield from self._wait_for_subscribers()
        yield from self._play(self.source)

    def relay(self, stop: threading.Event) -> None:
        """Publish the samples of a sensor as they arrive, until the event is set."""
        for due_s in self._wait_for_subscribers():
            if stop.wait(max(0.0, due_s - time.monotonic())):
                return
        source, names = self.source, list(self.source.channel_names)
        logged_state, reported_s, reported = '', time.monotonic(), Counter[str]()
        source.start()
        try:
            while not stop.is_set():
                if source.state != logged_state:
                    logged_state = source.state
                    self._log_state(source)
                if time.monotonic() - reported_s >= REPORT_S:
                    reported_s = time.monotonic()
                    self._report(source, source.counts - reported)
                    reported = source.counts.copy()
                samples = source.read(1)
                for stamp_ns, row in zip(samples.stamps_ns.tolist(), samples.volts, strict=True):
                    self._voltages.publish(stamp_ns, names, row)
        finally:
            source.close()

    def _log_state(self, source: Source) -> None:
        """Log that the sensor was connected or disconnected."""
        if source.connected:
            self.get_logger().info(source.state)
        else:
            self._voltages.flush()
            self.get_logger().warning(source.state)

    def _report(self, source: Source, since: Counter[str]) -> None:
        """Publish the state of the sensor; log what was dropped or lost since the last report."""
        status = sensor_status(source.state, source.connected, since)
        status.values = {kind: str(n) for kind, n in sorted(source.counts.items()) if n}
        if any(kind not in GOOD for kind in since):
            faults = ', '.join(f'{k} {n}' for k, n in status.values.items() if k not in GOOD)
            self.get_logger().warning(f'counted so far: {faults}')
        self._diagnostics.publish([status], self.config.frame_id)

    def _wait_for_subscribers(self) -> Iterator[float]:
        """Wait for the configured subscribers and the grip; yields when to be resumed."""
        if self.config.wait_for_subscribers:
            self.get_logger().info(f'waiting for {self.config.wait_for_subscribers} subscribers')
        while self._voltages.get_subscription_count() < self.config.wait_for_subscribers:
            yield time.monotonic() + POLL_S
        if self.source.has_object and self.config.wait_for_grip:
            self.get_logger().info('waiting for a grip force')
            while self._grip_n is None:
                yield time.monotonic() + POLL_S

    def _play(self, source: Source) -> Iterator[float]:
        """Play the source, repeatedly with ``loop``; yields when to be resumed."""
        # The first read opens the file and loads compiled code, so it comes before the start.
        ahead = None if source.has_object else source.read(READ_ROWS)
        # The samples of all drivers with the same rate are due at the same moments, so that the
        # detectors wake up once for all fingers.
        now_s, now_ns = self._moment()
        period_s = self.config.samples_per_message / (source.sample_rate_hz * self.config.rate)
        start_s = math.ceil(now_s / period_s) * period_s
        # The stamps are the samples' own times, from this time of the node's clock on.
        first_stamp_ns = now_ns + round((start_s - now_s) * 1e9)
        played = 0
        repetition = 0
        begin_ns = end_ns = 0
        gripped_n: float | None = None
        while True:
            if source.has_object:
                yield from self._wait(start_s + end_ns * 1e-9 / self.config.rate)
                if self._grip_n is not None and self._grip_n != gripped_n:
                    gripped_n = self._grip_n
                    self._hold(source, gripped_n)
            samples = ahead or source.read(1 if source.has_object else READ_ROWS)
            ahead = None
            n = len(samples.volts)
            if n:
                taken_ns = (begin_ns + samples.stamps_ns).tolist()
                yield from self._publish(source, samples, taken_ns, start_s, first_stamp_ns)
                played += n
                end_ns = taken_ns[-1] + round(1e9 / source.sample_rate_hz)
                continue
            if source.damage and not repetition:
                self.get_logger().warning(f'{source.name}: {source.damage}')
            if not self.config.loop:
                self._voltages.flush()
                break
            repetition += 1
            begin_ns = end_ns
            source = open_source(self.config, repetition)
            gripped_n = None
        self.get_logger().info(f'played all {played} samples')
        # A subscriber loses samples that it has not received when their publisher ends.
        yield time.monotonic() + LINGER_S

    def _moment(self) -> tuple[float, int]:
        """Return one moment on the clock of :func:`time.monotonic` and, in ns, on the node's.

        As the thread may be held up between the two readings, the quickest of some tries is taken.
        """

        def read() -> tuple[float, float, int]:
            before_s, now_ns = time.monotonic(), self.get_clock().now().nanoseconds
            after_s = time.monotonic()
            return after_s - before_s, (before_s + after_s) / 2, now_ns

        return min(read() for _ in range(5))[1:]

    def _publish(
        self,
        source: Source,
        samples: Samples,
        taken_ns: list[int],
        start_s: float,
        first_stamp_ns: int,
    ) -> Iterator[float]:
        """Publish each sample when it is due; yields when to be resumed."""
        names = list(source.channel_names)
        for i, volts in enumerate(samples.volts):
            due_s = start_s + taken_ns[i] * 1e-9 / self.config.rate
            # Within a batch only the last sample is waited for: waking up costs most.
            if self._voltages.completed_by_next:
                yield from self._wait(due_s)
            # The truth applies to the samples that follow it, also in a bag, so it comes first.
            if samples.truth is not None and bool(samples.truth[i]) != self._last_truth:
                self._last_truth = bool(samples.truth[i])
                self._truth.publish(Bool(data=self._last_truth))
            stamp_ns = first_stamp_ns + taken_ns[i]
            self._voltages.publish(stamp_ns, names, volts)
            if samples.position_m is not None:
                self._position.publish(
                    self._position_writer.written(stamp_ns, samples.position_m[i : i + 1])
                )

    def _wait(self, due_s: float) -> Iterator[float]:
        """Yield the time at which a sample is due; warn if the driver is resumed much later."""
        yield due_s
        late_s = time.monotonic() - due_s
        if late_s > LATE_S:
            self.get_logger().warning(
                f'{late_s * 1e3:.0f} ms late: the pace cannot be kept',
                throttle_duration_sec=LOG_S,
            )

    def _hold(self, source: Source, force_n: float) -> None:
        try:
            source.hold_force(force_n)
        except ValueError as error:
            self.get_logger().warning(f'grip_force: {error}; ignored', throttle_duration_sec=LOG_S)


class Playing:
    """The threads in which drivers publish; the main thread spins their nodes.

    Samples of several drivers that are due at the same moment are published one after the other by
    one thread: waking a thread for each driver would cost more than publishing its message. Each
    sensor has a thread of its own.
    """

    def __init__(self, nodes: list[Driver]) -> None:
        self._stop = threading.Event()
        self._failure: Exception | None = None
        runs: list[Callable[[threading.Event], None]]
        runs = [node.relay for node in nodes if node.source.is_live]
        played = [node.play() for node in nodes if not node.source.is_live]
        if played:
            runs.append(lambda stop: play_in_turn(played, stop))
        self._threads = [threading.Thread(target=self._run, args=(run,)) for run in runs]
        for thread in self._threads:
            thread.daemon = True
            thread.start()

    def _run(self, run: Callable[[threading.Event], None]) -> None:
        try:
            run(self._stop)
        except Exception as failure:
            self._failure = failure

    def end(self) -> None:
        """Stop all threads and wait until they have ended."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def check(self) -> None:
        """Raise the exception of a thread; ExternalShutdownException if all have ended."""
        if self._failure is not None:
            raise self._failure
        if not any(thread.is_alive() for thread in self._threads):
            raise ExternalShutdownException


def play_in_turn(tasks: list[Iterator[float]], stop: threading.Event) -> None:
    """Resume each task at the times, of :func:`time.monotonic`, that it yields.

    Examples
    --------
    >>> done = []
    >>> def task(name, *due_s):
    ...     for moment_s in due_s:
    ...         yield moment_s
    ...         done.append(name)
    >>> play_in_turn([task('a', 1e-3, 3e-3), task('b', 2e-3)], threading.Event())
    >>> done
    ['a', 'b', 'a']
    """
    # All tasks are asked for their first time before any of them is resumed.
    due_s = {task: next(task, math.inf) for task in tasks}
    while (task := min(due_s, key=due_s.__getitem__)) and due_s[task] < math.inf:
        if stop.wait(max(0.0, due_s[task] - time.monotonic())):
            return
        due_s[task] = next(task, math.inf)


class Voltages:
    """Publishes samples on ``voltages``.

    Parameters
    ----------
    node
        The driver.
    frame_id
        Frame of the messages, if their type has one.
    samples_per_message
        1: each sample is a ``JointState`` with stamp and names. More: this many samples are a
        ``Float32MultiArray``, which has neither.
    """

    def __init__(self, node: Node, frame_id: str, samples_per_message: int) -> None:
        self._frame_id, self._per_message = frame_id, samples_per_message
        self._names: list[str] = []
        self._writer: JointStateWriter | None = None
        self._rows: list[NDArray[np.float64]] = []
        self._publisher = node.create_publisher(
            JointState if samples_per_message == 1 else Float32MultiArray,
            'voltages',
            sensor_qos(),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )

    def get_subscription_count(self) -> int:
        """Return the number of subscribers."""
        return int(self._publisher.get_subscription_count())

    @property
    def completed_by_next(self) -> bool:
        """Whether the next sample completes a message, which is then published at once."""
        return len(self._rows) + 1 >= self._per_message

    def publish(self, stamp_ns: int, names: list[str], volts: NDArray[np.float64]) -> None:
        """Publish a sample, or keep it until its message is complete."""
        if self._per_message > 1:
            self._rows.append(volts)
            if len(self._rows) == self._per_message:
                self.flush()
            return
        if self._writer is None or names != self._names:
            self._names = names
            self._writer = JointStateWriter(self._frame_id, names)
        self._publisher.publish(self._writer.written(stamp_ns, volts))

    def flush(self) -> None:
        """Publish the samples kept so far, however few."""
        if not self._rows:
            return
        rows = np.array(self._rows, np.float32)
        self._rows = []
        message = Float32MultiArray(data=array('f', rows.tobytes()))
        samples, channels = rows.shape
        strides = (samples * channels, channels)
        message.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=stride)
            for label, size, stride in zip(BATCH_LABELS, rows.shape, strides, strict=True)
        ]
        self._publisher.publish(message)


def sensor_status(state: str, connected: bool, since: Counter[str]) -> Status:
    """Return the line of the diagnostics on a sensor.

    Parameters
    ----------
    state, connected
        Attributes of :class:`.Source`: how the sensor is connected, or why not; and whether it is.
    since
        Counts since the last report.

    Examples
    --------
    >>> state = 'listening to /dev/ttyACM0 at 115200 baud'
    >>> sensor_status(state, True, Counter(samples=380, checksum=2)).message
    'dropped or lost in the last second: checksum 2'
    """
    status = Status('sensor', all_well=state)
    if not connected:
        status.complain(Level.ERROR, state)
    elif not since['samples']:
        status.complain(Level.ERROR, f'no samples come; {state}')
    faults = ', '.join(f'{kind} {n}' for kind, n in sorted(since.items()) if kind not in GOOD)
    if faults:
        status.complain(Level.WARN, f'dropped or lost in the last second: {faults}')
    return status


def drivers(arguments_of_each: list[list[str] | None]) -> list[Driver]:
    """Create the drivers of a process, each with its ROS arguments, and start them."""
    made = [Driver(arguments) for arguments in arguments_of_each]
    playing = Playing(made)
    for node in made:
        node.playing = playing
    # Ends the spinning, from within the spinning thread, when everything has been played.
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    made[0].create_timer(LOOK_S, playing.check, clock=steady)
    return made
