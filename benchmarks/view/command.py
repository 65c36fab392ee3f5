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

    ``here`` also has ``latency_ratio`` to that of ``closed``, ``frames_a_second``,
    ``frames_in_the_worst_second``, and of its last turn, the longest, ``browser_cpu_percent``,
    ``memory_mib`` of slip_view and ``memory_growth_percent``, ``heap_mib`` of the page after a
    garbage collection, and ``heap_growth_percent``, from the first tenth of the time to the last.

``unread``, ``greedy``
    Of pages that send and do not read, by what they send, and of the worst: the memory that
    slip_view takes, ``memory_mib``, and after how many ``seconds`` it closes them (40: it does
    not). Of one that
    asks for 300 traces of a recording of ten minutes: how long another one waits for its own, or
    until it is closed, and the processor time of slip_view in the 10 s after the page has left.
"""

import argparse
from typing import Any

from benchmarks.measurement import Bound, shared_options
from benchmarks.tune.browser import why_no_browser

WANTED = {
    'here.slip_view_cpu_percent': Bound(high=30.0),
    'here.frames_a_second': Bound(low=29.0),
    'here.memory_growth_percent': Bound(high=2.0),
    'here.heap_growth_percent': Bound(high=5.0),
    'unread.memory_mib': Bound(high=50.0),
    'unread.seconds': Bound(high=11.0),
    'greedy.waited_s': Bound(high=5.0),
}

#: Time, in seconds, for which the page is open at last.
SECONDS, QUICK_SECONDS = 60.0, 8.0

#: Pairs of turns without the page and with it, and how long each turn is.
PAIRS, TURN_SECONDS = 5, 20.0
QUICK_PAIRS, QUICK_TURN_SECONDS = 2, 4.0

#: For how long at most a page sends without reading.
UNREAD_SECONDS, QUICK_UNREAD_SECONDS = 40.0, 4.0


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'view',
        'Show five fingers at 380 Hz on the live page in Chromium; measure frames, memory and '
        'processor time, and the latency of the detectors with and without. Then let pages send '
        'without reading, and ask for too much.',
    )
    parser.add_argument(
        '--seconds', type=float,
        help=f'how long the page is open at last (default: {SECONDS:g}); 3600 for a soak',
    )  # fmt: skip
    parser.add_argument(
        '--traces', type=int, default=4, help='how many channels have traces (default: 4)'
    )
    parser.add_argument(
        '--part', choices=('all', 'page', 'hostile'), default='all', help='only one of the two'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Let nodes, page and browser run."""
    parts: dict[str, Any] = {}
    if words.part != 'page':
        from benchmarks.view.hostile import run_hostile

        parts |= run_hostile(QUICK_UNREAD_SECONDS if words.quick else UNREAD_SECONDS)
    if words.part == 'hostile':
        return parts
    if reason := why_no_browser():
        raise RuntimeError(f'the live page cannot be measured: {reason}')
    from benchmarks.view.session import run_view  # Only with ROS can it be imported.

    lasts_s = words.seconds or (QUICK_SECONDS if words.quick else SECONDS)
    turns = (QUICK_PAIRS, QUICK_TURN_SECONDS) if words.quick else (PAIRS, TURN_SECONDS)
    return parts | run_view(lasts_s, *turns, words.traces)
