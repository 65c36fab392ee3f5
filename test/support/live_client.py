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

"""A client of the live page without a browser: messages and frames that it received."""

import json

import numpy as np
from tornado.websocket import websocket_connect

from slip_detector.view.view_request import LENGTH


class LiveClient:
    """A connection as a page has it."""

    def __init__(self, socket):
        self._socket = socket
        #: Of each type the message that came last.
        self.latest = {}
        self._requests = 0

    @classmethod
    async def open(cls, url):
        """Connect to the page of an address, as slip_view prints it."""
        begin, _, token = url.partition('?')
        address = begin.replace('http', 'ws') + 'live' + (f'?{token}' if token else '')
        return cls(await websocket_connect(address))

    def close(self):
        self._socket.close()

    async def say(self, kind, **content):
        await self._socket.write_message(json.dumps({'type': kind, **content}))

    async def next(self):
        """Return the next frame, or None for a message, which is kept."""
        message = await self._socket.read_message()
        assert message is not None, f'closed: {self._socket.close_reason}'
        if isinstance(message, bytes):
            return unpacked(message)
        content = json.loads(message)
        self.latest[content['type']] = content
        return None

    async def drawn_frame(self):
        """Return the next frame, drawn: the one after it may come."""
        while (frame := await self.next()) is None:
            pass
        await self.say('drawn')
        return frame

    async def until(self, kind, holds=lambda content: True):
        """Return the first message of this kind that meets a condition; draw frames meanwhile."""
        while kind not in self.latest or not holds(self.latest[kind]):
            if await self.next() is not None:
                await self.say('drawn')
        return self.latest[kind]

    async def view(self, **content):
        """Ask for all fingers, with traces of two channels of the first one."""
        message = await self.until('fingers', lambda message: message['fingers'])
        names = [finger['name'] for finger in message['fingers']]
        asked = {'fingers': names, 'finger': names[0], 'channels': [1, 2], **content}
        await self.say('view', **asked)
        return names

    async def request(self, kind, **content):
        """Ask for something and return the answer."""
        self._requests += 1
        await self.say(kind, id=self._requests, **content)
        return await self.until('answer', lambda answer: answer['id'] == self._requests)


def unpacked(frame):
    """Return the header and the arrays of a frame, as the page reads them."""
    (length,) = LENGTH.unpack_from(frame)
    place = LENGTH.size + length
    header = json.loads(frame[LENGTH.size : place])
    arrays = {}
    for name, shape in header['arrays']:
        arrays[name] = np.frombuffer(frame, '<f4', int(np.prod(shape)), place).reshape(shape)
        place += arrays[name].nbytes
    return header, arrays
