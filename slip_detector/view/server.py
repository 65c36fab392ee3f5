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

"""The server of the live page: its files, and one connection for each page that is open."""

import asyncio
import contextlib
import copy
import json
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

from tornado import web, websocket
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from slip_detector.view.access import Access
from slip_detector.view.detectors import Detectors, Finger, finger_description
from slip_detector.view.track import LiveTrack
from slip_detector.view.view_request import ViewRequest

#: Shortest time between two frames, in seconds.
FRAME_S = 1 / 30

#: Period of the server's loop, in seconds, while no page is open and no finger is recorded.
IDLE_S = 0.2

#: Period, in seconds, at which a page is pinged; it is closed if it does not answer in time.
PING_S = 10.0

#: A connection without requests is closed after this time, in seconds (by default an hour).
UNASKED_S = 60.0

#: Most pages open at once, and most unanswered requests of a page.
MOST_PAGES, MOST_REQUESTS = 20, 100

#: Longest message of a page, in bytes.
MOST_BYTES = 1 << 20

#: Media types of the files of the page.
TYPES = {
    '.html': 'text/html; charset=utf-8',
    '.js': 'text/javascript; charset=utf-8',
    '.css': 'text/css; charset=utf-8',
    '.txt': 'text/plain; charset=utf-8',
    '.svg': 'image/svg+xml',
}

HEADERS = {
    'Content-Security-Policy': "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-cache',
}

NO_TOKEN = 'this address lacks its token: open the one that slip_view has printed'

READ_ONLY = 'slip_view was started with --read-only: nothing can be changed from a page'

#: Returns the answer to a request of a page, or raises a ValueError that says why not.
Answer = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]


class Server:
    """Serves the live page and keeps all open pages up to date.

    Parameters
    ----------
    detectors
        Those of the fingers.
    access
        The access rules.

    Attributes
    ----------
    wanted : dict
        By purpose, the fingers that are watched even if no page shows them.
    each_tick : list of callable
        Called after each poll of the detectors, at most 30 times a second.
    at_end : list of callable
        Awaited before the pages are closed.
    """

    def __init__(self, detectors: Detectors, access: Access) -> None:
        self.detectors, self.access = detectors, access
        self.wanted: dict[str, set[str]] = {}
        self.each_tick: list[Callable[[], None]] = []
        self.at_end: list[Callable[[], Awaitable[None]]] = []
        self.pages: set[LivePage] = set()
        #: By kind of request its answer, and whether it changes the robot or a file.
        self.requests: dict[str, tuple[Answer, bool]] = {}
        # Keeping a spectrum changes nothing on the robot.
        self.on_request('hold_rest', self._hold_rest)
        #: The present content of each kind, for a page that is opened later.
        self.news: dict[str, str] = {}
        self._http: HTTPServer | None = None

    def on_request(self, kind: str, answer: Answer, *, changes: bool = False) -> None:
        """Let a function answer the requests of one kind."""
        self.requests[kind] = answer, changes

    def broadcast(self, kind: str, content: Mapping[str, Any]) -> None:
        """Send this content to all pages, also to those that are opened later.

        Nothing is sent if the content has not changed. A slow page gets only the latest content.
        """
        text = json.dumps({'type': kind, **content}, allow_nan=False)
        if self.news.get(kind) != text:
            self.news[kind] = text
            for page in self.pages:
                page.news[kind] = text

    def listen(self, port: int) -> int:
        """Listen at the port, 0 for any that is free, and return it.

        Raises
        ------
        OSError
            When the port is not available.
        """
        application = web.Application(
            [
                ('/live', LivePage, {'server': self}),
                ('/.*', File, {'server': self, 'files': page_files()}),
            ],
            websocket_ping_interval=PING_S,
            websocket_ping_timeout=PING_S,  # Older versions of tornado wait three times as long.
            websocket_max_message_size=MOST_BYTES,
            log_function=lambda handler: None,
        )
        # A malformed request is answered with its error; it need not be in a robot's log.
        for name in ('tornado.access', 'tornado.general'):
            logging.getLogger(name).setLevel(logging.ERROR)
        sockets = bind_sockets(port, self.access.host)
        self._http = HTTPServer(
            application, max_body_size=MOST_BYTES, idle_connection_timeout=UNASKED_S
        )
        self._http.add_sockets(sockets)
        return int(sockets[0].getsockname()[1])

    async def run(self, stop: asyncio.Event) -> None:
        """Poll the detectors and send frames until the event is set; then close all pages."""
        due_s = time.monotonic()
        try:
            while not stop.is_set():
                begin_s = time.monotonic()
                self.tick()
                period_s = FRAME_S if self.pages or any(self.wanted.values()) else IDLE_S
                # If a wait ends a little late, the frames after it are still on schedule.
                due_s = max(due_s + period_s, begin_s + 0.95 * period_s)
                left_s = max(0.001, due_s - time.monotonic())
                try:
                    await asyncio.wait_for(stop.wait(), left_s)
                except asyncio.TimeoutError:
                    continue
        finally:
            await self.close()

    def tick(self) -> None:
        """Poll the detectors, and send each page what is new to it."""
        viewed = {name for page in self.pages if page.view for name in page.view.names}
        self.detectors.watch(viewed.union(*self.wanted.values()))
        self.detectors.poll()
        for call in self.each_tick:
            call()
        fingers = sorted(self.detectors.fingers.values(), key=lambda finger: finger.name)
        self.broadcast(
            'hand',
            {
                'fingers': [finger_description(finger) for finger in fingers],
                'gone': self.detectors.gone,
                'read_only': self.access.read_only,
            },
        )
        diagnostics = {finger.name: [*map(list, finger.diagnostics)] for finger in fingers}
        self.broadcast('diagnostics', {'fingers': diagnostics})
        for page in list(self.pages):
            try:
                page.send_news()
            except Exception:
                # The other pages and the recording go on; the log has the traceback.
                logging.getLogger(__name__).exception('a page cannot be sent to')
                page.close(1011, 'slip_view has failed at this page, its log says where')

    async def close(self) -> None:
        """Stop listening, and close the connections."""
        for end in self.at_end:
            await end()
        if self._http is not None:
            self._http.stop()
            for page in list(self.pages):
                page.close(1001, 'slip_view was stopped')
            await self._http.close_all_connections()
            self._http = None

    async def answer(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Answer a request of a page."""
        kind = message.get('type')
        number = message.get('id')
        answer = {'type': 'answer', 'id': number if type(number) is int else None, 'refusal': ''}
        try:
            if not isinstance(kind, str) or kind not in self.requests:
                known = ', '.join(sorted(self.requests))
                raise ValueError(f'{str(kind)[:40]} is no request, allowed: {known}')
            act, changes = self.requests[kind]
            if changes and self.access.read_only:
                raise ValueError(READ_ONLY)
            answer.update(await act(message))
        except ValueError as error:
            answer['refusal'] = str(error)
        except Exception as error:
            # The page must not wait for ever; the log has the traceback.
            logging.getLogger(__name__).exception('a request failed: %s', kind)
            answer['refusal'] = f'slip_view has failed at this, its log says where: {error!r}'
        return answer

    async def _hold_rest(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        finger = self.detectors.fingers.get(str(message.get('finger')))
        if finger is None:
            raise ValueError('finger is not one that is shown')
        finger.hold_rest()
        return {}


def page_files() -> dict[str, Path]:
    """Return all files that a browser may request, by path.

    ``/page`` has the files of the live page, ``/drawing`` those that it shares with the report.

    Examples
    --------
    >>> page_files()['/page/live.css'].name, '/drawing/uplot/uPlot.iife.min.js' in page_files()
    ('live.css', True)
    """
    package = Path(__file__).parents[1]
    return {
        f'{path}/{file.relative_to(folder).as_posix()}': file
        for path, folder in (
            ('/page', package / 'view' / 'page'),
            ('/drawing', package / 'report' / 'templates'),
        )
        for file in folder.rglob('*')
        if file.suffix in TYPES
    }


class _Guarded(web.RequestHandler):
    """Refuses requests that do not come from the page itself, or lack the token."""

    server: Server

    def set_default_headers(self) -> None:
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.clear_header('Server')

    def prepare(self) -> None:
        """Refuse the request, or let it be answered."""
        access = self.server.access
        why = access.refusal(self.request.host, self.request.headers.get('Origin'))
        # The page's other files hold nothing of the robot.
        if not why and self.request.path in ('/', '/live'):
            token = self.get_query_argument('token', '', strip=False)
            why = '' if access.knows(token) else NO_TOKEN
        if why:
            self.refuse(why)

    def refuse(self, why: str) -> None:
        """Answer with the reason."""
        self.set_status(403)
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish(f'{why}\n')


class File(_Guarded):
    """A file of the page."""

    def initialize(self, server: Server, files: Mapping[str, Path]) -> None:
        """Take the arguments of the route."""
        self.server, self.files = server, files

    def get(self) -> None:
        """Send the file."""
        path = self.request.path
        file = self.files.get('/page/index.html' if path == '/' else path)
        if file is None:
            raise web.HTTPError(404)
        self.set_header('Content-Type', TYPES[file.suffix])
        self.finish(file.read_bytes())

    head = get


class LivePage(_Guarded, websocket.WebSocketHandler):
    """One open page."""

    def initialize(self, server: Server) -> None:
        """Take the arguments of the route."""
        self.server = server
        self.view: ViewRequest | None = None
        # The finger, and a copy of its last minute from when the page was paused.
        self._past: tuple[Finger, LiveTrack] | None = None
        self.news: dict[str, str] = {}
        self._frames = self._drawn = 0
        self._sent_s = float('-inf')
        self._sending: asyncio.Future[None] | None = None
        self._answers: set[asyncio.Task[None]] = set()

    async def get(self, *args: Any, **kwargs: Any) -> None:
        """Open the connection, unless too many are open."""
        if len(self.server.pages) >= MOST_PAGES:
            self.refuse(f'{MOST_PAGES} pages are open already, allowed: at most {MOST_PAGES}')
            return
        await super().get(*args, **kwargs)

    def check_origin(self, origin: str) -> bool:
        """Tell tornado that the origin has been checked."""
        return True

    def open(self, *args: str, **kwargs: str) -> None:
        """Prepare to send the page the present content of each kind."""
        self.set_nodelay(True)
        self.news = dict(self.server.news)
        self.server.pages.add(self)

    def on_close(self) -> None:
        """Forget the page."""
        self.server.pages.discard(self)

    def on_message(self, message: str | bytes) -> None:
        """Handle a message of the page."""
        try:
            content = json.loads(message)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self.close(1003, 'no JSON object')
        elif content.get('type') == 'drawn':
            self._drawn = self._frames
        elif content.get('type') == 'look':
            self._change_view(content)
        elif len(self._answers) >= MOST_REQUESTS:
            # The page does not read its answers, which are kept here until it does.
            self.close(1008, f'more than {MOST_REQUESTS} requests wait for an answer')
        else:
            task = asyncio.get_running_loop().create_task(self._answer(content))
            self._answers.add(task)
            task.add_done_callback(self._answers.discard)

    def _change_view(self, content: Mapping[str, Any]) -> None:
        try:
            wanted = content.get('fingers') or content.get('finger')
            self.view = ViewRequest(content) if wanted else None
        except ValueError as error:
            self.news['refused'] = json.dumps({'type': 'refused', 'why': str(error)})
            return
        # A pause may last longer than the track: keep what the page shows.
        finger = self.server.detectors.fingers.get(self.view.finger) if self.view else None
        if finger is None or self.view is None or self.view.until_ns is None:
            self._past = None
        elif self._past is None or self._past[0] is not finger:
            self._past = finger, copy.deepcopy(finger.track)

    async def _answer(self, content: Mapping[str, Any]) -> None:
        answer = await self.server.answer(content)
        # The page may have closed meanwhile, which is no error.
        with contextlib.suppress(websocket.WebSocketClosedError):
            await self.write_message(json.dumps(answer, allow_nan=False))

    def send_news(self) -> None:
        """Send what is new, unless the last message is still being sent."""
        if self._sending is not None and not self._sending.done():
            return
        for text in self.news.values():
            self._send(text)
        self.news = {}
        now_s = time.monotonic()
        waits = self._drawn < self._frames or now_s - self._sent_s < 0.9 * FRAME_S
        if self.view is not None and not waits:
            self._frames += 1
            self._sent_s = now_s
            past = self._past[1] if self._past else None
            self._send(self.view.frame(self.server.detectors, self._frames, past))

    def _send(self, content: str | bytes) -> None:
        # Neither side may have begun to close the connection.
        if self.ws_connection is not None and not self.ws_connection.is_closing():
            self._sending = asyncio.ensure_future(
                self.write_message(content, binary=isinstance(content, bytes))
            )
            # The page may close meanwhile, which is no error.
            self._sending.add_done_callback(lambda sent: sent.cancelled() or sent.exception())
