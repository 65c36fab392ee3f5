"""The driver's part that passes on what a sensor sends."""

import threading
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from slip_detector.nodes.diagnostics import Diagnostics
from slip_detector.nodes.health import Level, Status
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.live import LiveSource
from slip_detector.sources.source import open_live_source

#: How often it is said how the sensor is, on ``/diagnostics`` and, when something was dropped or
#: lost, on the log.
SAY_S = 1.0

#: Counts of what is as it should be.
GOOD = ('packets', 'samples')


class Listening:
    """Sends on each sample of a sensor as it comes, and says how it goes.

    Parameters
    ----------
    node
        Whose clock and log it is.
    config
        The driver's parameters.
    send
        Takes the stamp of a sample in nanoseconds, the names of its channels and its volts.
    flush
        Sends what waits for more to come: the sensor has gone.
    """

    def __init__(
        self,
        node: Node,
        config: DriverConfig,
        send: Callable[[int, list[str], NDArray[np.float64]], object],
        flush: Callable[[], None],
    ) -> None:
        self._node, self._config, self._send, self._flush = node, config, send, flush
        self._said_state = ''
        self._said_counts: Counter[str] = Counter()
        self._said_s = time.monotonic()

    def run(self, stop: threading.Event) -> None:
        """Listen until told to stop.

        Raises
        ------
        ValueError
            When a parameter does not allow it.
        """
        names = [f'ch{i + 1}' for i in range(self._config.channels)]
        clock = self._node.get_clock()
        source = open_live_source(self._config, lambda: clock.now().nanoseconds)
        diagnostics = Diagnostics(self._node)
        try:
            while not stop.is_set():
                self._say_state(source)
                if time.monotonic() - self._said_s >= SAY_S:
                    self._said_s = time.monotonic()
                    diagnostics.publish([self._summed_up(source)], self._config.frame_id)
                for stamps_ns, volts in source.read():
                    for stamp_ns, row in zip(stamps_ns, volts, strict=True):
                        self._send(stamp_ns, names, row)
        finally:
            source.close()

    def _say_state(self, source: LiveSource) -> None:
        """Say on the log when the sensor comes or goes."""
        if source.state != self._said_state:
            self._said_state = source.state
            if source.connected:
                self._node.get_logger().info(source.state)
            else:
                self._flush()
                self._node.get_logger().warning(source.state)

    def _summed_up(self, source: LiveSource) -> Status:
        """Sum up what came since the last time; say on the log what was dropped or lost."""
        since = source.counts - self._said_counts
        self._said_counts = source.counts.copy()
        status = sensor_status(source.state, source.connected, since)
        status.values = {kind: str(n) for kind, n in sorted(source.counts.items()) if n}
        if any(kind not in GOOD for kind in since):
            faults = {kind: n for kind, n in status.values.items() if kind not in GOOD}
            words = ', '.join(f'{kind} {n}' for kind, n in faults.items())
            self._node.get_logger().warning(f'counted so far: {words}')
        return status


def sensor_status(state: str, connected: bool, since: Counter[str]) -> Status:
    """Say how a sensor is.

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
