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


"""The server of the live page: its files, one connection for each page, and few others."""

import asyncio
import contextlib
import copy
import inspect
import json
import logging
import threading
import time
import traceback
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from tornado import web, websocket
from tornado.httpserver import HTTPServer

from slip_detector.commands.command_line import one_line
from slip_detector.parameters import refuse
from slip_detector.view.access import Access, Connections
from slip_detector.view.detectors import Detectors, Finger
from slip_detector.view.messages import Message, check
from slip_detector.view.track import LiveTrack
from slip_detector.view.view_request import Pace, ViewRequest

#: Shortest time between two frames, in seconds.
FRAME_S = 1 / 30

#: Period of the server's loop, in seconds, while no page is open and no finger is recorded.
IDLE_S = 0.2

#: A page is closed if for so many seconds it has answered no ping, or has not read what it was
#: sent. A connection is closed if it sends no request in this time.
PING_S = 10.0

#: Longest time, in seconds, for which the server waits at its end for pages to have heard of it.
GOODBYE_S = 1.0

#: Longest message of a page, in bytes.
MOST_BYTES = 1 << 18

#: Most requests of a page that wait for an answer. While there are so many, no more are read.
MOST_UNANSWERED = 16

#: Most characters of the name of a page, which is kept with what it has changed.
MOST_NAME = 40

#: Most pages that are open at once.
MOST_PAGES = 32

#: Most pages that keep a copy of a finger's last minute (64 MB with 900 channels) while they are
#: paused. Those paused later keep what they have drawn.
MOST_PAUSED = 4

#: Where the files of the page are, and those that it shares with the report.
PACKAGE = Path(__file__).parents[1]
FOLDERS = {'page': PACKAGE / 'view' / 'page', 'drawing': PACKAGE / 'report' / 'templates'}

HEADERS = {
    # The only picture is the icon, which is in the page itself.
    'Content-Security-Policy': "default-src 'self'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; object-src 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cache-Control': 'no-cache',
}

TOO_MANY = f'{MOST_PAGES} pages are open, as many as there can be: close one'

NO_TOKEN = 'this address lacks its token: open the one that slip_view has printed'

READ_ONLY = 'slip_view was started with --read-only: nothing can be changed from a page'

REPLACED = 'a later request of this page has taken its place'

LOG = logging.getLogger(__name__)

T = TypeVar('T')

#: Answers a request of a page. Its parameters have the names of the fields of the message that it
#: needs, and get None for one that the message lacks; ``finger`` is a finger that there is or was.
#: It returns what the page gets, None if "done" is all there is to say, or raises a ValueError
#: that says why not.
Answer = Callable[..., Awaitable[Mapping[str, Any] | None]]


def make_one_line(record: logging.LogRecord) -> bool:
    """Make one line of a record, whatever a page has sent: of an error, what it is and where."""
    text = record.getMessage()
    if record.exc_info and record.exc_info[1]:
        calls = reversed(traceback.extract_tb(record.exc_info[2]))
        where = ' < '.join(f'{Path(each.filename).name}:{each.lineno}' for each in calls)
        text = f'{text}: {record.exc_info[1]!r} at {where}'
    record.msg, record.args, record.exc_info = one_line(text), (), None
    return True


class Server:
    """Serves the live page and keeps all open pages up to date."""

    def __init__(self, detectors: Detectors, access: Access) -> None:
        self.detectors, self.access = detectors, access
        #: By purpose, the fingers that are watched even if no page shows them.
        self.wanted: dict[str, set[str]] = {}
        #: Called after each poll of the detectors, at most 30 times a second.
        self.each_tick: list[Callable[[], None]] = []
        #: Awaited before the pages are closed.
        self.at_end: list[Callable[[], Awaitable[None]]] = []
        self.pages: set[LivePage] = set()
        #: By name what answers a request of a page; and the names of those that change something.
        self.requests: dict[str, Answer] = {}
        self.changing: set[str] = set()
        self._worker = ThreadPoolExecutor(1, 'slow requests')
        self.on_requests(self, 'keep_rest', changes=True)
        #: By topic the present content.
        self.news: dict[str, str] = {}
        application = web.Application(
            [
                ('/live', LivePage),
                ('/()', File, {'path': FOLDERS['page'], 'default_filename': 'index.html'}),
                *((rf'/{name}/([\w./]+)', File, {'path': path}) for name, path in FOLDERS.items()),
            ],
            server=self,
            websocket_max_message_size=MOST_BYTES,
        )
        self._http = HTTPServer(
            application,
            max_body_size=MOST_BYTES,
            idle_connection_timeout=PING_S,
            body_timeout=PING_S,
        )
        self.connections = Connections(self._http)

    def on_requests(self, answering: object, *names: str, changes: bool = False) -> None:
        """Let a method ``answer_NAME`` answer the requests of each name.

        ``changes`` says whether they change the robot, a file, or what other pages see. If not, a
        page needs an answer only to the latest one, and none after it has left. The method does
        what takes long by :meth:`work`.
        """
        for name in names:
            self.requests[name] = getattr(answering, f'answer_{name}')
            if changes:
                self.changing.add(name)

    async def work(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return the result of a function that takes long, beside the loop, one at a time.

        It is not begun if the request is cancelled before.
        """
        return await asyncio.get_running_loop().run_in_executor(self._worker, function, *arguments)

    def broadcast(self, topic: str, content: Mapping[str, Any]) -> None:
        """Send this content to all pages, also to those that are opened later.

        Nothing is sent if the content has not changed. A slow page gets only the latest content.
        """
        text = json.dumps({'type': topic, **content}, allow_nan=False)
        if self.news.get(topic) != text:
            self.news[topic] = text

    def listen(self, port: int) -> int:
        """Listen at the port, 0 for any that is free, and return it.

        Raises
        ------
        OSError
            When the port is not available.
        """
        # A malformed request is answered with its error; it need not be in a robot's log.
        for name in ('tornado.access', 'tornado.general'):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        for name in ('tornado.application', 'asyncio', __name__):
            logging.getLogger(name).addFilter(make_one_line)
        return self.connections.listen(port, self.access.host)

    async def run(self, stop: asyncio.Event | threading.Event) -> None:
        """Poll the detectors and send frames until the event is set; then close all pages."""
        try:
            while not stop.is_set():
                begin_s = time.monotonic()
                self.tick()
                period_s = FRAME_S if self.pages or any(self.wanted.values()) else IDLE_S
                await asyncio.sleep(max(0.001, begin_s + period_s - time.monotonic()))
        finally:
            await self.close()

    def tick(self) -> None:
        """Poll the detectors, and send each page what is new to it."""
        viewed = {name for page in self.pages if page.view for name in page.view.fingers}
        self.detectors.watch(viewed.union(*self.wanted.values()))
        self.detectors.poll()
        for call in self.each_tick:
            call()
        fingers = sorted(self.detectors.fingers.values(), key=lambda finger: finger.name)
        gone = {name: each.label for name, each in self.detectors.gone.items()}
        described = {'fingers': [finger.description() for finger in fingers], 'gone': gone}
        self.broadcast('fingers', {**described, 'read_only': self.access.read_only})
        # A finger whose recording stands still gets no samples, which is no fault.
        lines = {each.name: () if each.paused else each.diagnostics for each in fingers}
        self.broadcast('diagnostics', {'fingers': lines})
        for page in list(self.pages):
            try:
                page.send_news()
            except Exception:
                # The other pages and the recording go on.
                LOG.exception('a page cannot be sent to')
                page.close(1011, 'slip_view has failed at this page, its log says where')

    async def close(self) -> None:
        """Stop listening, and close the connections."""
        for end in self.at_end:
            await end()
        await self.connections.stop_listening()
        for page in list(self.pages):
            page.close(1001, 'slip_view was stopped')
        # A page that sends into a closed connection does not learn why it was closed: wait for it.
        until_s = time.monotonic() + GOODBYE_S
        while self.pages and time.monotonic() < until_s:
            await asyncio.sleep(0.01)
        await self._http.close_all_connections()
        self._worker.shutdown(wait=False, cancel_futures=True)

    async def answer(self, message: Message) -> dict[str, Any]:
        """Answer a request of a page."""
        answer = {'type': 'answer', 'id': message.get('id'), 'refusal': ''}
        name = str(message.get('type'))
        try:
            json.dumps(message, ensure_ascii=False).encode()  # No halves of characters.
            check(message)
            if name not in self.requests:
                refuse(f'{name[:40]} is no request', ', '.join(sorted(self.requests)))
            if name in self.changing and self.access.read_only:
                raise ValueError(READ_ONLY)
            function = self.requests[name]
            fields = {each: message.get(each) for each in inspect.signature(function).parameters}
            if 'finger' in fields:
                fields['finger'] = self.detectors.finger_of(fields['finger'])
            answer.update(await function(**fields) or {})
        except (ValueError, RecursionError) as error:
            answer['refusal'] = str(error)
        except asyncio.CancelledError:
            answer['refusal'] = REPLACED
        except Exception as error:
            # The page must not wait for ever.
            LOG.exception('a request failed: %s', name)
            answer['refusal'] = f'slip_view has failed at this, its log says where: {error!r}'
        return {**answer, 'refusal': one_line(answer['refusal'])}

    async def change(self, finger: Finger, values: Mapping[str, Any], page: str | None) -> None:
        """Set parameters of a finger's detector, if any, for a page; may raise a ValueError."""
        if values:
            await self.detectors.change(finger.name, values, f'page {page}'[:MOST_NAME])

    async def answer_keep_rest(self, finger: Finger) -> None:
        """Keep the present spectra of a finger as those at rest."""
        await self.work(finger.keep_rest)


class _Guarded(web.RequestHandler):
    """Refuses requests that do not come from the page itself, or lack the token."""

    @property
    def server(self) -> Server:
        """What this request is sent to."""
        return self.settings['server']  # type: ignore[no-any-return]

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
        if not why and self.request.path == '/live' and len(self.server.pages) >= MOST_PAGES:
            why = TOO_MANY
        if why:
            self.set_status(403)
            self.set_header('Content-Type', 'text/plain; charset=utf-8')
            self.finish(f'{why}\n')


class File(_Guarded, web.StaticFileHandler):
    """A file of the page."""


class LivePage(_Guarded, websocket.WebSocketHandler):
    """One open page."""

    def initialize(self) -> None:
        """Begin without a view."""
        self.view: ViewRequest | None = None
        #: While the page is paused, a copy of what its finger's track was then.
        self.past: LiveTrack | None = None
        #: By topic the content that it was sent last.
        self._told: dict[str, str] = {}
        self._is_drawing = False
        self._pace, self._sent_s = Pace(), 0.0
        self._sending: asyncio.Future[None] | None = None
        #: When the page last answered a ping and had read all that it was sent.
        self._alive_s = time.monotonic()
        self._answers: set[asyncio.Task[None]] = set()
        #: By name of the requests that change nothing, the task that answers the latest one.
        self._latest: dict[str, asyncio.Task[None]] = {}

    def open(self, *args: str, **kwargs: str) -> None:
        """Add the page to those that get news."""
        self.set_nodelay(True)
        self.server.pages.add(self)
        self._stream: Any = getattr(self.ws_connection, 'stream', None)
        if self._stream in self.server.connections.strangers:
            self.server.connections.strangers.remove(self._stream)

    def on_close(self) -> None:
        """Forget the page."""
        self.server.pages.discard(self)
        self.past = None
        for task in self._latest.values():
            task.cancel()

    def on_pong(self, data: bytes) -> None:
        """Note that the page reads, unless it answers without having read all."""
        if not self._stream.writing():
            self._alive_s = time.monotonic()

    async def on_message(self, message: str | bytes) -> None:
        """Handle a message of the page; until this has returned no other is read."""
        try:
            content = json.loads(message)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self.close(1003, 'no JSON object')
        elif content.get('type') == 'drawn':
            if self.view is not None and self._is_drawing:
                self._pace.drawn(time.monotonic() - self._sent_s, self.view.is_whole)
            self._is_drawing = False
        elif content.get('type') == 'view':
            self._change_view(content)
        else:
            if len(self._answers) >= MOST_UNANSWERED:
                await asyncio.wait(self._answers, return_when=asyncio.FIRST_COMPLETED)
            task = asyncio.create_task(self._answer(content))
            self._answers.add(task)
            task.add_done_callback(self._answers.discard)
            name = str(content.get('type'))
            if name in self.server.requests.keys() - self.server.changing:
                if before := self._latest.get(name):
                    before.cancel()
                self._latest[name] = task
            await asyncio.sleep(0)  # One that has begun is answered also when it is cancelled.

    def _change_view(self, content: Message) -> None:
        try:
            self.view = ViewRequest(content) if content.get('fingers') else None
        except (ValueError, RecursionError) as error:
            self.close(1003, one_line(error)[:30])  # A reason has at most 123 bytes.
            return
        self._sent_s = time.monotonic()  # A page that was hidden was not slow.
        # A pause may last longer than the track: keep what the page shows.
        paused = sum(page.past is not None for page in self.server.pages)
        if self.view is None or self.view.until_ns is None:
            self.past = None
        elif self.past is None and paused < MOST_PAUSED:
            finger = self.server.detectors.fingers.get(self.view.finger)
            self.past = copy.deepcopy(finger.track) if finger else None

    async def _answer(self, content: Message) -> None:
        await self._send([json.dumps(await self.server.answer(content))])

    def send_news(self) -> None:
        """Send what is new, unless something is still being sent; close a page that is gone."""
        if time.monotonic() - self._alive_s > PING_S:
            self._stream.close()
        if self._sending is not None and not self._sending.done():
            return
        content: list[str | bytes] = []
        # The page has to draw a frame before it gets the next one, and more news.
        if self.view is None or not self._is_drawing:
            news = self.server.news
            content = [text for topic, text in news.items() if text is not self._told.get(topic)]
            self._told = dict(news)
            if self.view is not None:
                self._is_drawing, self._sent_s = True, time.monotonic()
                content.append(self.view.frame(self.server.detectors, self.past, self._pace.join))
        self._sending = asyncio.ensure_future(self._send(content))

    async def _send(self, content: Sequence[str | bytes]) -> None:
        # The page may close meanwhile, which is no error.
        with contextlib.suppress(websocket.WebSocketClosedError):
            if time.monotonic() - self._alive_s > PING_S / 2:
                self.ping()
            for each in content:
                await self.write_message(each, binary=isinstance(each, bytes))
