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
"""The subcommand ``soak``: drivers and detectors that run for long.

It gives one object (keys of ``--json``):

``finger``, ``hand``, ``fast_hand``, ``fast_finger``
    A driver and a detector for one or five fingers of 16 channels. ``finger`` and ``hand`` play
    the simulated fingertip at 380 Hz, ``fast_hand`` a recording at 1 kHz, ``fast_finger`` one at
    5 kHz in messages of ten samples. :mod:`benchmarks.soak.hand` has their figures.
"""

import argparse
from typing import Any

from benchmarks.measurement import Bound, shared_options

WANTED = {
    'finger.lost_total': Bound(high=0),
    'finger.latency_p99_growth': Bound(high=1.25),
    'finger.memory_growth_percent': Bound(high=2.0),
    'finger.cpu_percent_total': Bound(high=100.0),
    'hand.lost_total': Bound(high=0),
    'hand.cpu_percent_total': Bound(high=50.0),
    'fast_hand.lost_total': Bound(high=0),
    'fast_finger.lost_total': Bound(high=0),
    'fast_finger.cpu_percent_total': Bound(high=30.0),
}

#: Seconds of a quick run.
QUICK_S = 15.0

#: What runs, and for how many seconds.
PARTS: dict[str, tuple[dict[str, Any], float]] = {
    'finger': ({}, 660.0),
    'hand': ({'fingers': 5}, 60.0),
    'fast_hand': ({'fingers': 5, 'sample_rate_hz': 1000.0}, 60.0),
    'fast_finger': ({'sample_rate_hz': 5000.0, 'samples_per_message': 10}, 60.0),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'soak',
        'Run drivers and detectors as processes and watch what they lose, how their memory and '
        'latency grow and what they take of the processor.',
    )
    parser.add_argument('--part', choices=('all', *PARTS), default='all', help='only one of them')
    times = ', '.join(f'{name} {usual_s:g}' for name, (_, usual_s) in PARTS.items())
    parser.add_argument(
        '--seconds', type=float, help=f'how long each part runs (default: {times})'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Let the nodes run."""
    from benchmarks.soak import hand  # Only with ROS can it be imported.

    figures = {}
    for name in PARTS if words.part == 'all' else [words.part]:
        more, usual_s = PARTS[name]
        lasts_s = words.seconds or (QUICK_S if words.quick else usual_s)
        figures[name] = hand.measure(lasts_s, **more)
    return figures
