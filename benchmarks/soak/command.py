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
    Detector node against a bare relay node: ``rate_hz``, ``samples``, ``changes``, ``detector``
    and ``relay`` with ``median_ms``, ``p99_ms`` and ``cpu_percent``, then ``latency_ratio`` (of
    the medians) and ``cpu_ratio``; :mod:`benchmarks.soak.relay` tells how and why.
``finger``, ``hand``, ``fast_hand``, ``fast_finger``
    A driver and a detector for one or five fingers of 16 channels; ``finger`` and ``hand`` play
    the simulated fingertip at 380 Hz, ``fast_hand`` a recording at 1 kHz, ``fast_finger`` one at 5
    kHz in messages of ten samples; :mod:`benchmarks.soak.hand` has their figures.
``wanted``
    For each claim, by ``part.figure``: the measured ``value``, the ``bound`` as text and whether
    it is ``met``; both are null where the part was not measured, and ``met`` where nothing is
    judged.
"""

import argparse
from typing import Any, NamedTuple

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.processes import figures_of_process, why_not_ros
from benchmarks.verdicts import claim_in_words, values_of, verdicts
from slip_detector.evaluation.figures import Bound

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


class Part(NamedTuple):
    """A module that runs as a process, its arguments, and for how long the nodes run."""

    module: str
    words: str
    seconds: float
    quick_seconds: float


HAND = 'benchmarks.soak.hand'
PARTS = {
    'relay': Part('benchmarks.soak.relay', '', 25.0, 4.0),
    'finger': Part(HAND, '--fingers 1', 660.0, 15.0),
    'hand': Part(HAND, '--fingers 5', 60.0, 15.0),
    'fast_hand': Part(HAND, '--fingers 5 --sample-rate-hz 1000', 60.0, 15.0),
    'fast_finger': Part(HAND, '--sample-rate-hz 5000 --samples-per-message 10', 60.0, 15.0),
}

#: Time for the start and the end of the processes on a busy machine.
EXTRA_S = 420.0


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'soak',
        'Run drivers and detectors as processes and watch what they lose, how their memory and '
        'latency grow and what they take of the processor; the detector against a bare relay too. '
        'Says of each figure what is wanted and whether it is met; the exit code is 0 either way.',
    )
    parser.add_argument('--part', choices=('all', *PARTS), default='all', help='only one of them')
    times = ', '.join(f'{name} {part.seconds:g}' for name, part in PARTS.items())
    parser.add_argument(
        '--seconds', type=float, help=f'how long each part runs (default: {times})'
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Let the nodes run."""
    reason = why_not_ros()
    if reason:
        raise RuntimeError(f'the soak needs the nodes: {reason}')
    figures: dict[str, Any] = {'machine': machine(), 'quick': words.quick}
    parts = list(PARTS) if words.part == 'all' else [words.part]
    for name in parts:
        part = PARTS[name]
        lasts_s = words.seconds or (part.quick_seconds if words.quick else part.seconds)
        arguments = ['--seconds', str(lasts_s), *part.words.split()]
        figures[name] = figures_of_process(part.module, arguments, lasts_s + EXTRA_S)
    figures['wanted'] = verdicts(WANTED, values_of(WANTED, figures), judged=not words.quick)
    lines = [line for name in parts for line in _lines(name, figures[name], figures['wanted'])]
    return Measurement(figures, '\n'.join([heading(figures), *lines]))


def _lines(part: str, figures: dict[str, Any], wanted: dict[str, Any]) -> list[str]:
    """Return a line for each figure of a part, with what is wanted of it."""
    lines = ['', part]
    for name, figure in figures.items():
        values = figure if isinstance(figure, dict) else {'': figure}
        words = ', '.join(f'{key} {_rounded(one)}'.strip() for key, one in values.items() if one)
        claim = wanted.get(f'{part}.{name}')
        lines.append(
            f'  {name:<22} {words or 0}' + (f'  {claim_in_words(claim)}' if claim else '')
        )
    return lines


def _rounded(value: Any) -> str:
    return ' and '.join(map(_rounded, value)) if isinstance(value, list) else f'{value:,.4g}'
