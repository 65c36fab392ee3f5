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

"""A server with simulated fingers, in the test's event loop, and what asks it beside a page."""

import asyncio
import contextlib

from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest

from support.live_client import LiveClient
from support.simulated_detectors import SimulatedDetectors, served_pages

#: Headers that ask for a connection.
UPGRADE = {
    'Upgrade': 'websocket',
    'Connection': 'Upgrade',
    'Sec-WebSocket-Version': '13',
    'Sec-WebSocket-Key': 'AAAAAAAAAAAAAAAAAAAAAA==',
}


@contextlib.asynccontextmanager
async def served(detectors=None, **how):
    """Serve detectors, and open one page; gives what is served, and the page."""
    async with served_pages(detectors or SimulatedDetectors(), **how) as it:
        page = await LiveClient.open(it.url)
        try:
            yield it, page
        finally:
            page.close()


def port_of(it):
    return int(it.url.rpartition(':')[2].strip('/'))


async def ticks(it, n):
    """Wait until the server has looked around n times."""
    seen = []
    it.server.each_tick.append(lambda: seen.append(None))
    while len(seen) < n:
        await asyncio.sleep(0.005)


async def status_of(request):
    """Return the status and the text of an answer."""
    try:
        answer = await AsyncHTTPClient().fetch(request)
    except HTTPClientError as error:
        answer = error.response
    return answer.code, answer.body.decode()


async def refused(url, **headers):
    """Return the status with which a connection is refused."""
    return (await status_of(HTTPRequest(url, headers={**UPGRADE, **headers})))[0]
