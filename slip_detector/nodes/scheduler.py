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

"""The threads in which the drivers of a process publish; the main thread spins their nodes."""

import threading
import time
from collections.abc import Callable, Iterator


class Scheduler:
    """Runs tasks in one thread, each when it is due, and functions in threads of their own.

    Samples of several drivers that are due at the same moment are published one after the other by
    one thread: waking a thread for each driver would cost more than publishing its message.

    Examples
    --------
    >>> done = []
    >>> scheduler = Scheduler()
    >>> scheduler.add_thread(lambda stop: done.append('read'))
    >>> scheduler.start()
    >>> scheduler.stop()
    >>> done, scheduler.ended
    (['read'], True)
    """

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._tasks: list[Iterator[float]] = []
        self._threads: list[threading.Thread] = []
        self._failure: Exception | None = None

    def add_task(self, task: Iterator[float]) -> None:
        """Add a task for the shared thread.

        Parameters
        ----------
        task
            Yields the times, of :func:`time.monotonic`, at which it is to be resumed.
        """
        self._tasks.append(task)

    def add_thread(self, run: Callable[[threading.Event], None]) -> None:
        """Add a function that runs in a thread of its own.

        Parameters
        ----------
        run
            Takes an event, and returns soon after the event is set.
        """
        self._threads.append(self._thread(lambda: run(self._stop)))

    def start(self) -> None:
        """Start all tasks and functions."""
        if self._tasks:
            self._threads.append(self._thread(self._run_tasks))
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop all threads and wait until they have ended."""
        self._stop.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    @property
    def ended(self) -> bool:
        """Whether all tasks and functions have ended.

        Raises
        ------
        Exception
            The exception that ended a task or function.
        """
        if self._failure is not None:
            raise self._failure
        return not any(thread.is_alive() for thread in self._threads)

    def _thread(self, target: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            try:
                target()
            except Exception as failure:
                self._failure = failure

        return threading.Thread(target=run, daemon=True)

    def _run_tasks(self) -> None:
        # All tasks are asked for their first time before any of them is resumed.
        first_s = {task: next(task, None) for task in self._tasks}
        due_s = {task: moment_s for task, moment_s in first_s.items() if moment_s is not None}
        while due_s:
            task = min(due_s, key=due_s.__getitem__)
            if self._stop.wait(max(0.0, due_s[task] - time.monotonic())):
                return
            next_s = next(task, None)
            if next_s is None:
                del due_s[task]
            else:
                due_s[task] = next_s
