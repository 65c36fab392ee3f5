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

"""Views the live page in Chromium, or by a program that takes frames and draws nothing.

The program stands for a browser on another machine: only the costs of slip_view arise here.
"""

import asyncio
import contextlib
import json
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from tornado.websocket import websocket_connect

from benchmarks.tune.browser import PATIENCE_MS, browser

#: Size of the browser's window, as on a laptop.
WIDTH, HEIGHT = 1366, 768

#: What the page asks for when it opens, of four channels.
VIEW = {'type': 'view', 'channels': [1, 2, 3, 4], 'window_s': 10.0, 'pixels': 900}

#: Time for an answer of the page's server.
ANSWER_S = 60.0

#: Script that notes when each frame is drawn, which the page reports to the server.
NOTE_FRAMES = """
  const send = WebSocket.prototype.send;
  window.drawnMs = [];
  WebSocket.prototype.send = function (message) {
    if (String(message).includes('"drawn"')) drawnMs.push(performance.now());
    return send.call(this, message);
  };
"""


def frames_a_second(drawn_ms: list[float]) -> tuple[float, float]:
    """Return the number of frames drawn in a second: the mean, and the least of all seconds.

    Parameters
    ----------
    drawn_ms
        When each was drawn.

    Examples
    --------
    >>> frames_a_second([0, 100, 200, 1000, 1500, 2000])
    (2.5, 2.0)
    """
    times_s = np.asarray(drawn_ms) / 1e3
    if len(times_s) < 2 or times_s[-1] - times_s[0] < 1.0:
        return 0.0, 0.0
    counts = np.bincount((times_s - times_s[0]).astype(int))[:-1]
    return float((len(times_s) - 1) / (times_s[-1] - times_s[0])), float(counts.min())


class NoViewer:
    """Stands for a viewer in turns in which no page is open."""

    def is_drawing(self) -> bool:
        """Return whether the state to be measured has begun."""
        return True

    def drawn_ms(self) -> list[float]:
        """Return when each frame was drawn since the last call."""
        return []

    def heap_mib(self) -> float | None:
        """Return the memory of the page's objects; None if it is not known."""
        return None


class Onlooker(NoViewer):
    """A connection that takes frames of so many fingers as fast as they come."""

    def __init__(self, url: str, fingers: int) -> None:
        self._address = url.replace('http', 'ws') + 'live'
        self._fingers = fingers
        self._drawn_ms: list[float] = []
        self._stop = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> 'Onlooker':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def is_drawing(self) -> bool:
        """Return whether frames come."""
        if self._error is not None:
            raise RuntimeError(f'the page cannot be viewed: {self._error!r}')
        return bool(self._drawn_ms)

    def drawn_ms(self) -> list[float]:
        """Return when each frame was taken since the last call."""
        taken, self._drawn_ms = self._drawn_ms, []
        return taken

    def _run(self) -> None:
        try:
            asyncio.run(self._take_frames())
        except (OSError, ValueError, asyncio.TimeoutError) as error:
            self._error = error

    async def _take_frames(self) -> None:
        socket = await websocket_connect(self._address)
        while not self._stop.is_set():
            message = await asyncio.wait_for(socket.read_message(), ANSWER_S)
            if message is None:
                raise ValueError(socket.close_reason or 'the connection was closed')
            if isinstance(message, bytes):
                self._drawn_ms.append(1e3 * time.monotonic())
                await socket.write_message('{"type": "drawn"}')
                continue
            content = json.loads(message)
            if content['type'] == 'fingers' and len(content['fingers']) == self._fingers:
                names = [finger['name'] for finger in content['fingers']]
                view = {**VIEW, 'fingers': names, 'finger': names[0]}
                await socket.write_message(json.dumps(view))
        socket.close()
        while await socket.read_message() is not None:
            pass


class Browser(NoViewer):
    """The page as it opens, in Chromium.

    Parameters
    ----------
    page
        Of Playwright.
    """

    def __init__(self, page: Any) -> None:
        self._page = page
        self._session = page.context.new_cdp_session(page)
        self._session.send('Performance.enable')

    def is_drawing(self) -> bool:
        """Return whether frames are drawn."""
        return bool(self._page.evaluate('drawnMs.length'))

    def drawn_ms(self) -> list[float]:
        """Return when each frame was drawn since the last call."""
        drawn: list[float] = self._page.evaluate('drawnMs.splice(0)')
        return drawn

    def heap_mib(self) -> float | None:
        """Return the memory of the page's objects after a garbage collection."""
        self._session.send('HeapProfiler.collectGarbage')
        metrics = self._session.send('Performance.getMetrics')['metrics']
        used = {metric['name']: metric['value'] for metric in metrics}['JSHeapUsedSize']
        return float(used) / 2**20


@contextlib.contextmanager
def chromium(url: str, fingers: int) -> Iterator[Browser]:
    """Open the page in Chromium, and close it.

    Parameters
    ----------
    url
        Address of the page.
    fingers
        How many it waits for.
    """
    with browser() as running:
        page = running.new_page(viewport={'width': WIDTH, 'height': HEIGHT})
        page.add_init_script(NOTE_FRAMES)
        page.goto(url)
        cards = page.locator('#fingers article')
        cards.nth(fingers - 1).wait_for(timeout=PATIENCE_MS)
        yield Browser(page)
        page.close()
