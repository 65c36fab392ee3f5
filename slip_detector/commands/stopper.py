"""Ctrl-C as a wish to stop."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from types import FrameType


class Stopper:
    """Notes a first SIGINT, and lets a second one through.

    Examples
    --------
    >>> stopper = Stopper()
    >>> with stopper.listening():
    ...     signal.raise_signal(signal.SIGINT)
    >>> stopper()
    True
    """

    def __init__(self) -> None:
        self.stopped = False

    def __call__(self) -> bool:
        """Return whether to stop."""
        return self.stopped

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Take SIGINT as a wish to stop."""
        before = signal.signal(signal.SIGINT, self._note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.stopped:
            raise KeyboardInterrupt
        self.stopped = True
        sys.stderr.write('\nstopping; what was found is kept (once more: end at once)\n')
