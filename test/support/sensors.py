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

"""Sensors as the driver meets them: a pseudo terminal or a UDP socket, and what they send."""

import contextlib
import os
import socket
import threading
import time

import numpy as np

from support.reference_packets import packet

#: Volts of one unit unless a test sets it (the driver's default).
SCALE_V = 1e-3


class Port:
    """A serial port that can be plugged in and out, under a name that stays."""

    def __init__(self, path):
        self.path = path
        self._lock = threading.Lock()
        self.plug_in()

    def plug_in(self):
        self._ends = os.openpty()
        self.path.symlink_to(os.ttyname(self._ends[1]))

    def send(self, data):
        while data:
            with self._lock:
                if not self._ends:
                    raise OSError('unplugged')
                data = data[os.write(self._ends[0], data) :]

    def unplug(self):
        with self._lock:
            self.path.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = ()


class Sender:
    """A socket that sends to a port of this machine, from an address of it."""

    def __init__(self, port, address='127.0.0.1'):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        self._to = ('127.0.0.1', port)

    def send(self, data):
        self._socket.sendto(data, self._to)

    def close(self):
        self._socket.close()


def free_udp_port():
    """Return a free UDP port of this machine."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def make_packets(integers, rate_hz):
    """Return a packet for each row of integers."""
    period_ns = round(1e9 / rate_hz)
    return [
        packet([row], 'int16', k, k * period_ns // 1000, period_ns)
        for k, row in enumerate(integers)
    ]


def vibration(n, rate_hz):
    """Return rows of 16 channels in millivolts that every chain takes for slip: 25 Hz, 0.1 V."""
    wave = 100 * np.sin(2 * np.pi * 25 * np.arange(n) / rate_hz)
    return np.repeat(np.round(wave).astype(int)[:, None], 16, axis=1)


@contextlib.contextmanager
def sending(send, pieces, rate_hz):
    """Send pieces of bytes at a rate, in a thread; ends when all are sent or the block ends."""
    stop = threading.Event()

    def run():
        begin_s = time.monotonic()
        with contextlib.suppress(OSError):  # The port may be pulled out while it is written to.
            for k, piece in enumerate(pieces):
                if stop.wait(max(0.0, begin_s + k / rate_hz - time.monotonic())):
                    return
                send(piece)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
