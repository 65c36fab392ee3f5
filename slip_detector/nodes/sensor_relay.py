"""The part of the driver that publishes what a sensor sends."""

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

#: How often it is said how the sensor is, on ``/diagnostics`` and, when something was dropped or
#: lost, on the log.
REPORT_S = 1.0

#: Counts of what is as it should be.
GOOD = ('packets', 'samples')


class SensorRelay:
    """Publishes each sample of a sensor as it comes, and reports on the sensor.

    Parameters
    ----------
    node
        Whose log and diagnostics it is.
    source
        A live one, not started yet.
    frame_id
        Of the sensor, in the diagnostics.
    send
        Takes the stamp of a sample in nanoseconds, the names of its channels and its volts.
    flush
        Sends what waits for more to come: the sensor has gone.
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
        """Listen until told to stop.

        Raises
        ------
        ValueError
            When a parameter does not allow it.
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
        """Say on the log when the sensor comes or goes."""
        if source.state != self._logged_state:
            self._logged_state = source.state
            if source.connected:
                self._node.get_logger().info(source.state)
            else:
                self._flush()
                self._node.get_logger().warning(source.state)

    def _status(self, source: Source) -> Status:
        """Sum up what came since the last time; say on the log what was dropped or lost."""
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
    """Return what the diagnostics say of a sensor.

    Parameters
    ----------
    state, connected
        What it is listened to by, or why it is not, and which of the two.
    since
        What was counted since the last time.
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
