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

"""The processes of the measurement: a hand, slip_view, and Chromium with its page."""

import contextlib
import os
import socket
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.processes import nodes_running
from benchmarks.soak.hand import Watch, growth_percent, hand_commands
from benchmarks.view.browser import PATIENCE_MS, browser

FINGERS = 5

#: slip_view shows all detectors of its domain. The tests have 1 to 100.
DOMAIN = '101'

#: Time before the measurement, in which traces fill their window and compiling ends; for a short
#: measurement, a share of it.
SETTLE_S, SETTLE_SHARE = 15.0, 0.2

#: Size of the browser's window, as on a laptop.
WIDTH, HEIGHT = 1366, 768

#: Script that notes when each frame is drawn, which the page reports to the server.
NOTE_FRAMES = """
  const send = WebSocket.prototype.send;
  window.drawnMs = [];
  WebSocket.prototype.send = function (message) {
    if (String(message).includes('"drawn"')) drawnMs.push(performance.now());
    return send.call(this, message);
  };
"""


def run_view(seconds: float, pairs: int, turn_seconds: float, traces: int) -> dict[str, Any]:
    """Run everything; see :mod:`benchmarks.view.command` for the figures.

    As other load of the machine varies, pairs of turns without the page and with it alternate. The
    last turn, for ``seconds``, comes when slip_view has allocated what it keeps of each finger.
    """
    os.environ['ROS_DOMAIN_ID'] = DOMAIN
    namespace, port = f'/slip_view_{os.getpid()}', free_port()
    url = f'http://127.0.0.1:{port}/'
    with tempfile.TemporaryDirectory() as folder:
        driver = ['-p', 'loop:=true', '-p', 'wait_for_subscribers:=1', '-p', 'source:=scene']
        commands = hand_commands(namespace, FINGERS, [], driver)
        commands['slip_view'] = [
            *(sys.executable, '-m', 'slip_detector.nodes.run', 'slip_view', '--port', str(port)),
            *('--folder', str(Path(folder) / 'recordings')),
        ]
        with nodes_running(commands) as processes:
            watch = Watch(namespace, processes)
            watch.wait_for(lambda: watch.have_samples(FINGERS), 'samples of all fingers')
            closed, here = [], []
            for _ in range(pairs):
                watch.wait(min(SETTLE_S, SETTLE_SHARE * turn_seconds))
                closed.append(watch.figures(turn_seconds))
                here.append(measure_page(watch, url, turn_seconds, traces))
            here.append(measure_page(watch, url, seconds, traces))
    figures = {'closed': _of_all(closed), 'here': here[-1] | _of_all(here)}
    ratio = figures['here']['latency_median_ms'] / figures['closed']['latency_median_ms']
    figures['here'] |= {
        'latency_ratio': ratio,
        'frames_a_second': float(np.mean([turn['frames_a_second'] for turn in here])),
    }
    return figures


def free_port() -> int:
    """Return a free port of this machine.

    Examples
    --------
    >>> free_port() > 1023
    True
    """
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def measure_page(watch: Watch, url: str, seconds: float, traces: int) -> dict[str, Any]:
    """Return the figures of a turn in which Chromium shows the page with so many traces."""
    drawn_ms: list[float] = []
    heap_mib: list[float] = []
    with chromium(url, traces) as page:

        def note() -> None:
            drawn_ms.extend(page.evaluate('drawnMs.splice(0)'))
            heap_mib.append(heap_mib_of(page))

        watch.wait_for(lambda: page.evaluate('drawnMs.length'), 'a frame')
        watch.wait(min(SETTLE_S, SETTLE_SHARE * seconds))
        page.evaluate('drawnMs.splice(0)')
        figures = watch.figures(seconds, note)
    return figures | {
        'frames_a_second': frames_a_second(drawn_ms),
        'memory_mib': figures['memory_mib']['slip_view'],
        'memory_growth_percent': figures['memory_growth_percent']['slip_view'],
        'heap_mib': heap_mib[-1],
        'heap_growth_percent': growth_percent(heap_mib),
    }


def _of_all(turns: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the median latency of turns, and the mean of the processor time of each process."""
    percent = {
        name: float(np.mean([turn['cpu_percent'][name] for turn in turns]))
        for name in turns[0]['cpu_percent']
    }
    latency_ms = float(np.median([turn['latency_median_ms'] for turn in turns]))
    return {
        'latency_median_ms': latency_ms,
        'cpu_percent': percent,
        'slip_view_cpu_percent': percent['slip_view'],
    }


@contextlib.contextmanager
def chromium(url: str, traces: int) -> Iterator[Any]:
    """Open the page in Chromium, wait until it has all fingers, and close it at the end."""
    with browser() as running:
        page = running.new_page(viewport={'width': WIDTH, 'height': HEIGHT})
        page.add_init_script(NOTE_FRAMES)
        page.goto(url)
        page.locator('#fingers article').nth(FINGERS - 1).wait_for(timeout=PATIENCE_MS)
        more = page.locator('#chooser [aria-pressed=false]')
        for _ in range(page.locator('#chooser [aria-pressed=true]').count(), traces):
            more.first.click()
        yield page
        page.close()


def heap_mib_of(page: Any) -> float:
    """Return the memory of a page's objects after a garbage collection."""
    session = page.context.new_cdp_session(page)
    session.send('Performance.enable')
    session.send('HeapProfiler.collectGarbage')
    metrics = session.send('Performance.getMetrics')['metrics']
    session.detach()
    return float({one['name']: one['value'] for one in metrics}['JSHeapUsedSize']) / 2**20


def frames_a_second(drawn_ms: list[float]) -> float:
    """Return the mean number of frames in a second, from the time at which each was drawn.

    Examples
    --------
    >>> frames_a_second([0, 100, 200, 1000, 1500, 2000])
    2.5
    """
    lasted_s = (drawn_ms[-1] - drawn_ms[0]) / 1e3 if drawn_ms else 0.0
    return (len(drawn_ms) - 1) / lasted_s if lasted_s >= 1.0 else 0.0
