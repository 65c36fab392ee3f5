"""The driver's part that passes on what a sensor sends."""

import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from slip_detector.config import DriverConfig
from slip_detector.live_source import LiveSource, open_live_source

#: What came and was no sample is said at most so often; these counts are no fault.
SAY_S = 1.0
GOOD = ('frames', 'samples')


class Listening:
    """Sends on each sample of a sensor as it comes, and says on the log how it goes.

    Parameters
    ----------
    node
        Whose clock and log it is.
    config
        The driver's parameters.
    send
        Takes the stamp of a sample in nanoseconds, the names of its channels and its volts.
    """

    def __init__(
        self,
        node: Node,
        config: DriverConfig,
        send: Callable[[int, list[str], NDArray[np.float64]], object],
    ) -> None:
        self._node, self._config, self._send = node, config, send
        self._said_state = ''
        self._said_faults: dict[str, int] = {}
        self._said_s = -SAY_S

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
        try:
            while not stop.is_set():
                self._say_how_it_goes(source)
                for stamps_ns, volts in source.read():
                    for stamp_ns, row in zip(stamps_ns, volts, strict=True):
                        self._send(stamp_ns, names, row)
        finally:
            source.close()

    def _say_how_it_goes(self, source: LiveSource) -> None:
        """Say when the sensor comes or goes, and now and then what was dropped or lost."""
        logger = self._node.get_logger()
        if source.state != self._said_state:
            self._said_state = source.state
            if source.connected:
                logger.info(source.state)
            else:
                logger.warning(source.state)
        now_s = time.monotonic()
        if now_s - self._said_s < SAY_S:
            return
        faults = {kind: n for kind, n in source.counts.items() if n and kind not in GOOD}
        if faults != self._said_faults:
            self._said_faults, self._said_s = faults, now_s
            words = ', '.join(f'{kind} {n}' for kind, n in sorted(faults.items()))
            logger.warning(f'counted so far: {words}')
