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

"""A sensor on a serial port."""

import os
import termios
import time
from collections.abc import Callable

import serial

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.device_clock import DeviceClock
from slip_detector.sources.packets import PacketDecoder
from slip_detector.sources.source import WAIT_S, Source
from slip_detector.sources.text_lines import LineDecoder

#: Times until a lost port is tried again: the first, which doubles each time, and the longest one.
RETRY_FIRST_S, RETRY_LAST_S = 0.1, 2.0

#: Errors of pyserial when a port is gone, vanishes while its rate is set, or lacks the rate.
PORT_ERRORS = (OSError, termios.error, ValueError)


class SerialSource(Source):
    """Packets or lines of text from a serial port, which may be unplugged and plugged in again.

    Parameters
    ----------
    config
        The driver's parameters.
    now_ns
        The clock of the stamps, in nanoseconds.

    Raises
    ------
    ValueError
        When no port is named.

    Examples
    --------
    >>> import time
    >>> config = DriverConfig(source='serial', serial_port='/dev/ttyACM0', channels=3)
    >>> SerialSource(config, time.time_ns).channel_names
    ('ch1', 'ch2', 'ch3')
    """

    is_live = True

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        if not config.serial_port:
            raise ValueError("parameter serial_port is '', allowed: a port, as source is serial")
        self._config, self._now_ns = config, now_ns
        self._decoder: PacketDecoder | LineDecoder
        rate_hz = 0.0
        if config.serial_format == 'packet':
            self._decoder = PacketDecoder.from_config(config)
        else:
            rate_hz = config.text_rate_hz
            self._decoder = LineDecoder(config.channels, rate_hz)
        names = default_channel_names(config.channels)
        super().__init__(config.serial_port, names, rate_hz)
        self.counts = self._decoder.counts
        self._clock = DeviceClock()
        self._port: serial.Serial | None = None
        self._retry_at_s = 0.0
        self._retry_s = RETRY_FIRST_S

    def start(self) -> None:
        """Open the port; if that fails, reading tries again."""
        self._open()

    def read(self, n: int) -> Samples:
        """Return the new samples, after at most ``WAIT_S``; try to open a lost port."""
        data = b''
        if self._port is not None:
            try:
                data = self._port.read(max(1, self._port.in_waiting))
            except PORT_ERRORS as error:
                self._lose(error)
        elif (wait_s := self._retry_at_s - time.monotonic()) > 0.0:
            time.sleep(min(wait_s, WAIT_S))
        else:
            self._open()
        if data:
            self._retry_s = RETRY_FIRST_S
        return self._clock.stamp(self._decoder.feed(data), self._config.channels, self._now_ns())

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()

    def _open(self) -> None:
        config = self._config
        try:
            # Exclusive: each of two readers would get only some of the bytes.
            self._port = serial.Serial(
                config.serial_port, config.serial_baud, timeout=WAIT_S, exclusive=True
            )
        except PORT_ERRORS as error:
            self._lose(error)
        else:
            self.connected = True
            self.state = f'listening to {config.serial_port} at {config.serial_baud} baud'

    def _lose(self, error: Exception) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
        # The last packet is incomplete, and another sensor may be plugged in next.
        self._decoder.restart()
        self._retry_at_s = time.monotonic() + self._retry_s
        self._retry_s = min(2 * self._retry_s, RETRY_LAST_S)
        self.connected = False
        number = getattr(error, 'errno', None)
        reason = os.strerror(number) if number else ' '.join(str(error).split())
        self.state = f'{self._config.serial_port}: cannot be read ({reason}), trying again'
