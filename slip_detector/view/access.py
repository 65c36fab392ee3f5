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

"""The addresses of the live page, who may reach it, and how many connections there may be."""

import asyncio
import contextlib
import hmac
import re
import resource
import socket
from dataclasses import dataclass
from urllib.parse import quote

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.netutil import bind_sockets, is_valid_ip

#: Most connections that are no open page. For one more, the oldest is closed.
MOST_STRANGERS = 64

#: Number of file descriptors that are kept free for all else, such as recordings.
KEPT_DESCRIPTORS = 32

#: Time, in seconds, for which nothing is accepted after a connection could not be accepted.
PAUSE_S = 1.0


@dataclass(frozen=True)
class Access:
    """The access rules of the live page.

    They keep other web sites in the same browser from reaching the robot: a page that sends a
    request must come from this server (*Origin*), which only this machine can reach, by a name
    that no other site can have (*Host*), or which needs a token that no other site knows.

    Examples
    --------
    >>> access = Access('127.0.0.1')
    >>> access.refusal('localhost:8080', None), access.refusal('evil.example:8080', None)
    ('', 'Host is evil.example:8080, allowed: localhost, 127.0.0.1, [::1]')
    >>> access.refusal('localhost:8080', 'http://evil.example')
    'Origin is http://evil.example, allowed: http://localhost:8080'
    """

    #: The address to which the server is bound.
    host: str = '127.0.0.1'
    #: The value of ``?token=`` in the address of the page; empty: no token is needed.
    token: str = ''
    #: Whether no page may change anything.
    read_only: bool = False

    def refusal(self, host: str, origin: str | None) -> str:
        """Return why the headers of a request are refused; empty if they are accepted."""
        name = re.sub(':[0-9]+$', '', host.lower()).strip('[]')
        if is_loopback(self.host) and not is_loopback(name):
            return f'Host is {host[:100]}, allowed: localhost, 127.0.0.1, [::1]'
        if origin is not None and origin.lower() != f'http://{host.lower()}':
            return f'Origin is {origin[:100]}, allowed: http://{host}'
        return ''

    def knows(self, token: str) -> bool:
        """Return whether a token is right, in a time that reveals nothing about it."""
        return not self.token or hmac.compare_digest(token.encode(), self.token.encode())


def page_address(host: str, port: int, token: str = '') -> str:
    """Return the address of the page; if it is served on all interfaces, one for other machines.

    Examples
    --------
    >>> page_address('127.0.0.1', 8470), page_address('::1', 80, token='a&b')
    ('http://127.0.0.1:8470/', 'http://[::1]:80/?token=a%26b')
    """
    if host in ('', '0.0.0.0', '::'):
        host = socket.gethostname() if host == '::' else _own_address()
    name = f'[{host}]' if ':' in host else host
    return f'http://{name}:{port}/' + (f'?token={quote(token, safe="")}' if token else '')


def _own_address() -> str:
    """Return this machine's address in its network; its host name if it has no network."""
    with contextlib.suppress(OSError), socket.socket(type=socket.SOCK_DGRAM) as probe:
        # Nothing is sent: connecting a datagram socket only selects the route.
        probe.connect(('10.255.255.255', 9))
        return str(probe.getsockname()[0])
    return socket.gethostname()


def is_loopback(name: str) -> bool:
    """Return whether only this machine can reach an address.

    Examples
    --------
    >>> [is_loopback(name) for name in ('127.0.0.1', '::1', 'localhost', '0.0.0.0')]
    [True, True, True, False]
    """
    return name in ('localhost', '::1') or (name.startswith('127.') and is_valid_ip(name))


class Connections:
    """Accepts connections to a server, of which those that are no page take few descriptors."""

    def __init__(self, http: HTTPServer) -> None:
        self._http = http
        #: Streams that are no open page, the oldest first; some may be closed.
        self.strangers: list[IOStream] = []
        self._accepting: dict[socket.socket, asyncio.Task[None]] = {}

    def listen(self, port: int, host: str) -> int:
        """Listen at the port, 0 for any that is free, and return it; may raise an OSError."""
        sockets = bind_sockets(port, host)
        loop = asyncio.get_running_loop()
        self._accepting = {each: loop.create_task(self._accept(each)) for each in sockets}
        return int(sockets[0].getsockname()[1])

    async def stop_listening(self) -> None:
        """Accept no more connections."""
        for listening, task in self._accepting.items():
            task.cancel()
            await asyncio.wait([task])
            listening.close()

    async def _accept(self, listening: socket.socket) -> None:
        while True:
            await asyncio.sleep(0)  # A flood of them would let nothing else run.
            try:
                connection, address = await asyncio.get_running_loop().sock_accept(listening)
            except OSError:  # Without a descriptor, the connection waits.
                await asyncio.sleep(PAUSE_S)
                continue
            # A new descriptor is the lowest free one.
            most = resource.getrlimit(resource.RLIMIT_NOFILE)[0] - KEPT_DESCRIPTORS
            if connection.fileno() >= most:
                connection.close()
                continue
            if len(self.strangers) >= MOST_STRANGERS:
                self.strangers.pop(0).close()
            self.strangers.append(stream := IOStream(connection))
            self._http.handle_stream(stream, address)
