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

"""Sensors on a serial port or the network, and the stamps of their samples."""

import ipaddress
import math
import os
import socket
import termios
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import serial
from numpy.typing import ArrayLike

from slip_detector.chain.samples import Samples, Stamps
from slip_detector.chain.stamp_rules import NONE
from slip_detector.chain.stamps import rising
from slip_detector.parameters import DriverConfig, default_channel_names, refuse
from slip_detector.sources.packets import LONGEST_BYTES, LineDecoder, PacketDecoder
from slip_detector.sources.source import WAIT_S, Source

#: Length, by the sender's clock, of a window whose smallest delay is sought. The smallest delay of
#: two windows, the present one and the last one, is used.
WINDOW_NS = 2_000_000_000

#: Largest share by which stamps run faster or slower than the sender's clock to follow a changed
#: estimate. It is far too small to make a sample look missing.
SLEW = 0.1

#: Largest change of the clocks' difference that can be drift; after a larger one, a clock was set.
STEP_NS = 250_000_000

#: Time until a lost port is tried again.
RETRY_S = 0.5

#: Errors of pyserial when a port is gone, vanishes while its rate is set, or lacks the rate.
PORT_ERRORS = (OSError, termios.error, ValueError)

#: Requested size of the receive buffer; the operating system may grant less.
BUFFER_BYTES = 1 << 20

#: Time without packets from the present sender after which another one is accepted.
SENDER_SILENT_S = 0.25


class DeviceClock:
    """Maps the times of a sender's clock to the receiver's.

    The delay of the bytes varies but is never negative. So the sample with the smallest delay
    gives the best estimate of the difference between the clocks, and the smallest delay of the
    last seconds follows their drift. The remaining error is the shortest delay, which is some
    tenths of a millisecond on most lines.

    Examples
    --------
    >>> clock = DeviceClock()
    >>> clock.stamps_ns([0, 1_000_000], arrival_ns=50_000_000)
    array([49000000, 50000000])
    """

    def __init__(self) -> None:
        self._last_ns, self._arrival_ns = NONE, 0
        self._offset_ns = self._newest_ns = self._smallest_ns = self._smallest_before_ns = 0
        self._window_ends_ns, self._mapped = 0, False

    def stamps_ns(self, times_ns: ArrayLike, arrival_ns: int) -> Stamps:
        """Stamp consecutive samples that arrived together.

        The stamps rise strictly, except where the receiver's clock itself was set back.

        Parameters
        ----------
        times_ns : array_like of int, shape (n,)
            When the samples were taken, by the sender's clock, in rising order; at least one.
        arrival_ns
            When the last of them arrived, by the receiver's clock.
        """
        times_ns = np.asarray(times_ns, np.int64)
        newest_ns = int(times_ns[-1])
        delay_ns = arrival_ns - newest_ns
        if newest_ns >= self._window_ends_ns:
            self._smallest_before_ns, self._smallest_ns = self._smallest_ns, delay_ns
            self._window_ends_ns = newest_ns + WINDOW_NS
        self._smallest_ns = min(self._smallest_ns, delay_ns)
        wanted_ns = min(self._smallest_ns, self._smallest_before_ns) - self._offset_ns
        if not self._mapped or abs(wanted_ns) > STEP_NS:
            self._mapped, wanted_ns = True, 0
            self._offset_ns = self._smallest_ns = self._smallest_before_ns = delay_ns
            self._window_ends_ns = newest_ns + WINDOW_NS
        start_ns, offset_ns = self._newest_ns, self._offset_ns
        slope = max(-SLEW, min(SLEW, wanted_ns / max(newest_ns - start_ns, 1)))
        self._newest_ns = newest_ns
        self._offset_ns += round(slope * (newest_ns - start_ns))
        slewed_ns = np.rint(slope * (times_ns - start_ns)).astype(np.int64)
        return self._rising(times_ns + offset_ns + slewed_ns, arrival_ns)

    def stamp(self, decoded: Sequence[Samples], channels: int, arrival_ns: int) -> Samples:
        """Stamp samples that arrived together, of which there may be none.

        Their stamps are the sender's times; where it sends none, their arrival is used.
        """
        stamps_ns = [np.empty(0, np.int64)]
        for samples in decoded:
            if not len(samples.stamps_ns):
                arrived = np.full(len(samples.volts), arrival_ns)
                stamps_ns.append(self._rising(arrived, arrival_ns))
                continue
            self._mapped = self._mapped and not samples.new_stretch
            stamps_ns.append(self.stamps_ns(samples.stamps_ns, arrival_ns))
        volts = [np.empty((0, channels)), *(samples.volts for samples in decoded)]
        return Samples(np.concatenate(volts), np.concatenate(stamps_ns))

    def _rising(self, stamps_ns: Stamps, arrival_ns: int) -> Stamps:
        """Move each stamp that is not after the one before to 1 ns after it.

        Where the arrival shows that the receiver's clock was set back, the first stamp may be
        lower than the one before.
        """
        was_set_back = arrival_ns < self._arrival_ns - STEP_NS
        rising_ns = rising(stamps_ns, NONE if was_set_back else self._last_ns)
        self._arrival_ns, self._last_ns = arrival_ns, int(rising_ns[-1])
        return rising_ns


class LiveSource(Source):
    """A sensor, whose samples are stamped by the receiver's clock."""

    is_live = True

    def __init__(self, name: str, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        is_text = config.source == 'serial' and config.serial_format == 'text'
        rate_hz, channels = config.text_rate_hz if is_text else 0.0, config.channels
        super().__init__(name, default_channel_names(channels), rate_hz)
        scale_v, offset_v = config.packet_scale_v, config.packet_offset_v
        self._decoder: Any = LineDecoder(channels, rate_hz)
        if not is_text:
            self._decoder = PacketDecoder(channels, config.packet_values, scale_v, offset_v)
        self._config, self._now_ns, self._clock = config, now_ns, DeviceClock()
        self.counts = self._decoder.counts
        self._line: Any = None  # The port or the socket.

    def read(self, n: int) -> Samples:
        """Return the new samples, after at most ``WAIT_S``; there may be none."""
        return self._clock.stamp(self._receive(), self._config.channels, self._now_ns())

    def _receive(self) -> list[Samples]:
        """Wait for bytes, at most ``WAIT_S``, and decode them."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the port or the socket."""
        if self._line is not None:
            self._line.close()


class SerialSource(LiveSource):
    """Packets or lines of text from a serial port, which may be unplugged and plugged in again."""

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        if not config.serial_port:
            raise ValueError("parameter serial_port is '', allowed: a port, as source is serial")
        super().__init__(config.serial_port, config, now_ns)
        self._retry_at_s = 0.0

    def start(self) -> None:
        """Open the port; if that fails, reading tries again."""
        port, baud = self._config.serial_port, self._config.serial_baud
        try:
            # Exclusive: each of two readers would get only some of the bytes.
            self._line = serial.Serial(port, baud, timeout=WAIT_S, exclusive=True)
        except PORT_ERRORS as error:
            self._lose(error)
        else:
            self.connected = True
            self.state = f'listening to {port} at {baud} baud'

    def _receive(self) -> list[Samples]:
        """Read what there is, or try to open a lost port."""
        data = b''
        if self._line is not None:
            try:
                data = self._line.read(max(1, self._line.in_waiting))
            except PORT_ERRORS as error:
                self._lose(error)
        elif (wait_s := self._retry_at_s - time.monotonic()) > 0.0:
            time.sleep(min(wait_s, WAIT_S))
        else:
            self.start()
        return self._decoder.feed(data)  # type: ignore[no-any-return]

    def _lose(self, error: Exception) -> None:
        self.close()
        self._line = None
        # The last packet is incomplete, and another sensor may be plugged in next.
        self._decoder.restart()
        self._retry_at_s = time.monotonic() + RETRY_S
        self.connected = False
        number = getattr(error, 'errno', None)
        reason = os.strerror(number) if number else ' '.join(str(error).split())
        self.state = f'{self._config.serial_port}: cannot be read ({reason}), trying again'


class UdpSource(LiveSource):
    """Packets from one of the allowed senders at a time.

    ``counts`` also has ``unlisted_sender``, datagrams of senders that are not allowed, and
    ``other_sender``, datagrams of an allowed sender from another address or port than the present
    one: samples of two sensors must not be mixed.
    """

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        try:
            self._senders = frozenset(map(ipaddress.ip_address, config.udp_senders))
            self._address = ipaddress.ip_address(config.udp_bind_address)
        except ValueError as error:
            raise ValueError(f'parameters udp_senders, udp_bind_address: {error}') from None
        if not self._senders:
            raise ValueError('parameter udp_senders is empty, allowed: at least one address')
        super().__init__(f'{self._address} port {config.udp_port}', config, now_ns)
        self._sender: Any = None
        self._heard_s = -math.inf

    def start(self) -> None:
        """Begin to listen.

        Raises
        ------
        ValueError
            When the address or the port cannot be used.
        """
        family = socket.AF_INET if self._address.version == 4 else socket.AF_INET6
        listener = socket.socket(family, socket.SOCK_DGRAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        listener.settimeout(WAIT_S)
        port = self._config.udp_port
        try:
            listener.bind((str(self._address), port))
        except OSError as error:
            listener.close()
            why = f'cannot be listened on at {self._address} ({error.strerror})'
            refuse(f'parameter udp_port is {port}: {why}', 'a free port of this machine')
        self._line = listener
        self.connected = True
        self.state = f'listening on {self.name}'

    def _receive(self) -> list[Samples]:
        try:
            # One byte more than allowed shows that a datagram is too long.
            packet, sender = self._line.recvfrom(LONGEST_BYTES + 1)
        except TimeoutError:
            return []
        if ipaddress.ip_address(sender[0]) not in self._senders:
            self.counts['unlisted_sender'] += 1
            return []
        now_s = time.monotonic()
        if sender != self._sender and not self._decoder.fault(packet):
            if now_s - self._heard_s < SENDER_SILENT_S:
                self.counts['other_sender'] += 1
                return []
            self._sender = sender
            self._decoder.restart()
        decoded: list[Samples] = self._decoder.decode(packet)
        self._heard_s = now_s if decoded else self._heard_s
        return decoded
