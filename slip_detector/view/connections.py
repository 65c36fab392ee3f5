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


"""The connections of the live page: how many there are at most, before anything is read."""

import asyncio
import resource
import socket
from collections.abc import Iterable
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream

#: Most connections that are no open page: with another one, the oldest is closed.
MOST_STRANGERS = 64

#: So many file descriptors are left for all else, such as recordings.
KEPT_DESCRIPTORS = 32

#: Time, in seconds, for which nothing is accepted when a connection cannot be.
PAUSE_S = 1.0


class Connections(HTTPServer):
    """A server of HTTP of which connections that ask for nothing take few descriptors."""

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        """Begin without connections."""
        super().initialize(*args, **kwargs)
        self._listening: list[socket.socket] = []
        #: Those that are no open page, the oldest first; some may be closed.
        self.strangers: dict[Any, None] = {}

    def add_sockets(self, sockets: Iterable[socket.socket]) -> None:
        """Accept connections on sockets that listen."""
        for each in sockets:
            self._listening.append(each)
            self._watch(each)

    def stop(self) -> None:
        """Stop listening."""
        while self._listening:
            asyncio.get_running_loop().remove_reader(each := self._listening.pop())
            each.close()

    def _watch(self, listening: socket.socket) -> None:
        if listening.fileno() >= 0:  # It is open.
            asyncio.get_running_loop().add_reader(listening, self._accept, listening)

    def _accept(self, listening: socket.socket) -> None:
        try:
            connection, address = listening.accept()
        except OSError:
            # Without a descriptor the connection waits, and would be told again at once.
            loop = asyncio.get_running_loop()
            loop.remove_reader(listening)
            loop.call_later(PAUSE_S, self._watch, listening)
            return
        # A new descriptor is the lowest free one.
        if connection.fileno() + KEPT_DESCRIPTORS >= resource.getrlimit(resource.RLIMIT_NOFILE)[0]:
            connection.close()
            return
        if len(self.strangers) >= MOST_STRANGERS:
            oldest = next(iter(self.strangers))
            del self.strangers[oldest]
            oldest.close()
        self.strangers[stream := IOStream(connection)] = None
        self.handle_stream(stream, address)
