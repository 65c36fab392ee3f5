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

"""The processes of the measurement: a hand, slip_view, and the viewers of its page."""

import argparse
import contextlib
import os
import socket
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from benchmarks.processes import nodes_running, print_figures, processor_time_s
from benchmarks.soak.hand import START_TIMEOUT_S, Watch, hand_commands, memory_growth
from benchmarks.view.onlookers import NoViewer, Onlooker, chromium, frames_a_second
from slip_detector.nodes.health import AGE_KEYS

FINGERS = 5

#: Time before the measurement, in which traces fill their window and compiling ends; for a short
#: measurement, a share of it.
SETTLE_S, SETTLE_SHARE = 15.0, 0.2

#: Period at which the memory of the page's objects is read.
HEAP_S = 5.0


def run_view(seconds: float, pairs: int, turn_seconds: float) -> dict[str, Any]:
    """Run everything; see :mod:`benchmarks.view.measure`.

    As other load of the machine varies, turns with and without a page alternate. The browser comes
    last, when slip_view has allocated what it keeps of each finger.

    Parameters
    ----------
    seconds
        How long the page is open in the browser.
    pairs, turn_seconds
        How many pairs of other turns there are before, and how long each is.

    Returns
    -------
    dict
        The figures.

    Raises
    ------
    RuntimeError
        When a process ends too early or does not report in time.
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
                turns.start()
                for who in (*('closed', 'elsewhere') * pairs, 'here'):
                    turns.measure(who, seconds if who == 'here' else turn_seconds)
                return {'fingers': FINGERS, **turns.figures()}
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
    """Alternates turns without a viewer, with a program and with a browser; notes their costs."""

    def __init__(self, watch: Watch, url: str, pids: dict[str, int]) -> None:
        self._watch, self._url, self._pids = watch, url, pids
        self._spin: Callable[[Callable[[], bool], float, str], None] = watch.spin
        self.turns: list[dict[str, Any]] = []

    def start(self) -> None:
        """Wait until everything runs."""
        end_s = time.monotonic() + START_TIMEOUT_S
        self._spin(lambda: self._watch.has_samples(FINGERS), end_s, 'samples of all fingers')
        self._spin(lambda: answers(self._url), end_s, 'the page')

    def measure(self, who: str, seconds: float) -> None:
        """Let one of them view the page for some time."""
        with contextlib.ExitStack() as stack:
            onlooker = NoViewer()
            if who == 'elsewhere':
                onlooker = stack.enter_context(Onlooker(self._url, FINGERS))
            elif who == 'here':
                onlooker = stack.enter_context(chromium(self._url, FINGERS))
            now_s = time.monotonic()
            self._spin(onlooker.is_drawing, now_s + START_TIMEOUT_S, 'the first frame')
            self._wait(min(SETTLE_S, SETTLE_SHARE * seconds))
            onlooker.drawn_ms()
            heap_mib = [(0.0, onlooker.heap_mib())]
            nodes = self._pids.values()
            before_s, browser_s = self._used_s(), children_s(nodes)
            begin_s = time.monotonic()
            drawn_ms: list[float] = []
            while time.monotonic() < begin_s + seconds:
                left_s = begin_s + seconds - time.monotonic()
                self._wait(min(HEAP_S, left_s))
                drawn_ms += onlooker.drawn_ms()
                heap_mib.append((time.monotonic() - begin_s, onlooker.heap_mib()))
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
                'heap_mib': [(at_s, mib) for at_s, mib in heap_mib if mib is not None],
            }
        )

    def _wait(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        self._spin(lambda: time.monotonic() >= end_s, end_s + START_TIMEOUT_S, 'the end')

    def _used_s(self) -> dict[str, float]:
        return {name: processor_time_s(pid) for name, pid in self._pids.items()}

    def figures(self) -> dict[str, Any]:
        """Return the figures of all turns; see :mod:`benchmarks.view.measure`."""
        return figures_of_turns(self.turns, self._watch.reports, self._watch.memory_kib)


def figures_of_turns(
    turns: Sequence[dict[str, Any]],
    reports: dict[str, list[tuple[float, dict[str, str]]]],
    memory_kib: dict[str, list[tuple[float, int]]],
) -> dict[str, Any]:
    """Compute the figures of each kind of viewer over all its turns."""
    latencies = [_latency_ms(turn, reports) for turn in turns]
    figures: dict[str, Any] = {}
    for who in dict.fromkeys(turn['who'] for turn in turns):
        own = [i for i, turn in enumerate(turns) if turn['who'] == who]
        span_s = sum(turns[i]['end_s'] - turns[i]['begin_s'] for i in own)
        median_ms, p99_ms = np.median([latencies[i] for i in own], axis=0)
        figures[who] = {
            'seconds': span_s,
            'latency_median_ms': float(median_ms),
            'latency_p99_ms': float(p99_ms),
            'cpu_percent': {
                name: 100 * sum(turns[i]['used_s'][name] for i in own) / span_s
                for name in turns[0]['used_s']
            },
        }
        figures[who]['slip_view_cpu_percent'] = figures[who]['cpu_percent']['slip_view']
        if who != 'closed':
            drawn = [frames_a_second(turns[i]['drawn_ms']) for i in own]
            figures[who]['frames_a_second'] = float(np.mean([mean for mean, _ in drawn]))
            figures[who]['frames_in_the_worst_second'] = min(worst for _, worst in drawn)
    closed_ms = [latencies[i][0] for i, turn in enumerate(turns) if turn['who'] == 'closed']
    for who in set(figures) - {'closed'}:
        figures[who]['latency_ratio'] = (
            figures[who]['latency_median_ms'] / figures['closed']['latency_median_ms']
        )
    figures['closed']['latency_noise'] = max(closed_ms) / min(closed_ms)
    (here,) = (turn for turn in turns if turn['who'] == 'here')
    figures['here'] |= {
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
) -> tuple[float, float]:
    """Return the medians of the median and of the 99th percentile of all seconds of a turn."""
    during = [
        (float(values[AGE_KEYS[0]]), float(values[AGE_KEYS[1]]))
        for of_one in reports.values()
        for at_s, values in of_one
        # A report covers the second before it.
        if turn['begin_s'] + 1.0 < at_s <= turn['end_s'] and values[AGE_KEYS[1]] != '-'
    ]
    if not during:
        raise RuntimeError(f'the detectors reported no samples in the turn {turn["who"]}')
    median_ms, p99_ms = np.median(during, axis=0)
    return float(median_ms), float(p99_ms)


def answers(url: str) -> bool:
    """Return whether the page is served."""
    try:
        with urllib.request.urlopen(url, timeout=1.0) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False


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


def main() -> int:
    """Run the measurement, and print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--pairs', type=int, default=5)
    parser.add_argument('--turn-seconds', type=float, default=20.0)
    words = parser.parse_args()
    return print_figures(lambda: run_view(**vars(words)))


if __name__ == '__main__':
    sys.exit(main())
