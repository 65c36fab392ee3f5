"""What the drivers of a process do beside their callbacks."""

import sys
import threading
import time
from collections.abc import Callable, Iterator

#: Longest time that the executor keeps a sample waiting that is due; Python's own is 5 ms.
SWITCH_S = 0.5e-3


class Turns:
    """A thread that gives each of several its turns, and threads for those who wait themselves.

    Samples of several drivers that are due at the same moment are sent one after the other by one
    thread: to wake a thread, and then another for its message, costs more than to send it.
    """

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._turns: list[Iterator[float]] = []
        self._threads: list[threading.Thread] = []
        self._failure: Exception | None = None

    def add(self, turns: Iterator[float]) -> None:
        """Have one take turns once this is started: each says when, monotonic, its next is due."""
        self._turns.append(turns)

    def add_waiting(self, run: Callable[[threading.Event], None]) -> None:
        """Have one run in a thread of its own once this is started, until its event is set."""
        self._threads.append(self._thread(lambda: run(self._stop)))

    def start(self) -> None:
        """Start all that was added."""
        sys.setswitchinterval(SWITCH_S)
        if self._turns:
            self._threads.append(self._thread(self._take_turns))
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End all, and wait for it."""
        self._stop.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    @property
    def ended(self) -> bool:
        """Whether all have come to their ends.

        Raises
        ------
        Exception
            What one of them has failed with.
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

    def _take_turns(self) -> None:
        due_s = dict.fromkeys(self._turns, time.monotonic())
        while due_s:
            turns = min(due_s, key=due_s.__getitem__)
            if self._stop.wait(max(0.0, due_s[turns] - time.monotonic())):
                return
            next_s = next(turns, None)
            if next_s is None:
                del due_s[turns]
            else:
                due_s[turns] = next_s
