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

import re

from tornado.httpclient import AsyncHTTPClient, HTTPRequest

from slip_detector.view import server
from slip_detector.view.access import Access
from support.live_client import LiveClient
from support.served_pages import port_of, refused, served, status_of, ticks
from support.simulated_detectors import ServedPages, SimulatedDetectors


async def test_a_page_is_told_of_the_fingers_and_gets_frames_of_what_it_looks_at():
    async with served() as (it, page):
        (simulated,) = it.detectors.simulated.values()
        simulated.play(3.5)  # It slips from 3.8 s on.
        await page.look()
        slips = columns = number = 0
        while not (slips and columns > 20):
            header, arrays = await page.drawn_frame()
            assert header['frame'] == number + 1
            number = header['frame']
            slips += header['fingers'][0]['slip']
            count = header['traces']['samples']['count']
            columns += count
            assert arrays['level/0'].shape == arrays['on/0'].shape == (16,)
            assert arrays['groups/0'].shape == (4,)
            if columns:
                assert arrays['volts/low'].shape == arrays['volts/high'].shape == (2, count)


async def test_only_what_a_page_looks_at_is_watched():
    async with served(SimulatedDetectors(('index', 'thumb'))) as (it, page):
        names = [f'/{label}/slip_detector' for label in ('index', 'thumb')]
        await ticks(it, 2)
        assert it.detectors.watched == set()
        await page.look(fingers=names[:1], finger='')
        await page.drawn_frame()
        assert it.detectors.watched == set(names[:1])
        it.server.wanted['a recording'] = {names[1]}
        await page.say('look')  # Nothing: the page is hidden.
        await ticks(it, 3)
        assert it.detectors.watched == {names[1]}
        it.server.wanted.clear()
        await ticks(it, 2)
        assert it.detectors.watched == set()


async def test_the_next_frame_waits_until_the_one_before_was_drawn():
    async with served() as (it, page):
        await page.look()
        await page.next_frame()
        (of_server,) = it.server.pages
        await ticks(it, 10)
        assert of_server._frames == 1
        await page.say('drawn', frame=1)
        assert (await page.next_frame())[0]['frame'] == 2


async def test_a_broadcast_reaches_later_pages_and_is_repeated_only_when_it_changes():
    async with served() as (it, page):
        it.server.broadcast('teaching', {'count': 1})
        assert (await page.until('teaching'))['count'] == 1
        page.told.clear()
        it.server.broadcast('teaching', {'count': 1})
        it.server.broadcast('parameters', {'fingers': {}})
        await page.until('parameters')
        assert 'teaching' not in page.told
        late = await LiveClient.open(it.url)
        assert (await late.until('teaching'))['count'] == 1
        late.close()


async def test_fingers_that_come_and_go_are_told():
    async with served() as (it, page):
        await page.until('hand', lambda hand: len(hand['fingers']) == 1)
        config = next(iter(it.detectors.fingers.values())).config
        it.detectors.add('thumb', config)
        hand = await page.until('hand', lambda hand: len(hand['fingers']) == 2)
        assert [finger['label'] for finger in hand['fingers']] == ['index', 'thumb']
        it.detectors.remove('index')
        hand = await page.until('hand', lambda hand: len(hand['fingers']) == 1)
        assert hand['gone'] == {'/index/slip_detector': 'index'}


async def test_requests_are_answered_and_refusals_are_in_words():
    async def answer(message):
        if message.get('value') != 7:
            raise ValueError('value is no 7')
        return {'value': 8}

    async def fail(message):
        raise KeyError('gone')

    def prepare(of):
        of.on_request('add', answer)
        of.on_request('fail', fail)

    async with served(prepare=prepare) as (_, page):
        assert (await page.request('add', value=7))['value'] == 8
        assert (await page.request('add'))['refusal'] == 'value is no 7'
        refusal = (await page.request('subtract'))['refusal']
        assert refusal == 'subtract is no request, allowed: add, fail, hold_rest'
        assert 'slip_view has failed' in (await page.request('fail'))['refusal']


async def test_the_page_and_its_files_are_served_and_nothing_else():
    async with served() as (it, _):
        index = await AsyncHTTPClient().fetch(it.url)
        assert b'slip_view' in index.body
        assert "default-src 'self'" in index.headers['Content-Security-Policy']
        for path in ('page/app.js', 'drawing/uplot/uPlot.iife.min.js'):
            assert (await status_of(it.url + path))[0] == 200
        for path in ('page/../server.py', 'page/%2e%2e/server.py', 'page', 'etc/passwd'):
            assert (await status_of(it.url + path))[0] == 404
        # It cannot be changed either.
        assert (await status_of(HTTPRequest(it.url, method='POST', body='')))[0] == 405


async def test_no_other_site_reaches_the_page_or_its_connection():
    async with served() as (it, _):
        port = port_of(it)
        evil = {'Host': f'evil.example:{port}'}
        code, said = await status_of(HTTPRequest(it.url, headers=evil))
        assert code == 403
        assert said == f'Host is evil.example:{port}, allowed: localhost, 127.0.0.1, [::1]\n'
        assert await refused(f'{it.url}live', **evil) == 403
        assert await refused(f'{it.url}live', Origin='http://evil.example') == 403
        assert await refused(f'{it.url}live', Origin='null') == 403


async def test_beyond_loopback_the_address_needs_its_token():
    async with served(access=Access('0.0.0.0', token='right')) as (it, page):
        await page.until('hand')  # With the token.
        base, _, _ = it.url.partition('?')
        for query in ('', '?token=', '?token=wrong', '?Token=right', '?token=%20right'):
            code, said = await status_of(base + query)
            assert (code, said.strip()) == (403, server.NO_TOKEN)
            assert await refused(f'{base}live{query}') == 403
        assert (await status_of(it.url))[0] == 200


async def test_pages_are_told_that_the_server_stops():
    async with ServedPages(SimulatedDetectors()) as it:
        page = await LiveClient.open(it.url)
        await page.until('hand')
    while (message := await page._socket.read_message()) is not None:
        assert isinstance(message, str)
    assert page._socket.close_reason == 'slip_view was stopped'
    page.close()


def test_all_that_the_page_asks_for_is_there():
    files = server.page_files()
    index = files['/page/index.html'].read_text(encoding='utf-8')
    wanted = set(re.findall(r'(?:href|src)="(/[^"]+)"', index))
    assert wanted
    for path in wanted:
        assert path in files
    modules = [path for path in files if path.startswith('/page/') and path.endswith('.js')]
    for path in modules:
        for name in re.findall(r"from '\./([^']+)'", files[path].read_text(encoding='utf-8')):
            assert f'/page/{name}' in files, path


def test_nothing_of_it_comes_from_elsewhere():
    for path, file in server.page_files().items():
        if path.startswith('/page/'):
            text = file.read_text(encoding='utf-8')
            places = set(re.findall(r'(?:https?:)?//[a-z][\w.-]*\.[a-z]+', text))
            # The name of the format, and that of the license in the head of each file.
            assert places <= {'http://www.w3.org', 'http://www.apache.org'}, path
