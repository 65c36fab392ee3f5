"""A sensor on a serial port."""

import os
import termios
import time
from collections.abc import Callable

import serial

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.device_clock import DeviceClock
from slip_detector.sources.live import WAIT_S, LiveSamples, stamped
from slip_detector.sources.packets import LineDecoder, PacketDecoder

#: A port that is gone is looked for after the first time, then after twice that, up to the last.
RETRY_FIRST_S, RETRY_LAST_S = 0.1, 2.0

#: What pyserial raises when a port is gone or, ValueError, does not have the rate; it may be gone
#: in the middle of setting the rate as well.
GONE = (OSError, termios.error, ValueError)


class SerialSource:
    """Packets or lines of text from a serial port, which may come and go.

    Implements :class:`slip_detector.sources.live.LiveSource`.

    Raises
    ------
    ValueError
        When no port is named.
    """

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        if not config.serial_port:
            raise ValueError("parameter serial_port is '', allowed: a port, as source is serial")
        self._config, self._now_ns = config, now_ns
        self._decoder: PacketDecoder | LineDecoder
        if config.serial_format == 'packet':
            self._decoder = PacketDecoder(
                config.channels,
                config.packet_values,
                config.packet_scale_v,
                config.packet_offset_v,
            )
        else:
            self._decoder = LineDecoder(config.channels, config.text_rate_hz)
        self.counts = self._decoder.counts
        self._clock = DeviceClock()
        self._port: serial.Serial | None = None
        self._retry_at_s = 0.0
        self._retry_s = RETRY_FIRST_S
        self.connected = False
        self.state = ''
        self._open()

    def read(self) -> list[LiveSamples]:
        """Wait at most ``WAIT_S`` for samples; look for the port when it is gone."""
        if self._port is None:
            wait_s = self._retry_at_s - time.monotonic()
            if wait_s > 0.0:
                time.sleep(min(wait_s, WAIT_S))
            else:
                self._open()
            return []
        try:
            data = self._port.read(max(1, self._port.in_waiting))
        except GONE as error:
            self._lose(error)
            return []
        if data:
            self._retry_s = RETRY_FIRST_S
        return stamped(self._decoder.feed(data), self._clock, self._now_ns())

    def close(self) -> None:
        """Let go of the port."""
        if self._port is not None:
            self._port.close()

    def _open(self) -> None:
        config = self._config
        try:
            # Of two readers of one port each would get some of the bytes.
            self._port = serial.Serial(
                config.serial_port, config.serial_baud, timeout=WAIT_S, exclusive=True
            )
        except GONE as error:
            self._lose(error)
        else:
            self.connected = True
            self.state = f'listening to {config.serial_port} at {config.serial_baud} baud'

    def _lose(self, error: Exception) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
        # What was under way is lost, and the sensor may have been another one since.
        self._decoder.restart()
        self._retry_at_s = time.monotonic() + self._retry_s
        self._retry_s = min(2 * self._retry_s, RETRY_LAST_S)
        self.connected = False
        number = getattr(error, 'errno', None)
        reason = os.strerror(number) if number else ' '.join(str(error).split())
        self.state = f'{self._config.serial_port}: cannot be read ({reason}), trying again'
