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

"""Ctrl-C as a request to stop soon."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from types import FrameType


class Stopper:
    """Notes the first SIGINT; the second one raises a KeyboardInterrupt.

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
        """Return whether SIGINT has come."""
        return self.stopped

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Note SIGINT within this context."""
        before = signal.signal(signal.SIGINT, self._note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.stopped:
            raise KeyboardInterrupt
        self.stopped = True
        sys.stderr.write('\nstopping; results so far are kept (Ctrl-C again: end at once)\n')
