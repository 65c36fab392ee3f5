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

"""Counts events, and logs them at a limited rate."""

import time
from collections import Counter
from collections.abc import Callable

#: Shortest time between two log messages of the same kind.
LOG_PERIOD_NS = 1_000_000_000


class EventLog:
    """Counts events by their kind, and logs each kind at most once a second.

    Parameters
    ----------
    totals
        Number of events of each kind, which this class increases.
    log
        Writes a line to the log.

    Examples
    --------
    >>> log = EventLog(Counter(), print)
    >>> for stamp in (3, 2):
    ...     log.note('backwards', f'stamp {stamp} is before 4')
    stamp 3 is before 4 (1 so far)
    >>> log.note('bridged', 'samples missing', count=5)
    samples missing (5 so far)
    """

    def __init__(self, totals: Counter[str], log: Callable[[str], object]) -> None:
        self._totals, self._log = totals, log
        self._logged_ns: dict[str, int] = {}

    def note(self, kind: str, what: str, count: int = 1) -> None:
        """Count an event, or several, and log it unless its kind was logged within a second."""
        self._totals[kind] += count
        now_ns = time.monotonic_ns()
        if now_ns - self._logged_ns.get(kind, -LOG_PERIOD_NS) >= LOG_PERIOD_NS:
            self._logged_ns[kind] = now_ns
            self._log(f'{what} ({self._totals[kind]} so far)')
