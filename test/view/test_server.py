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


"""The server with simulated fingers: who may reach it, and clients that misbehave."""

import asyncio
import contextlib
import json
import os
import re
import resource
import socket
import threading
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest

from slip_detector.view import server
from slip_detector.view.access import MOST_STRANGERS, Access
from slip_detector.view.server import FOLDERS
from slip_detector.view.view_request import ViewRequest
from support.live_client import LiveClient
from support.simulated_detectors import SimulatedDetectors, served_pages

#: How a page begins; and what one says that reads nothing: an answer to a ping that it has not
#: read, and a request whose answer is long.
UPGRADE = (
    b'GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
    b'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n'
)
ASKS = json.dumps({'type': 'none', 'id': 'x' * 60_000}).encode()
FLOOD = b'\x8a\x80' + bytes(4) + b'\x81\xfe' + len(ASKS).to_bytes(2, 'big') + bytes(4) + ASKS


@contextlib.asynccontextmanager
async def served(detectors=None, **how):
    """Serve detectors to one page; gives what is served, which opens others, and the page."""
    async with served_pages(detectors or SimulatedDetectors(), **how) as it:
        with contextlib.ExitStack() as ends:

            async def another():
                page = await LiveClient.open(it.url)
                ends.callback(page.close)
                return page

            async def connect():
                reader, writer = await asyncio.open_connection(*it.there, limit=1000)
                ends.callback(writer.close)
                return reader, writer

            there = urlsplit(it.url)
            it.there, it.another, it.connect = (there.hostname, there.port), another, connect
            yield it, await another()


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


@pytest.mark.parametrize(
    ('host', 'local'),
    [
        ('localhost', True), ('127.0.0.2', True), ('[::1]:8765', True), ('192.168.1.5', False),
        ('evil.example:80', False), ('localhost.evil.example', False),
        ('localhost:80@evil', False), ('127.0.0.1/evil', False), ('', False), ('a b', False),
    ],
)  # fmt: skip
def test_the_page_is_reached_from_itself_and_without_token_by_names_of_loopback(host, local):
    for access, reached in ((Access(), local), (Access('0.0.0.0'), True)):
        assert (access.refusal(host, None) == '') is reached
        assert (access.refusal(host, f'http://{host}') == '') is reached
        assert access.refusal('localhost:80', f'http://{host}') != ''


async def test_a_page_gets_frames_of_the_fingers_that_it_views_and_only_they_are_watched():
    async with served(SimulatedDetectors(('index', 'thumb'))) as (it, page):
        names = [f'/{label}/slip_detector' for label in ('index', 'thumb')]
        await ticks(it, 2)
        assert it.detectors.watched == set()
        it.detectors.simulated[names[0]].play(3.5)  # It slips from 3.8 s on.
        await page.view(fingers=names[:1], finger=names[0])
        slips = columns = 0
        while not (slips and columns > 20):
            header, arrays = await page.drawn_frame()
            slips += header['fingers'][0]['slip']
            columns += header['traces']['samples']['count']
            assert arrays['level/0'].shape == arrays['on/0'].shape == (16,)
        assert it.detectors.watched == {names[0]}
        it.server.wanted['a recording'] = {names[1]}
        await page.say('view')  # Nothing: the page is hidden.
        await ticks(it, 3)
        assert it.detectors.watched == {names[1]}


async def test_a_broadcast_reaches_later_pages_and_is_repeated_only_when_it_changes():
    async with served() as (it, page):
        it.server.broadcast('teaching', {'count': 1})
        for each in (page, await it.another()):
            assert (await each.until('teaching'))['count'] == 1
        page.latest.clear()
        it.server.broadcast('teaching', {'count': 1})
        it.server.broadcast('parameters', {'fingers': {}})
        await page.until('parameters')
        assert 'teaching' not in page.latest


async def test_pages_hear_of_fingers_that_come_and_go_and_of_the_end_of_the_server():
    async with served() as (it, page):
        it.detectors.add('thumb', next(iter(it.detectors.fingers.values())).config)
        message = await page.until('fingers', lambda content: len(content['fingers']) == 2)
        assert [finger['label'] for finger in message['fingers']] == ['index', 'thumb']
        it.detectors.remove('index')
        message = await page.until('fingers', lambda content: len(content['fingers']) == 1)
        assert message['gone'] == {'/index/slip_detector': 'index'}
        (ours,) = it.server.pages
        await it.server.close()
        assert ours.close_code == 1001  # The page has said that it heard of it.
        while await page._socket.read_message() is not None:
            pass
        assert page._socket.close_reason == 'slip_view was stopped'


async def test_requests_are_answered_and_refusals_are_in_words(caplog):
    async def add(name):
        return {'value': f'{name} and more'}

    async def fail():
        raise KeyError('gone')

    async with served() as (it, page):
        it.server.on_requests(SimpleNamespace(answer_add=add, answer_fail=fail), 'add', 'fail')
        assert (await page.request('add', name='one'))['value'] == 'one and more'
        for name, refusal in (
            ('subtract', 'subtract is no request, allowed: add, fail, keep_rest'),
            ('keep_rest', "there is no finger '/none'"),
            ('fail', "slip_view has failed at this, its log says where: KeyError('gone')"),
        ):
            assert (await page.request(name, finger='/none'))['refusal'] == refusal
        (line,) = caplog.text.splitlines()
        assert "a request failed: fail: KeyError('gone') at test_server.py:" in line


async def test_the_files_of_the_page_are_served_and_nothing_else(caplog):
    async with served() as (it, _):
        index = await AsyncHTTPClient().fetch(it.url)
        assert b'slip_view' in index.body
        assert "default-src 'self'" in index.headers['Content-Security-Policy']
        wanted = re.findall(r'(?:href|src)="/([^"]+)"', index.body.decode())
        wanted += [f'page/{file.name}' for file in FOLDERS['page'].glob('*.js')]
        for path in wanted:
            assert (await status_of(it.url + path))[0] == 200
        outside = ['page/../server.py', 'page/%2e%2e/server.py', 'etc/passwd']
        for path in [*outside, 'page/none', 'page/index.html%00', 'page/%0a', f'page/{"a" * 999}']:
            assert (await status_of(it.url + path))[0] in (403, 404)
        assert caplog.text == ''
        # What tornado itself cannot take is one line.
        reader, writer = await it.connect()
        writer.write(b'GET / HTTP/1.1\r\nHost: a:' + 5000 * b'9' + b'\r\n\r\n')
        await reader.read()
        assert len(caplog.text.splitlines()) <= 1


async def test_another_site_reaches_neither_page_nor_connection():
    async with served() as (it, _):
        evil = f'evil.example:{it.there[1]}'
        for place, name, value in (('', 'Host', evil), ('live', 'Origin', f'http://{evil}')):
            code, text = await status_of(HTTPRequest(it.url + place, headers={name: value}))
            assert (code, text.partition(',')[0]) == (403, f'{name} is {value}')


async def test_beyond_loopback_the_address_needs_its_token():
    async with served(access=Access('0.0.0.0', token='right')) as (it, page):
        await page.until('fingers')  # With the token.
        base, _, _ = it.url.partition('?')
        for query in ('', '?token=Right', '?Token=right', '?token=%20right', '?token=%C3%BC'):
            for place in ('', 'live'):
                answer = await status_of(base + place + query)
                assert answer == (403, f'{server.NO_TOKEN}\n')


async def test_a_page_that_reads_nothing_delays_no_other_and_gets_only_the_latest():
    async with served() as (it, page):
        await page.until('fingers')
        (asleep,) = it.server.pages
        other = await it.another()
        # The stream of the first page is full, and stays so.
        stuck = asleep._sending = asyncio.get_running_loop().create_future()
        for k in range(20):
            it.server.broadcast('teaching', {'count': k})
            await other.until('teaching', lambda content, k=k: content['count'] == k)
        stuck.set_result(None)
        assert (await page.until('teaching'))['count'] == 19


async def test_what_reads_or_asks_nothing_is_closed_and_little_waits_for_it(monkeypatch):
    monkeypatch.setattr(server, 'PING_S', 0.5)
    async with served() as (it, page):
        await page.view()
        (idle, _), (_, writer) = await it.connect(), await it.connect()
        writer.write(UPGRADE)
        while len(it.server.pages) < 2:
            await page.drawn_frame()
        (deaf,) = (each for each in it.server.pages if each.view is None)
        most = 0
        while deaf in it.server.pages:
            if writer.transport.get_write_buffer_size() < 1 << 20:
                writer.write(20 * FLOOD)
            most = max(most, len(deaf._answers))
            await page.drawn_frame()
        assert 1 < most <= server.MOST_UNANSWERED
        assert await idle.read() == b''
        await page.drawn_frame()


async def test_of_what_takes_long_a_page_gets_the_last_and_one_that_has_left_nothing():
    begun, goes_on = [], threading.Event()

    def work(number):
        begun.append(number)
        goes_on.wait(60.0)
        return {}

    async with served() as (it, page):

        async def answer(id):
            return await it.server.work(work, id)

        it.server.on_requests(SimpleNamespace(answer_slow=answer), 'slow')
        for number in range(300):
            await page.say('slow', id=number)
        asked = await page.until('answer', lambda answer: answer['id'] == 298)
        assert asked['refusal'] == server.REPLACED
        leaves, other = await it.another(), await it.another()
        await leaves.say('slow', id='of one that leaves')
        await leaves.request('of no kind')
        leaves.close()
        while len(it.server.pages) > 2:
            await ticks(it, 1)
        waits = asyncio.create_task(other.request('slow'))
        goes_on.set()
        asked = await page.until('answer', lambda answer: answer['id'] == 299)
        assert (asked['refusal'], (await waits)['refusal']) == ('', '')
        assert begun[-2:] == [299, 1]
        assert len(begun) == 3  # The first one had begun at once.


async def test_many_idle_connections_keep_no_page_out_and_take_few_descriptors():
    async with served() as (it, page):
        await page.view()
        idle = [await it.connect() for _ in range(200)]
        assert await idle[0][0].read() == b''  # It was closed for a later one.
        await page.drawn_frame()
        other = await it.another()
        await other.view()
        await other.drawn_frame()
        held = [each for each in it.server.connections.strangers if not each.closed()]
        assert len(held) <= MOST_STRANGERS


def take_descriptors():
    """Take all descriptors that are left."""
    taken = []
    with contextlib.suppress(OSError):
        while True:
            taken.append(os.open(os.devnull, os.O_RDONLY))
    return taken


async def test_where_descriptors_run_out_some_are_left_and_a_connection_waits(monkeypatch, caplog):
    monkeypatch.setattr('slip_detector.view.access.PAUSE_S', 0.2)
    limits, taken = resource.getrlimit(resource.RLIMIT_NOFILE), []
    loop = asyncio.get_running_loop()
    async with served() as (it, page):
        await page.view()
        with socket.socket() as turned_away, socket.socket() as waiting:
            for each in (turned_away, waiting):
                each.setblocking(False)
            highest = max(map(int, os.listdir('/proc/self/fd')))
            resource.setrlimit(resource.RLIMIT_NOFILE, (highest + 20, limits[1]))
            try:
                taken = take_descriptors()
                for _ in range(10):
                    os.close(taken.pop())
                await loop.sock_connect(turned_away, it.there)
                assert await loop.sock_recv(turned_away, 1) == b''
                taken += (left := take_descriptors())
                assert len(left) == 10
                await loop.sock_connect(waiting, it.there)
                for _ in range(3):
                    await page.drawn_frame()
            finally:
                resource.setrlimit(resource.RLIMIT_NOFILE, limits)
                for each in taken:
                    os.close(each)
            await loop.sock_sendall(waiting, b'GET / HTTP/1.0\r\n\r\n')
            assert await loop.sock_recv(waiting, 4) == b'HTTP'
    assert not caplog.records


async def test_one_page_too_many_is_told_so(monkeypatch):
    monkeypatch.setattr(server, 'MOST_PAGES', 1)
    async with served() as (it, page):
        await page.until('fingers')
        assert await status_of(f'{it.url}live') == (403, f'{server.TOO_MANY}\n')


async def test_of_many_paused_pages_some_keep_the_past():
    async with served() as (it, first):
        others = [await it.another() for _ in range(server.MOST_PAUSED)]
        for each in (first, *others):
            await each.view(until_ns=1_000_000_000_000)
            await each.drawn_frame()
        keeping = [page for page in it.server.pages if page.past]
        assert (len(it.server.pages), len(keeping)) == (len(others) + 1, len(others))


@pytest.mark.parametrize(
    'text',
    ['', '[]', '[' * 100_000, '{"type": ["view"]}', '{"type": "view", "fingers": 3}',
     '{"type": "view", "fingers": ["x"], "channels": [1e400]}', b'\xff',
     '{"type": "view", "fingers": "\\ud800"}', '{"type": "view", "fingers": 1' + 4000 * '0' + '}'],
    ids=lambda text: repr(text[:30]),
)  # fmt: skip
async def test_a_message_that_is_no_request_does_not_disturb_other_pages(text, caplog):
    async with served() as (it, page):
        await page.view()
        other = await it.another()
        await other._socket.write_message(text, binary=isinstance(text, bytes))
        for _ in range(3):
            await page.drawn_frame()
    assert caplog.text == ''


async def test_a_page_that_cannot_be_drawn_is_closed_and_others_are_served(monkeypatch, caplog):
    frame = ViewRequest.frame

    def fail(view, *words):
        if not view.finger:
            raise ZeroDivisionError('in a frame')
        return frame(view, *words)

    monkeypatch.setattr(ViewRequest, 'frame', fail)
    async with served() as (it, page):
        other = await it.another()
        await other.view(finger='')
        while await other._socket.read_message() is not None:
            pass
        assert 'has failed at this page' in other._socket.close_reason
        assert 'in a frame' in caplog.text
        await page.view()
        await page.drawn_frame()
