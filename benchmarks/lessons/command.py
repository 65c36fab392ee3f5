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

"""What teaching on the live page brings, by hands that are late, forget and press by mistake.

Keys of ``python -m benchmarks lessons --json``:

``slips_5``, ``slips_20``
    Lessons with so many slips, which go through the families of simulated scenes: ``lessons``, of
    each the ``family``, ``seed`` and ``hand`` (2: the latest), the figures ``before`` and
    ``after`` on scenes with fresh seeds and exact labels, and what the page ``said``; and how many
    of them reached what is wanted once what the page would apply is applied: ``not_worse``:
    neither area under the curve nor coverage is worse; ``good``: recall of 0.95 at least, coverage
    of 0.8, and ON for at most 0.5 % of rest, taps and presses; ``soon``: a median latency of at
    most 60 ms; and ``recall``, the least of all.
"""

import argparse
import itertools
from collections.abc import Iterable
from typing import Any

from benchmarks.lessons.lessons import ON, lesson
from benchmarks.measurement import Bound, shared_options
from benchmarks.tune.families import disturbances
from slip_detector.parameters import read_yaml
from slip_detector.scenes import find_scene
from slip_detector.tuning.problem import COMPARED

#: Numbers of slips in a lesson, and how many lessons there are.
SLIPS, LESSONS = (5, 20), 20

#: A detector whose median latency is longer is slow.
SOON_MS = 60.0

#: The seed of the first lesson.
SEED = 8100

WANTED = {
    'slips_5.not_worse': Bound(low=LESSONS),
    'slips_5.recall': Bound(low=0.9),
    'slips_20.not_worse': Bound(low=LESSONS),
    'slips_20.good': Bound(low=18),
    'slips_20.soon': Bound(low=18),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'lessons',
        'Teach a detector by hands that are late, forget and press by mistake, through what the '
        'live page does, and judge it on scenes that it has not seen. 40 lessons take an hour.',
    )
    parser.add_argument(
        '--slips', action='append', type=int, default=[], help='lessons of so many; repeatable'
    )
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Give all lessons."""
    seeds = range(SEED, SEED + (1 if words.quick else LESSONS))
    return {f'slips_{n}': measure_lessons(n, seeds) for n in words.slips or SLIPS}


def measure_lessons(slips: int, seeds: Iterable[int]) -> dict[str, Any]:
    """Give a lesson for each seed, each of the next family."""
    plate = read_yaml(find_scene('plate_400um'))
    del plate['steps']
    families = {name: {**plate, **parts} for name, parts in disturbances().items()}
    for parts in families.values():
        parts.pop('rolling', None)  # It is at a time of its own, when the finger may slide here.
    lessons = [
        lesson(name, parts, slips, seed)
        for seed, (name, parts) in zip(seeds, itertools.cycle(families.items()))
    ]
    return {
        'lessons': lessons,
        'not_worse': sum(_not_worse(one) for one in lessons),
        'good': sum(_good(one['after']) for one in lessons),
        'soon': sum(_soon(one['after']) for one in lessons),
        'recall': min(one['after']['recall'] for one in lessons),
    }


def _not_worse(given: dict[str, Any]) -> bool:
    before, after = given['before'], given['after']
    better = after['auc_all'] >= before['auc_all'] - COMPARED['auc'].step
    return bool(better and after['coverage'] >= before['coverage'] - COMPARED['coverage'].step)


def _soon(figures: dict[str, float | None]) -> bool:
    latency_ms = figures['latency_median_ms']
    return latency_ms is not None and latency_ms <= SOON_MS


def _good(figures: dict[str, float]) -> bool:
    on = [figure for name, figure in figures.items() if name in ON]
    return figures['recall'] >= 0.95 and figures['coverage'] >= 0.8 and max(on) <= 0.5
