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

"""The server with simulated fingers, and clients that are no browser."""

import asyncio
import json

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPClientError
from tornado.websocket import websocket_connect

from slip_detector.view.frames import unpacked
from slip_detector.view.taxels import drawn_positions
from support.simulated_hand import ServedHand, SimulatedHand

DEADLINE_S = 60.0


def served(test, hand=None, **how):
    """Run a test with a server; it gets what is served."""

    async def run():
        async with ServedHand(hand or SimulatedHand(), **how) as it:
            it.opened = []
            try:
                await asyncio.wait_for(test(it), DEADLINE_S)
            finally:
                for page in it.opened:
                    page.socket.close()

    asyncio.run(run())


class Page:
    """A connection as a page has it."""

    def __init__(self, socket):
        self.socket = socket
        self.told = {}

    @classmethod
    async def open(cls, url):
        address = url.replace('http', 'ws').replace('/?', '/live?')
        return cls(await websocket_connect(address if '?' in address else f'{address}live'))

    async def next_frame(self):
        """Return the next frame; what else is told meanwhile is kept."""
        while True:
            message = await self.socket.read_message()
            assert message is not None, 'closed'
            if isinstance(message, bytes):
                return unpacked(message)
            content = json.loads(message)
            self.told[content['type']] = content

    async def until_told(self, kind):
        while kind not in self.told:
            content = json.loads(await self.socket.read_message())
            self.told[content['type']] = content
        return self.told[kind]

    async def say(self, kind, **content):
        await self.socket.write_message(json.dumps({'type': kind, **content}))


async def opened(it, **look):
    page = await Page.open(it.url)
    it.opened.append(page)
    names = [finger['name'] for finger in (await page.until_told('hand'))['fingers']]
    await page.say('look', **{'fingers': names, 'finger': names[0], 'channels': [1, 2], **look})
    return page


def test_a_page_is_told_of_the_fingers_and_gets_frames_of_what_it_looks_at():
    async def test(it):
        page = await opened(it)
        slips = columns = number = 0
        while not (slips and columns > 20):
            header, arrays = await page.next_frame()
            assert header['frame'] == number + 1
            number = header['frame']
            slips += header['fingers'][0]['slip']
            columns += header['traces']['samples']['count']
            assert arrays['level/0'].shape == arrays['on/0'].shape == (16,)
            assert arrays['groups/0'].shape == (4,)
            if columns:
                count = header['traces']['samples']['count']
                assert arrays['volts/low'].shape == arrays['volts/high'].shape == (2, count)
            await page.say('drawn', frame=number)

    served(test)


def test_a_page_is_told_where_each_channel_is_drawn():
    async def test(it):
        page = await Page.open(it.url)
        it.opened.append(page)
        (finger,) = (await page.until_told('hand'))['fingers']
        (config,) = (finger.config for finger in it.hand.fingers.values())
        assert finger['positions_m'] == drawn_positions(config).tolist()

    served(test)


def test_the_next_frame_waits_until_the_one_before_was_drawn():
    async def test(it):
        page = await opened(it)
        await page.next_frame()
        (of_server,) = it.server.pages
        ticks = 0

        def count():
            nonlocal ticks
            ticks += 1

        it.server.each_tick.append(count)
        while ticks < 10:
            await asyncio.sleep(0.01)
        assert of_server._frames == 1
        await page.say('drawn', frame=1)
        assert (await page.next_frame())[0]['frame'] == 2

    served(test)


def test_the_page_and_its_files_are_served_and_nothing_else():
    async def test(it):
        client = AsyncHTTPClient()
        page = await client.fetch(it.url)
        assert b'slip_view' in page.body
        assert "default-src 'self'" in page.headers['Content-Security-Policy']
        for path in ('page/app.js', 'drawing/uplot/uPlot.iife.min.js'):
            assert (await client.fetch(it.url + path)).code == 200
        for path in ('page/../server.py', 'page/%2e%2e/server.py', 'page', 'etc/passwd'):
            with pytest.raises(HTTPClientError, match='404'):
                await client.fetch(it.url + path)

    served(test)
