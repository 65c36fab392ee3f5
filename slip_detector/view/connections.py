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
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from tornado.iostream import IOStream

#: Most connections that are no open page: with another one, the oldest is closed.
MOST_STRANGERS = 64

#: So many file descriptors are left for all else, such as recordings.
KEPT_DESCRIPTORS = 32

#: Time, in seconds, for which nothing is accepted when a connection cannot be.
PAUSE_S = 1.0


class Connections:
    """Accepts connections on sockets that listen, and gives them to a server."""

    def __init__(
        self, sockets: Sequence[socket.socket], serve: Callable[[IOStream, Any], None]
    ) -> None:
        self._sockets, self._serve = sockets, serve
        #: Those that are no open page, the oldest first; some may be closed.
        self.strangers: deque[IOStream] = deque()
        for each in sockets:
            self._watch(each)

    def close(self) -> None:
        """Stop listening."""
        for each in self._sockets:
            asyncio.get_running_loop().remove_reader(each)
            each.close()

    def admit(self, stream: Any) -> None:
        """Note that a connection is an open page."""
        if stream in self.strangers:
            self.strangers.remove(stream)

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
            self.strangers.popleft().close()
        self.strangers.append(stream := IOStream(connection))
        self._serve(stream, address)
