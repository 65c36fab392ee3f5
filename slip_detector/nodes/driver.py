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
from collections.abc import Iterator
from functools import partial

from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.nodes.messages import sensor_qos, state_qos
from slip_detector.nodes.parameters import declare
from slip_detector.nodes.scheduler import Scheduler
from slip_detector.nodes.sensor_relay import SensorRelay
from slip_detector.nodes.voltages import Voltages
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings.messages import JointStateWriter
from slip_detector.sources import Source, open_source

#: Number of samples that are read from the source at a time.
READ_ROWS = 32

#: Delay of a sample, in seconds, above which a warning is logged, at most once a second.
LATE_S = 0.05

#: Period, in seconds, at which the driver checks for the subscribers that it waits for.
POLL_S = 0.02

#: Period, in seconds, at which the driver checks whether everything has been played.
LOOK_S = 0.1

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
    scheduler
        The scheduler that all drivers of the process share, not started yet.
    cli_args
        ROS arguments for this node, which override those of the process.
    """

    def __init__(self, scheduler: Scheduler, cli_args: list[str] | None = None) -> None:
        super().__init__('slip_driver', cli_args=cli_args)
        self.config = config = declare(self, DriverConfig)
        source = open_source(config, now_ns=lambda: self.get_clock().now().nanoseconds)
        self._voltages = Voltages(self, config.frame_id, config.samples_per_message)
        self._truth = self.create_publisher(Bool, 'slip_truth', state_qos())
        self._position = self.create_publisher(JointState, 'platform_position', sensor_qos())
        self._has_object = source.has_object
        self._position_writer = JointStateWriter(
            config.frame_id, ['object' if source.has_object else 'platform']
        )
        self._grip_n: float | None = None
        if source.has_object:
            self.create_subscription(JointState, 'grip_force', self._on_grip_force, state_qos())
        self._last_truth: bool | None = None
        self._logged_s: dict[str, float] = {}  # by subject
        self._scheduler = scheduler
        if source.is_live:
            scheduler.add_thread(partial(self._listen_when_wanted, source))
        else:
            self.get_logger().info(
                f'playing {source.name}: {len(source.channel_names)} channels at '
                f'{source.sample_rate_hz:g} Hz, {config.rate:g} times real time'
            )
            scheduler.add_task(self._play_when_wanted(source))

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        self._scheduler.stop()
        super().destroy_node()

    def _on_grip_force(self, message: JointState) -> None:
        if len(message.effort) == 1:
            self._grip_n = message.effort[0]
        else:
            self._say('grip', f'grip_force has {len(message.effort)} efforts, allowed: 1; ignored')

    def _play_when_wanted(self, source: Source) -> Iterator[float]:
        """Play once the awaited subscribers exist; yields when to be resumed."""
        yield from self._wait_for_subscribers()
        yield from self._play(source)

    def _listen_when_wanted(self, source: Source, stop: threading.Event) -> None:
        for due_s in self._wait_for_subscribers():
            if stop.wait(max(0.0, due_s - time.monotonic())):
                return
        voltages, frame_id = self._voltages, self.config.frame_id
        SensorRelay(self, source, frame_id, voltages.publish, voltages.flush).run(stop)

    def _wait_for_subscribers(self) -> Iterator[float]:
        """Wait for the configured subscribers and the grip; yields when to be resumed."""
        if self.config.wait_for_subscribers:
            self.get_logger().info(f'waiting for {self.config.wait_for_subscribers} subscribers')
        while self._voltages.get_subscription_count() < self.config.wait_for_subscribers:
            yield time.monotonic() + POLL_S
        if self._has_object and self.config.wait_for_grip:
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
            self._say('pace', f'{late_s * 1e3:.0f} ms late: the pace cannot be kept')

    def _hold(self, source: Source, force_n: float) -> None:
        try:
            source.hold_force(force_n)
        except ValueError as error:
            self._say('grip', f'grip_force: {error}; ignored')

    def _say(self, about: str, what: str) -> None:
        """Log a warning, at most once a second about each subject."""
        now_s = time.monotonic()
        if now_s - self._logged_s.get(about, -1.0) >= 1.0:
            self._logged_s[about] = now_s
            self.get_logger().warning(what)


def drivers(arguments_of_each: list[list[str] | None]) -> list[Driver]:
    """Create the drivers of a process and start them.

    Parameters
    ----------
    arguments_of_each
        ROS arguments for each node.
    """
    scheduler = Scheduler()
    made = [Driver(scheduler, arguments) for arguments in arguments_of_each]

    def look_for_end() -> None:
        """End the spinning, from within the spinning thread, when everything has been played."""
        if scheduler.ended:
            raise ExternalShutdownException

    # The timer also wakes the executor if the wake-up by a signal was lost.
    made[0].create_timer(LOOK_S, look_for_end, clock=Clock(clock_type=ClockType.STEADY_TIME))
    scheduler.start()
    return made
