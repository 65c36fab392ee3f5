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

from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream

#: Most connections that are no open page: with another one, the oldest is closed.
MOST_STRANGERS = 64


class Connections(HTTPServer):
    """A server of HTTP of which connections that ask for nothing take few descriptors."""

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        """Begin without connections."""
        super().initialize(*args, **kwargs)
        #: Those that are no open page, the oldest first; some may be closed.
        self.strangers: dict[Any, None] = {}

    def handle_stream(self, stream: IOStream, address: Any) -> None:
        """Serve a new connection."""
        if len(self.strangers) >= MOST_STRANGERS:
            oldest = next(iter(self.strangers))
            del self.strangers[oldest]
            oldest.close()
        self.strangers[stream] = None
        super().handle_stream(stream, address)
