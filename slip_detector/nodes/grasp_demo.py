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

"""Play a few grasps through the real nodes and many in simulated time, and print a table.

As the nodes run in real time, the table of many seeds is computed in simulated time
(:mod:`slip_detector.grasp.loop`: the same scenes, chain and control law). It also has the figures
of the grasps that were played through the nodes.

``grasp.json`` is one JSON object:

``seeds``
    The seeds of the table.
``conditions``
    For each condition the figures of :func:`slip_detector.grasp.loop.grasp_figures`.
``transport_ms``
    The delay from sample to command that the simulated loop assumes.
``nodes``
    For each seed, both through the nodes and ``simulated``: ``slide_mm`` (null when the object was
    dropped) and ``command_percent``, the mean command while the object has to be held.
``latency_ms``
    ``median`` and ``most`` through the nodes, from the stamp of the sample on which slip came on
    to the command that answered it; null when there was no slip.
"""

import argparse

from slip_detector.commands.command_line import Parser, whole_number
from slip_detector.nodes.run import run_demonstration


def seed_range(text: str) -> range:
    """Return the seeds that a text stands for: ``N`` seeds from 0, or ``FIRST:LAST`` inclusive."""
    try:
        first, last = map(int, text.split(':')) if ':' in text else (0, int(text) - 1)
    except ValueError:
        first, last = 0, -1
    if not 0 <= first <= last:
        allowed = 'N, at least 1, or FIRST:LAST, from 0 on, FIRST at most LAST'
        raise argparse.ArgumentTypeError(f'is {text}, allowed: {allowed}')
    return range(first, last + 1)


def main() -> None:
    """Entry point of ``slip_grasp``."""
    parser = Parser(prog='slip_grasp', description=__doc__.splitlines()[0])
    parser.add_argument(
        '--seeds', type=seed_range, default=range(30), metavar='N',
        help='number of objects, from seed 0 on (default: 30), or FIRST:LAST, both included',
    )  # fmt: skip
    parser.add_argument(
        '--live', type=whole_number(0, 1000), default=4, metavar='N',
        help='number of them to play through the nodes, the first ones (default: %(default)s)',
    )  # fmt: skip
    text = 'parameter file of all nodes, its path or its name in the package (default: grasp.yaml)'
    parser.add_argument('--config', help=text)
    run_demonstration(parser)


if __name__ == '__main__':
    main()
