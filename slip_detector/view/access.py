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

"""The addresses of the live page, and who may reach it."""

import contextlib
import hmac
import socket
from dataclasses import dataclass
from urllib.parse import quote

from tornado.httputil import split_host_and_port
from tornado.netutil import is_valid_ip


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
        name = split_host_and_port(host.lower())[0].strip('[]')
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
