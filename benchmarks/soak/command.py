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

``relay``
    Detector node against a bare relay node: how many ``changes`` of slip were measured,
    ``detector`` and ``relay`` with ``median_ms`` and ``cpu_percent``, then ``latency_ratio`` (of
    the medians) and ``cpu_ratio``; :mod:`benchmarks.soak.relay` tells how and why.
``finger``, ``hand``, ``fast_hand``, ``fast_finger``
    A driver and a detector for one or five fingers of 16 channels; ``finger`` and ``hand`` play
    the simulated fingertip at 380 Hz, ``fast_hand`` a recording at 1 kHz, ``fast_finger`` one at 5
    kHz in messages of ten samples; :mod:`benchmarks.soak.hand` has their figures.
"""

import argparse
import importlib
from typing import Any

from benchmarks.measurement import Bound, shared_options

WANTED = {
    'relay.latency_ratio': Bound(high=1.2),
    'relay.cpu_ratio': Bound(high=0.6),
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

HAND = 'benchmarks.soak.hand'
#: A module, the arguments of its ``measure``, and for how long the nodes run, usually and with
#: ``--quick``.
PARTS: dict[str, tuple[str, dict[str, float], float, float]] = {
    'relay': ('benchmarks.soak.relay', {}, 25.0, 4.0),
    'finger': (HAND, {}, 660.0, 15.0),
    'hand': (HAND, {'fingers': 5}, 60.0, 15.0),
    'fast_hand': (HAND, {'fingers': 5, 'sample_rate_hz': 1000.0}, 60.0, 15.0),
    'fast_finger': (HAND, {'sample_rate_hz': 5000.0, 'samples_per_message': 10}, 60.0, 15.0),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'soak',
        'Run drivers and detectors as processes and watch what they lose, how their memory and '
        'latency grow and what they take of the processor; the detector against a bare relay too.',
    )
    parser.add_argument('--part', choices=('all', *PARTS), default='all', help='only one of them')
    times = ', '.join(f'{name} {usual_s:g}' for name, (_, _, usual_s, _) in PARTS.items())
    parser.add_argument(
        '--seconds', type=float, help=f'how long each part runs (default: {times})'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Let the nodes run."""
    figures = {}
    for name in PARTS if words.part == 'all' else [words.part]:
        module, more, usual_s, quick_s = PARTS[name]
        lasts_s = words.seconds or (quick_s if words.quick else usual_s)
        # Only with ROS can they be imported.
        figures[name] = importlib.import_module(module).measure(lasts_s, **more)
    return figures
