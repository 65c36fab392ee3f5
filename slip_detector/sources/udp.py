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

"""A sensor on the network, which sends a packet in each datagram."""

import ipaddress
import os
import socket
import time
from collections.abc import Callable
from typing import Any

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.byte_stream import DecodedSamples
from slip_detector.sources.device_clock import DeviceClock
from slip_detector.sources.packets import LONGEST_BYTES, PacketDecoder
from slip_detector.sources.source import WAIT_S, Source

#: Requested size of the receive buffer; the operating system may grant less.
BUFFER_BYTES = 1 << 20

#: Time without packets from the present sender after which another one is accepted.
SENDER_SILENT_S = 0.25


class UdpSource(Source):
    """Packets from one of the allowed senders at a time.

    ``counts`` also has ``unlisted_sender``, datagrams of senders that are not allowed, and
    ``other_sender``, datagrams of an allowed sender from another address or port than the present
    one: samples of two sensors must not be mixed.

    Parameters
    ----------
    config
        The driver's parameters.
    now_ns
        The clock of the stamps, in nanoseconds.

    Raises
    ------
    ValueError
        When a parameter is not an address.

    Examples
    --------
    >>> import time
    >>> config = DriverConfig(source='udp', udp_port=5005)
    >>> UdpSource(config, time.time_ns).name
    '127.0.0.1 port 5005'
    """

    is_live = True

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        self._senders = frozenset(_address('udp_senders', text) for text in config.udp_senders)
        if not self._senders:
            raise ValueError('parameter udp_senders is empty, allowed: at least one address')
        self._address = _address('udp_bind_address', config.udp_bind_address)
        self._udp_port, self._now_ns = config.udp_port, now_ns
        names = default_channel_names(config.channels)
        super().__init__(f'{self._address} port {config.udp_port}', names, 0.0)
        self._decoder = PacketDecoder.from_config(config)
        self.counts = self._decoder.counts
        self._clock = DeviceClock()
        self._sender: Any = None
        self._heard_s = 0.0
        self._arrival_ns = 0
        self._socket: socket.socket | None = None

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
        try:
            listener.bind((str(self._address), self._udp_port))
        except OSError as error:
            listener.close()
            raise ValueError(
                f'parameter udp_port is {self._udp_port}: cannot be listened on at '
                f'{self._address} ({os.strerror(error.errno or 0)}), allowed: a free port of this '
                'machine'
            ) from None
        self._socket = listener
        self.connected = True
        self.state = f'listening on {self.name}'

    def read(self, n: int) -> Samples:
        """Return the samples of the next datagram, after at most ``WAIT_S``."""
        decoded = self._decoded()
        arrived = [] if decoded is None else [decoded]
        return self._clock.stamp(arrived, len(self.channel_names), self._arrival_ns)

    def _decoded(self) -> DecodedSamples | None:
        assert self._socket is not None, 'reading begins after start()'
        try:
            # One byte more than allowed shows that a datagram is too long.
            packet, sender = self._socket.recvfrom(LONGEST_BYTES + 1)
        except TimeoutError:
            return None
        self._arrival_ns = self._now_ns()
        if ipaddress.ip_address(sender[0]) not in self._senders:
            self.counts['unlisted_sender'] += 1
            return None
        now_s = time.monotonic()
        if sender != self._sender and not self._decoder.fault(packet):
            if self._sender is not None and now_s - self._heard_s < SENDER_SILENT_S:
                self.counts['other_sender'] += 1
                return None
            self._sender = sender
            self._decoder.restart()
        decoded = self._decoder.decode(packet)
        if decoded is not None:
            self._heard_s = now_s
        return decoded

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()


def _address(name: str, text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        raise ValueError(
            f'parameter {name} has {text!r}, allowed: addresses as 127.0.0.1 or ::1'
        ) from None
