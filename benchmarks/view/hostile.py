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

"""Pages that do not read, or ask for far too much, beside one that behaves."""

import contextlib
import json
import os
import select
import socket
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.processes import memory_kib, nodes_running, processor_time_s
from benchmarks.view.session import DOMAIN, free_port
from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.recordings import write_recording

#: Length of the recording that slip_view plays, in seconds.
RECORDING_S = 600.0

#: Time that slip_view has to start, and an answer to come, in seconds.
PATIENCE_S = 60.0

FINGER = '/bag/index/slip_detector'

#: State of a connection that nobody has closed, see tcp(7).
ESTABLISHED = 1

#: Memory at which a measurement ends.
MOST_KIB = 3 << 20

#: How many traces the greedy page asks for at once.
TRACES = 300

#: By name of a page that does not read, the kind of frames that it sends all the time, and what is
#: in them; ``slow`` reads a byte a second.
LONG = json.dumps({'type': 'trace', 'id': 'x' * 250_000}).encode()
SENT = {
    'asks': (1, LONG),
    'slow': (1, LONG),
    'draws': (1, b'{"type": "drawn"}'),
    'pings': (9, bytes(100)),
    'silent': (1, b''),
}


class Page:
    """A connection as a page has it, which reads only when it is told to."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(('127.0.0.1', port), PATIENCE_S)
        self.socket.sendall(
            b'GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade'
            b'\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n'
        )
        self.file = self.socket.makefile('rb')
        while self.file.readline().strip():
            pass

    def answer(self, number: int) -> dict[str, Any]:
        """Read until the answer to a request has come, and return it."""
        while True:
            if len(head := self.file.read(2)) < 2:
                raise EOFError
            length = head[1]
            if length > 125:
                length = int.from_bytes(self.file.read(2 if length == 126 else 8), 'big')
            data = self.file.read(length)
            with contextlib.suppress(ValueError):
                message: dict[str, Any] = json.loads(data)
                if message.get('type') == 'answer' and message['id'] == number:
                    return message


def framed(kind: int, data: bytes) -> bytes:
    """Return a frame of a WebSocket."""
    n = len(data)
    length = bytes([0x80 | n]) if n < 126 else b'\xff' + n.to_bytes(8, 'big')
    return bytes([0x80 | kind]) + length + bytes(4) + data


def measure_unread(pid: int, port: int, name: str, seconds: float) -> dict[str, Any]:
    """Let a page send without reading; return the memory that it takes, and when it is closed."""
    page, begin_s, before = Page(port), time.monotonic(), memory_kib(pid)
    view = {'type': 'view', 'fingers': [FINGER], 'finger': FINGER, 'channels': [1, 2, 3, 4]}
    page.socket.sendall(framed(1, json.dumps(view).encode()))
    page.socket.setblocking(False)
    frames = framed(*SENT[name]) * (1 + 10_000 // len(framed(*SENT[name])))
    most, read_s, rest = before, 0.0, b''
    while (now_s := time.monotonic() - begin_s) < seconds and most < before + MOST_KIB:
        most = max(most, memory_kib(pid))
        _, writable, _ = select.select([], [page.socket], [], 0.1)
        # That it was closed is found below.
        with contextlib.suppress(BlockingIOError, ConnectionError):
            if name == 'slow' and now_s - read_s > 1.0:
                page.socket.recv(1)
                read_s = now_s
            if writable and name != 'silent':
                rest = rest or frames
                rest = rest[page.socket.send(rest) :]
        if page.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != ESTABLISHED:
            break
    page.socket.close()
    return {'memory_mib': (most - before) / 1024, 'seconds': now_s}


def measure_greedy(pid: int, port: int) -> dict[str, Any]:
    """Let a page ask for many traces and leave; return how long another one waits for its own."""
    greedy = Page(port).socket
    asked = (json.dumps({'type': 'bag_trace', 'id': n}).encode() for n in range(TRACES))
    greedy.sendall(b''.join(framed(1, each) for each in asked))
    page, begin_s = Page(port), time.monotonic()
    page.socket.sendall(framed(1, json.dumps({'type': 'bag_trace', 'id': 1}).encode()))
    with contextlib.suppress(TimeoutError, EOFError):
        page.answer(1)
    waited_s = time.monotonic() - begin_s
    greedy.close()
    begin_s = processor_time_s(pid)
    time.sleep(10.0)
    cpu_percent = 10.0 * (processor_time_s(pid) - begin_s)
    return {'waited_s': waited_s, 'cpu_percent_afterwards': cpu_percent}


def run_hostile(seconds: float) -> dict[str, Any]:
    """Run everything; see :mod:`benchmarks.view.command` for the figures."""
    os.environ['ROS_DOMAIN_ID'] = DOMAIN
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'long.npz'
        volts = np.random.default_rng(1).normal(4.3, 1e-3, (round(RECORDING_S * 380.0), 16))
        samples = Samples.evenly(volts, 380.0, np.zeros(len(volts), bool))
        write_recording(path, [samples], 380.0, DetectorConfig().names)
        view = (sys.executable, '-m', 'slip_detector.nodes.view', '--bag', str(path))
        command = [*view, '--port', str(port), '--folder', folder]
        with nodes_running({'slip_view': command}) as processes:
            pid, until_s = processes['slip_view'].pid, time.monotonic() + PATIENCE_S
            refusal = 'none'
            while refusal and time.monotonic() < until_s:
                time.sleep(0.5)
                with contextlib.suppress(OSError):
                    page = Page(port)
                    page.socket.sendall(framed(1, b'{"type": "bag_trace", "id": 1}'))
                    refusal = page.answer(1)['refusal']
            each = {name: measure_unread(pid, port, name, seconds) for name in SENT}
            worst = {key: max(one[key] for one in each.values()) for key in each['asks']}
            return {'unread': worst | each, 'greedy': measure_greedy(pid, port)}
