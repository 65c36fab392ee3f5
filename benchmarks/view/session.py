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
import json
import os
import socket
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from benchmarks.processes import nodes_running, print_figures, processor_time_s
from benchmarks.soak.hand import START_TIMEOUT_S, Watch, hand_commands, memory_growth
from benchmarks.tune.browser import PATIENCE_MS, browser
from slip_detector.nodes.health import AGE_KEYS

FINGERS = 5

#: Time before the measurement, in which traces fill their window and compiling ends; for a short
#: measurement, a share of it.
SETTLE_S, SETTLE_SHARE = 15.0, 0.2

#: Size of the browser's window, as on a laptop.
WIDTH, HEIGHT = 1366, 768

#: Period at which the memory of the page's objects is read.
HEAP_S = 5.0


#: Script that notes when each frame is drawn, which the page reports to the server.
NOTE_FRAMES = """
  const send = WebSocket.prototype.send;
  window.drawnMs = [];
  WebSocket.prototype.send = function (message) {
    if (String(message).includes('"drawn"')) drawnMs.push(performance.now());
    return send.call(this, message);
  };
"""


def run_view(seconds: float, pairs: int, turn_seconds: float) -> dict[str, Any]:
    """Run everything; see :mod:`benchmarks.view.command` for the figures.

    As other load of the machine varies, pairs of turns without the page and with it alternate. The
    last turn, for ``seconds``, comes when slip_view has allocated what it keeps of each finger.
    """
    namespace, port = f'/slip_view_{os.getpid()}', free_port()
    url = f'http://127.0.0.1:{port}/'
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with tempfile.TemporaryDirectory() as folder:
            driver = ['-p', 'loop:=true', '-p', 'wait_for_subscribers:=1', '-p', 'source:=scene']
            commands = hand_commands(namespace, FINGERS, [], driver)
            commands['slip_view'] = [
                *(sys.executable, '-m', 'slip_detector.nodes.view', '--port', str(port)),
                *('--folder', str(Path(folder) / 'recordings')),
            ]
            with nodes_running(commands) as processes:
                watch = Watch(namespace, processes)
                turns = Turns(watch, url, {name: each.pid for name, each in processes.items()})
                start_s = time.monotonic() + START_TIMEOUT_S
                watch.spin(lambda: watch.has_samples(FINGERS), start_s, 'samples of all fingers')
                for _ in range(pairs):
                    turns.measure('closed', turn_seconds)
                    turns.measure('here', turn_seconds)
                turns.measure('here', seconds)
                return {
                    'fingers': FINGERS,
                    **figures_of_turns(turns.turns, watch.reports, watch.memory_kib),
                }
    finally:
        rclpy.try_shutdown()


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


class Turns:
    """Runs turns without the page (``closed``) and with it (``here``), and notes their costs."""

    def __init__(self, watch: Watch, url: str, pids: dict[str, int]) -> None:
        self._watch, self._url, self._pids = watch, url, pids
        self._spin = watch.spin
        self.turns: list[dict[str, Any]] = []

    def measure(self, who: str, seconds: float) -> None:
        """Let nobody or the browser view the page for some time."""
        with contextlib.ExitStack() as stack:
            page = stack.enter_context(chromium(self._url)) if who == 'here' else None
            end_s = time.monotonic() + START_TIMEOUT_S
            self._spin(lambda: not page or page.evaluate('drawnMs.length'), end_s, 'a frame')
            self._wait(min(SETTLE_S, SETTLE_SHARE * seconds))
            drawn_ms: list[float] = []
            heap_mib: list[tuple[float, float]] = []
            if page:
                page.evaluate('drawnMs.splice(0)')
                heap_mib.append((0.0, heap_mib_of(page)))
            nodes = self._pids.values()
            before_s, browser_s = self._used_s(), children_s(nodes)
            begin_s = time.monotonic()
            while time.monotonic() < begin_s + seconds:
                left_s = begin_s + seconds - time.monotonic()
                self._wait(min(HEAP_S, left_s))
                if page:
                    drawn_ms += page.evaluate('drawnMs.splice(0)')
                    heap_mib.append((time.monotonic() - begin_s, heap_mib_of(page)))
            end_s = time.monotonic()
            after_s = self._used_s()
            browser_s = children_s(nodes) - browser_s
        self.turns.append(
            {
                'who': who,
                'begin_s': begin_s,
                'end_s': end_s,
                'used_s': {name: after_s[name] - before_s[name] for name in before_s},
                'browser_s': browser_s,
                'drawn_ms': drawn_ms,
                'heap_mib': heap_mib,
            }
        )

    def _wait(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        self._spin(lambda: time.monotonic() >= end_s, end_s + START_TIMEOUT_S, 'the end')

    def _used_s(self) -> dict[str, float]:
        return {name: processor_time_s(pid) for name, pid in self._pids.items()}


@contextlib.contextmanager
def chromium(url: str) -> Iterator[Any]:
    """Open the page in Chromium, wait until it has all fingers, and close it at the end."""
    with browser() as running:
        page = running.new_page(viewport={'width': WIDTH, 'height': HEIGHT})
        page.add_init_script(NOTE_FRAMES)
        page.goto(url)
        page.locator('#fingers article').nth(FINGERS - 1).wait_for(timeout=PATIENCE_MS)
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


def figures_of_turns(
    turns: Sequence[dict[str, Any]],
    reports: dict[str, list[tuple[float, dict[str, str]]]],
    memory_kib: dict[str, list[tuple[float, int]]],
) -> dict[str, Any]:
    """Compute the figures of each kind of turn over all of the kind."""
    latencies = [_latency_ms(turn, reports) for turn in turns]
    figures: dict[str, Any] = {}
    for who in dict.fromkeys(turn['who'] for turn in turns):
        own = [i for i, turn in enumerate(turns) if turn['who'] == who]
        span_s = sum(turns[i]['end_s'] - turns[i]['begin_s'] for i in own)
        figures[who] = {
            'seconds': span_s,
            'latency_median_ms': float(np.median([latencies[i] for i in own])),
            'cpu_percent': {
                name: 100 * sum(turns[i]['used_s'][name] for i in own) / span_s
                for name in turns[0]['used_s']
            },
        }
        figures[who]['slip_view_cpu_percent'] = figures[who]['cpu_percent']['slip_view']
    drawn = [frames_a_second(turn['drawn_ms']) for turn in turns if turn['who'] == 'here']
    here = turns[-1]
    figures['here'] |= {
        'latency_ratio': figures['here']['latency_median_ms']
        / figures['closed']['latency_median_ms'],
        'frames_a_second': float(np.mean([mean for mean, _ in drawn])),
        'frames_in_the_worst_second': min(worst for _, worst in drawn),
        'browser_cpu_percent': 100 * here['browser_s'] / (here['end_s'] - here['begin_s']),
        'memory_mib': memory_kib['slip_view'][-1][1] / 1024,
        'memory_growth_percent': 100
        * memory_growth(memory_kib['slip_view'], here['begin_s'], here['end_s']),
        'heap_mib': here['heap_mib'][-1][1],
        'heap_growth_percent': 100
        * memory_growth(here['heap_mib'], -1.0, here['end_s'] - here['begin_s'] + HEAP_S),
    }
    return figures


def _latency_ms(
    turn: dict[str, Any], reports: dict[str, list[tuple[float, dict[str, str]]]]
) -> float:
    """Return the median of the medians of all seconds of a turn."""
    during = [
        float(values[AGE_KEYS[0]])
        for of_one in reports.values()
        for at_s, values in of_one
        # A report covers the second before it.
        if turn['begin_s'] + 1.0 < at_s <= turn['end_s'] and values[AGE_KEYS[0]] != '-'
    ]
    if not during:
        raise RuntimeError(f'the detectors reported no samples in the turn {turn["who"]}')
    return float(np.median(during))


def children_s(but: Collection[int], of: int | None = None) -> float:
    """Return the processor time of the descendants of a process, except some and their own.

    Parameters
    ----------
    but
        Processes that are left out, with their descendants.
    of
        The process; None: this one.
    """
    total_s = 0.0
    with contextlib.suppress(OSError):  # A process may end at any time.
        for task in Path(f'/proc/{of or os.getpid()}/task').iterdir():
            for pid in map(int, (task / 'children').read_text().split()):
                if pid not in but:
                    total_s += processor_time_s(pid) + children_s(but, pid)
    return total_s


if __name__ == '__main__':
    sys.exit(print_figures(lambda: run_view(**json.loads(sys.argv[1]))))
