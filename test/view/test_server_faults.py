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

"""The server with pages that are slow, sleep, break, or say what nobody would."""

import asyncio
import json

import pytest

from slip_detector.view import server
from slip_detector.view.view_request import ViewRequest
from support.live_client import LiveClient
from support.served_pages import UPGRADE, port_of, refused, served, ticks


async def test_a_page_that_reads_nothing_holds_up_no_other_and_gets_the_latest_only():
    async with served() as (it, page):
        await page.until('hand')
        (asleep,) = it.server.pages
        other = await LiveClient.open(it.url)
        await other.until('hand')
        # The stream of the first page is full, and stays so.
        stuck = asleep._sending = asyncio.get_running_loop().create_future()
        for k in range(50):
            it.server.broadcast('teaching', {'count': k})
            await other.until('teaching', lambda told, k=k: told['count'] == k)
        assert json.loads(asleep.news['teaching'])['count'] == 49
        assert len(asleep.news) <= 3
        stuck.set_result(None)
        assert (await page.until('teaching'))['count'] == 49
        other.close()


@pytest.mark.parametrize(
    'text',
    ['', '[]', '{', '[' * 100_000, '{"type": ["look"]}', '{"type": "look", "fingers": 3}',
     '{"type": "look", "fingers": ["x"], "channels": [1e400]}', b'\xff'],
)  # fmt: skip
async def test_a_message_that_is_no_request_does_not_disturb_other_pages(text):
    async with served() as (it, page):
        await page.look()
        other = await LiveClient.open(it.url)
        await other._socket.write_message(text, binary=isinstance(text, bytes))
        for _ in range(5):
            await page.drawn_frame()
        other.close()


async def test_a_connection_that_breaks_while_it_is_sent_to_ends_nothing_else():
    async with served() as (it, page):
        await page.until('hand')
        broken = await LiveClient.open(it.url)
        await broken.until('hand')
        for each in it.server.pages:
            each.ws_connection.stream.close()
        it.server.broadcast('teaching', {'count': 1})
        it.server.tick()
        later = await LiveClient.open(it.url)
        assert (await later.until('teaching'))['count'] == 1
        for each in (later, broken):
            each.close()


async def test_a_page_that_cannot_be_drawn_is_closed_and_others_are_served(monkeypatch, caplog):
    frame = ViewRequest.frame

    def fail(look, *words):
        if not look.finger:
            raise ZeroDivisionError('in a frame')
        return frame(look, *words)

    monkeypatch.setattr(ViewRequest, 'frame', fail)

    async with served() as (it, page):
        await page.look()
        other = await LiveClient.open(it.url)
        await other.look(finger='')
        while await other._socket.read_message() is not None:
            pass
        assert 'has failed at this page' in other._socket.close_reason
        assert 'in a frame' in caplog.text
        other.close()
        await page.drawn_frame()
        await page.drawn_frame()


async def test_a_page_that_sleeps_is_given_up_and_the_others_are_served(monkeypatch):
    monkeypatch.setattr(server, 'PING_S', 0.2)

    async with served() as (it, page):
        await page.until('hand')
        port = port_of(it)
        _, writer = await asyncio.open_connection('127.0.0.1', port)
        headers = {'Host': f'127.0.0.1:{port}', **UPGRADE}
        lines = ('GET /live HTTP/1.1', *(f'{name}: {value}' for name, value in headers.items()))
        writer.write('\r\n'.join((*lines, '', '')).encode())
        # A page that reads answers when it is asked whether it is there.
        told = asyncio.create_task(page.until('teaching'))
        # The other takes part in nothing, not in the end of the connection either: that takes
        # seconds, in which there is something to tell.
        while not any(each.ws_connection.is_closing() for each in it.server.pages):
            await asyncio.sleep(0.01)
        it.server.broadcast('teaching', {'count': 1})
        assert (await told)['count'] == 1
        await ticks(it, 3)
        writer.close()


async def test_a_connection_that_asks_for_nothing_is_closed_and_pages_stay(monkeypatch):
    monkeypatch.setattr(server, 'UNASKED_S', 0.1)

    async with served() as (it, page):
        await page.until('hand')
        reader, writer = await asyncio.open_connection('127.0.0.1', port_of(it))
        assert await reader.read() == b''
        writer.close()
        it.server.broadcast('teaching', {'count': 1})
        await page.until('teaching')


async def test_a_page_that_asks_and_reads_no_answer_is_closed(monkeypatch):
    monkeypatch.setattr(server, 'MOST_REQUESTS', 3)
    asked = []

    async def wait(message):
        asked.append(message['id'])
        await asyncio.Event().wait()

    async with served(prepare=lambda of: of.on_request('wait', wait)) as (it, page):
        other = await LiveClient.open(it.url)
        for k in range(5):
            await other.say('wait', id=k)
        while await other._socket.read_message() is not None:
            pass
        assert other._socket.close_reason == 'more than 3 requests wait for an answer'
        assert asked == [0, 1, 2]
        other.close()
        await page.until('hand')


async def test_no_more_pages_than_the_server_can_serve(monkeypatch):
    monkeypatch.setattr(server, 'MOST_PAGES', 1)

    async with served() as (it, page):
        await page.until('hand')
        assert await refused(f'{it.url}live') == 403
