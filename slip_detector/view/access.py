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

"""Which requests the live page accepts: rules that can be tested without a network."""

import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass, field
from urllib.parse import quote, urlsplit


@dataclass(frozen=True)
class Access:
    """The access rules of the live page.

    They keep other web sites in the same browser from reaching the robot: a request must address
    this machine by a name that no other site can have (*Host*), and a page that sends one must
    come from this server (*Origin*). A server that other machines can reach needs a token, too.

    Parameters
    ----------
    host
        The address to which the server is bound.
    token
        The value of ``?token=`` in the address of the page; empty: no token is needed.
    read_only
        Whether no page may change anything.
    names
        Names of this machine.

    Examples
    --------
    >>> access = Access('127.0.0.1')
    >>> access.refusal('localhost:8080', None), access.refusal('evil.example:8080', None)
    ('', 'Host is evil.example:8080, allowed: localhost, 127.0.0.1, [::1]')
    >>> access.refusal('localhost:8080', 'http://evil.example')
    'Origin is http://evil.example, allowed: http://localhost:8080'
    """

    host: str = '127.0.0.1'
    token: str = ''
    read_only: bool = False
    names: frozenset[str] = field(
        default_factory=lambda: frozenset({socket.gethostname(), f'{socket.gethostname()}.local'})
    )

    def refusal(self, host: str, origin: str | None) -> str:
        """Return why the headers of a request are refused; empty if they are accepted.

        Parameters
        ----------
        host, origin
            The headers; only browsers send *Origin*.
        """
        name = host_name(host)
        if name is None or not self._is_ours(name):
            allowed = 'an address or name of this machine'
            if is_loopback(self.host):
                allowed = 'localhost, 127.0.0.1, [::1]'
            return f'Host is {host[:100]}, allowed: {allowed}'
        if origin is not None and origin.lower() != f'http://{host.lower()}':
            return f'Origin is {origin[:100]}, allowed: http://{host}'
        return ''

    def _is_ours(self, name: str) -> bool:
        """Return whether no other site can have this name."""
        if is_loopback(self.host):
            return is_loopback(name)
        # Other sites are reached by a name: a numeric address can only be this machine's.
        known = {'localhost', self.host, *self.names}
        return is_address(name) or name in {each.lower() for each in known}

    def knows(self, token: str) -> bool:
        """Return whether a token is right, in a time that reveals nothing about it."""
        return not self.token or hmac.compare_digest(token.encode(), self.token.encode())


def new_token() -> str:
    """Return a random token that cannot be guessed.

    Examples
    --------
    >>> new_token() == new_token()
    False
    """
    return secrets.token_urlsafe(16)


def page_address(host: str, port: int, token: str = '') -> str:
    """Return the address of the page; if it is served on all interfaces, one for other machines.

    Examples
    --------
    >>> page_address('127.0.0.1', 8470), page_address('::1', 80, token='a&b')
    ('http://127.0.0.1:8470/', 'http://[::1]:80/?token=a%26b')
    """
    if host in ('', '0.0.0.0', '::'):
        host = _own_address(socket.AF_INET6 if host == '::' else socket.AF_INET)
    name = f'[{host}]' if ':' in host else host
    return f'http://{name}:{port}/' + (f'?token={quote(token, safe="")}' if token else '')


def _own_address(family: socket.AddressFamily) -> str:
    """Return this machine's address in its network; its host name if it has no network."""
    elsewhere = '2001:db8::1' if family == socket.AF_INET6 else '10.255.255.255'
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            # Nothing is sent: connecting a datagram socket only selects the route.
            probe.connect((elsewhere, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()


def host_name(host: str) -> str | None:
    """Return the name in a *Host* header, without its port; None if the header is malformed.

    Examples
    --------
    >>> host_name('[::1]:8080'), host_name('Robot.local'), host_name('a b')
    ('::1', 'robot.local', None)
    """
    if not host.isascii() or any(c in host for c in '/?#@\\') or not host.isprintable():
        return None
    try:
        parts = urlsplit(f'//{host}')
        _ = parts.port  # Raises if the port is not a number.
    except ValueError:
        return None
    return None if ' ' in host else parts.hostname


def is_address(name: str) -> bool:
    """Return whether a name is a numeric IP address.

    Examples
    --------
    >>> [is_address(name) for name in ('127.0.0.1', '::1', 'localhost')]
    [True, True, False]
    """
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(name: str) -> bool:
    """Return whether only this machine can reach an address.

    Examples
    --------
    >>> [is_loopback(name) for name in ('127.0.0.1', '::1', 'localhost', '0.0.0.0')]
    [True, True, True, False]
    """
    return name == 'localhost' or (is_address(name) and ipaddress.ip_address(name).is_loopback)
