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

"""The live page of five fingers at 380 Hz, and what it costs the detectors.

Keys of ``python -m benchmarks view --json``:

``closed``, ``here``
    Without a viewer, and with Chromium on this machine, in turns. Each has
    ``latency_median_ms`` (age of the samples at their decision, as the detectors report it every
    second: the median over a turn, and of all turns), ``cpu_percent`` of a core by executable (the
    mean of the turns), and ``slip_view_cpu_percent``, which is one of these.

    ``here`` also has ``latency_ratio`` to that of ``closed``, ``frames_a_second``. Of its
    last turn, the longest, it has ``memory_mib`` of
    slip_view and ``memory_growth_percent``, ``heap_mib`` of the page after a garbage collection,
    and ``heap_growth_percent``, from the first tenth of the time to the last.
"""

import argparse
from typing import Any

from benchmarks.measurement import Bound, shared_options
from benchmarks.view.browser import why_no_browser

WANTED = {
    'here.slip_view_cpu_percent': Bound(high=30.0),
    'here.frames_a_second': Bound(low=29.0),
    'here.memory_growth_percent': Bound(high=2.0),
    'here.heap_growth_percent': Bound(high=5.0),
}

#: Time, in seconds, for which the page is open at last.
SECONDS, QUICK_SECONDS = 60.0, 8.0

#: Pairs of turns without the page and with it, and how long each turn is.
PAIRS, TURN_SECONDS = 5, 20.0
QUICK_PAIRS, QUICK_TURN_SECONDS = 2, 4.0


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'view',
        'Show five fingers at 380 Hz on the live page in Chromium; measure frames, memory and '
        'processor time, and the latency of the detectors with and without.',
    )
    parser.add_argument(
        '--seconds', type=float,
        help=f'how long the page is open at last (default: {SECONDS:g}); 3600 for a soak',
    )  # fmt: skip
    parser.add_argument(
        '--traces', type=int, default=4, help='how many channels have traces (default: 4)'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Let nodes, page and browser run."""
    if reason := why_no_browser():
        raise RuntimeError(f'the live page cannot be measured: {reason}')
    from benchmarks.view.session import run_view  # Only with ROS can it be imported.

    lasts_s = words.seconds or (QUICK_SECONDS if words.quick else SECONDS)
    turns = (QUICK_PAIRS, QUICK_TURN_SECONDS) if words.quick else (PAIRS, TURN_SECONDS)
    return run_view(lasts_s, *turns, words.traces)
