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

"""The part of the driver that publishes the samples of a sensor."""

import threading
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from slip_detector.nodes.diagnostics import Diagnostics
from slip_detector.nodes.health import Level, Status
from slip_detector.sources import Source

#: Period, in seconds, of the reports on the sensor: on ``/diagnostics``, and in the log if
#: something was dropped or lost.
REPORT_S = 1.0

#: Counts that are not faults.
GOOD = ('packets', 'samples')


class SensorRelay:
    """Publishes each sample of a sensor as it arrives, and reports on the sensor.

    Parameters
    ----------
    node
        The node that publishes the diagnostics and writes the log.
    source
        A live source that has not been started.
    frame_id
        The sensor's frame, which names it in the diagnostics.
    send
        Publishes a sample, given its stamp in nanoseconds, the names of its channels and the
        volts.
    flush
        Publishes the samples of an incomplete message; called when the sensor is disconnected.
    """

    def __init__(
        self,
        node: Node,
        source: Source,
        frame_id: str,
        send: Callable[[int, list[str], NDArray[np.float64]], object],
        flush: Callable[[], None],
    ) -> None:
        self._node, self._source, self._frame_id = node, source, frame_id
        self._send, self._flush = send, flush
        self._logged_state = ''
        self._reported_counts: Counter[str] = Counter()
        self._reported_s = time.monotonic()

    def run(self, stop: threading.Event) -> None:
        """Publish samples until the event is set.

        Raises
        ------
        ValueError
            When the source cannot start with its parameters.
        """
        source, names = self._source, list(self._source.channel_names)
        source.start()
        diagnostics = Diagnostics(self._node)
        try:
            while not stop.is_set():
                self._log_state(source)
                if time.monotonic() - self._reported_s >= REPORT_S:
                    self._reported_s = time.monotonic()
                    diagnostics.publish([self._status(source)], self._frame_id)
                samples = source.read(1)
                for stamp_ns, row in zip(samples.stamps_ns.tolist(), samples.volts, strict=True):
                    self._send(stamp_ns, names, row)
        finally:
            source.close()

    def _log_state(self, source: Source) -> None:
        """Log when the sensor is connected or disconnected."""
        if source.state != self._logged_state:
            self._logged_state = source.state
            if source.connected:
                self._node.get_logger().info(source.state)
            else:
                self._flush()
                self._node.get_logger().warning(source.state)

    def _status(self, source: Source) -> Status:
        """Sum up the time since the last report; log what was dropped or lost."""
        since = source.counts - self._reported_counts
        self._reported_counts = source.counts.copy()
        status = sensor_status(source.state, source.connected, since)
        status.values = {kind: str(n) for kind, n in sorted(source.counts.items()) if n}
        if any(kind not in GOOD for kind in since):
            faults = {kind: n for kind, n in status.values.items() if kind not in GOOD}
            words = ', '.join(f'{kind} {n}' for kind, n in faults.items())
            self._node.get_logger().warning(f'counted so far: {words}')
        return status


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
