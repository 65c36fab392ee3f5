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

"""Detectors without ROS: scenes through the chain that a detector runs, for the live page."""

import asyncio
import contextlib
import functools
import threading
import time
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np

from slip_detector.chain.live_chain import LiveChain
from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from slip_detector.view.access import Access
from slip_detector.view.detectors import OUTSIDE, RESTART, Detectors, Diagnosis
from slip_detector.view.server import Server


@functools.cache
def rows_of_scene(scene, seed):
    """Return volts and truth of a whole scene, which many fingers play."""
    source = open_source(DriverConfig(source='scene', scene=scene, seed=seed))
    samples = source.read(round(source.duration_s * source.sample_rate_hz))
    return samples.volts, samples.truth


class SimulatedFinger:
    """A scene, or rows that are given, and a chain; what comes of them goes to a finger.

    The test says how much time passes: ``play(seconds)``.
    """

    def __init__(self, finger, rows=None, truth=None, scene='plate_400um', seed=0):
        self.finger = finger
        self.chain = LiveChain(finger.config)
        self.at_ns = 1_000_000_000_000
        if rows is None:
            rows, truth = rows_of_scene(scene, seed)
        self.rows = np.asarray(rows, float)
        self.truth = np.zeros(len(self.rows), bool) if truth is None else np.asarray(truth, bool)
        self.played = 0
        #: Changes rows before they reach finger and chain: a dead channel, for example.
        self.disturb = lambda rows: rows

    def play(self, seconds):
        """Let time pass; what was played to its end begins again."""
        n = round(seconds * self.finger.config.sample_rate_hz) if len(self.rows) else 0
        which = np.arange(self.played, self.played + n) % len(self.rows)
        self.played += n
        if n:
            self.send(self.rows[which], self.truth[which])

    def send(self, rows, truth):
        """Send rows through the chain, as the detector does."""
        finger, n = self.finger, len(rows)
        rows = np.asarray(self.disturb(rows.copy()), float)
        period_ns = round(1e9 / finger.config.sample_rate_hz)
        stamps_ns = self.at_ns + period_ns * np.arange(1, n + 1)
        self.at_ns += n * period_ns
        self.chain.swap()
        result = self.chain.update(rows, level=True)
        level = np.where(result.valid, result.level, np.nan)
        finger.track.add_samples(Samples(rows, stamps_ns, np.asarray(truth)))
        finger.track.add_levels(stamps_ns, level, result.channels, result.slip)
        if np.any(np.diff(result.slip.astype(int), prepend=int(finger.slip)) > 0):
            finger.onset_s = time.monotonic()
        finger.slip = bool(result.slip[-1])
        finger.groups = result.groups[-1].copy()
        finger.valid = bool(result.can_vote[-1].any())
        finger.sample_s = finger.heard_s = time.monotonic()

    def change(self, config, by=OUTSIDE):
        self.chain.change(config)
        self.finger.update_config(config, by)


class SimulatedDetectors(Detectors):
    """Simulated fingers, in real time while a page watches, or as the test says.

    Parameters
    ----------
    labels
        Their namespaces.
    real_time
        Whether each poll plays what has passed since the last one.
    config
        Of all detectors.
    """

    def __init__(self, labels=('index',), config=None, real_time=True, **of_each):
        super().__init__()
        self.watched = set()
        self.simulated = {}
        self.real_time = real_time
        self._polled_s = time.monotonic()
        for i, label in enumerate(labels):
            self.add(label, config or DetectorConfig(), seed=i, **of_each)

    def add(self, label, config, **simulation):
        """Add a finger; return its simulation."""
        name = f'/{label}/slip_detector'
        self.note_config(name, config, RESTART)
        finger = self.fingers[name]
        finger.diagnostics = (Diagnosis(0, 'input', 'simulated samples'),)
        self.simulated[name] = SimulatedFinger(finger, **simulation)
        return self.simulated[name]

    def remove(self, label):
        """Remove a finger."""
        name = f'/{label}/slip_detector'
        self.gone[name] = self.fingers.pop(name)
        del self.simulated[name]

    def watch(self, names):
        self.watched = set(names)

    def poll(self):
        now_s = time.monotonic()
        passed_s, self._polled_s = min(now_s - self._polled_s, 1.0), now_s
        for name, simulated in self.simulated.items():
            simulated.finger.heard_s = now_s
            if self.real_time and name in self.watched:
                simulated.play(passed_s)

    async def change(self, name, values, by):
        simulated = self.simulated[name]
        config = simulated.finger.config.with_values(values)
        if config.autostart != simulated.finger.config.autostart:
            raise ValueError('Trying to set a read-only parameter: autostart.')
        simulated.change(config, by)


@contextlib.asynccontextmanager
async def served_pages(detectors, access=None, prepare=lambda server: None, port=0):
    """Serve detectors in the test's event loop; gives the server and the address of its page."""
    it = Server(detectors, access or Access())
    prepare(it)
    token, stop = it.access.token, asyncio.Event()
    url = f'http://127.0.0.1:{it.listen(port)}/' + (f'?token={token}' if token else '')
    running = asyncio.create_task(it.run(stop))
    try:
        yield SimpleNamespace(server=it, detectors=detectors, url=url)
    finally:
        stop.set()
        await running


@contextlib.contextmanager
def served_beside(detectors, **how):
    """Serve detectors in a thread of its own, for a browser; gives what is served.

    ``call(function)`` runs a function in that thread, as the detectors are only touched there, and
    ``before_end(function)`` is called before the server ends.
    """
    begun = Future()

    async def serve():
        end = asyncio.Event()
        try:
            async with served_pages(detectors, **how) as served:
                begun.set_result((served, asyncio.get_running_loop(), end))
                await end.wait()
        except Exception as error:
            begun.set_exception(error)

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    served, loop, end = begun.result()

    def call(function, *arguments):
        async def called():
            return function(*arguments)

        return asyncio.run_coroutine_threadsafe(called(), loop).result()

    served.call = call
    try:
        with contextlib.ExitStack() as pages:
            served.before_end = pages.callback
            yield served
    finally:
        loop.call_soon_threadsafe(end.set)
        thread.join()
