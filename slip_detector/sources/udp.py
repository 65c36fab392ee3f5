"""A sensor on the network: one packet per datagram."""

import ipaddress
import os
import socket
import time
from collections.abc import Callable
from typing import Any

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources.device_clock import DeviceClock
from slip_detector.sources.live import WAIT_S, LiveSamples, stamped
from slip_detector.sources.packets import LONGEST_BYTES, PacketDecoder

#: What the kernel is asked to keep while the driver is busy; it may grant less.
BUFFER_BYTES = 1 << 20

#: The sender that is listened to keeps its place for so long after its last packet.
SENDER_SILENT_S = 0.25


class UdpSource:
    """Packets from one sender at a time, of those allowed to send.

    Implements :class:`slip_detector.sources.live.LiveSource`; ``counts`` also has
    ``unlisted_sender``, datagrams of senders not listed, and ``other_sender``, those of a listed one (or of another
    port of it) that came while one was listened to: two sensors must not be taken for one.

    Raises
    ------
    ValueError
        When an address is none, or cannot be listened on.
    """

    def __init__(self, config: DriverConfig, now_ns: Callable[[], int]) -> None:
        self._senders = frozenset(_address('udp_senders', text) for text in config.udp_senders)
        if not self._senders:
            raise ValueError('parameter udp_senders is empty, allowed: at least one address')
        address = _address('udp_bind_address', config.udp_bind_address)
        self._now_ns = now_ns
        self._decoder = PacketDecoder(
            config.channels, config.packet_values, config.packet_scale_v, config.packet_offset_v
        )
        self.counts = self._decoder.counts
        self._clock = DeviceClock()
        self._sender: Any = None
        self._heard_s = 0.0
        family = socket.AF_INET if address.version == 4 else socket.AF_INET6
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        self._socket.settimeout(WAIT_S)
        try:
            self._socket.bind((str(address), config.udp_port))
        except OSError as error:
            self._socket.close()
            raise ValueError(
                f'parameter udp_port is {config.udp_port}: cannot be listened on at {address} '
                f'({os.strerror(error.errno or 0)}), allowed: a free port of this machine'
            ) from None
        self.connected = True
        self.state = f'listening on {address} port {config.udp_port}'

    def read(self) -> list[LiveSamples]:
        """Wait at most ``WAIT_S`` for the samples of a datagram."""
        try:
            # A byte more than allowed tells a datagram that is too long.
            packet, sender = self._socket.recvfrom(LONGEST_BYTES + 1)
        except TimeoutError:
            return []
        arrival_ns = self._now_ns()
        if ipaddress.ip_address(sender[0]) not in self._senders:
            self.counts['unlisted_sender'] += 1
            return []
        now_s = time.monotonic()
        if sender != self._sender and not self._decoder.fault(packet):
            if self._sender is not None and now_s - self._heard_s < SENDER_SILENT_S:
                self.counts['other_sender'] += 1
                return []
            self._sender = sender
            self._decoder.restart()
        received = self._decoder.decode(packet)
        if received is None:
            return []
        self._heard_s = now_s
        return stamped([received], self._clock, arrival_ns)

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()


def _address(name: str, text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        raise ValueError(
            f'parameter {name} has {text!r}, allowed: addresses as 127.0.0.1 or ::1'
        ) from None
