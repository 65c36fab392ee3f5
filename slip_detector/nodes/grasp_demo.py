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

"""The grasp demonstration: a few grasps played through the real nodes, and a table of many.

As the nodes run in real time, the table of many seeds is computed in simulated time
(:mod:`slip_detector.grasp.loop`: the same scenes, chain and control law). It also has the figures
of the grasps that were played through the nodes.

``grasp.json`` is one JSON object:

``seeds``
    The seeds of the table.
``conditions``
    For each condition the figures of :func:`slip_detector.grasp.comparison.grasp_figures`.
``harder``
    The same figures of the controller under harder conditions, see
    :data:`slip_detector.grasp.comparison.HARDER`.
``transport_ms``
    The delay from sample to command that the simulated loop assumes.
``nodes``
    For each seed, both through the nodes and ``simulated``: ``slide_mm`` (null when the object was
    dropped) and ``command_percent``, the mean command while the object has to be held.
``latency_ms``
    ``median`` and ``most`` through the nodes, from the stamp of the sample on which slip came on
    to the command that answered it; null when there was no slip.
``wanted``
    For the controller, also under harder conditions: the ``value`` of each figure, its ``bound``
    as text, and whether it is ``met``.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml

from slip_detector.grasp.comparison import (
    CONTROLLER,
    HARDER,
    WANTED,
    check_wanted,
    conditions,
    grasp_figures,
)
from slip_detector.grasp.loop import TRANSPORT_S, GraspTrial, play_trials
from slip_detector.grasp.objects import SCENE, object_scene
from slip_detector.nodes.demonstration import run_demonstration
from slip_detector.nodes.grasp_trial import (
    EXECUTABLES,
    NAMESPACE,
    GraspRecorder,
    LiveGraspTrial,
    play_grasp,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import shared_folder, whole_file, writable_folder
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.parameters.sets import check_sections

#: Index of the object that is drawn, if there are as many; with the default seeds it slips twice.
SHOWN = 2


#: Most objects; a larger number is taken for a typing error.
MOST_OBJECTS = 1000


def _through_nodes(
    seeds: Sequence[int], config: Path, folder: Path, trials: Sequence[GraspTrial], limit_n: float
) -> tuple[dict[str, Any], dict[int, LiveGraspTrial]]:
    """Play seeds through the nodes.

    Parameters
    ----------
    seeds
        The seeds of the objects.
    config
        Parameter file of the nodes.
    folder
        Folder to which their scenes are written.
    trials
        The same seeds in the simulated loop.
    limit_n
        Grip force with which the commands are compared.

    Returns
    -------
    dict
        ``nodes`` and ``latency_ms``, as in the module's docstring.
    dict
        What was received, by seed.
    """
    rclpy.init()
    recorder = GraspRecorder()
    nodes: dict[str, Any] = {}
    heard: dict[int, LiveGraspTrial] = {}
    latencies_s: list[float] = []
    for seed, trial in zip(seeds, trials, strict=True):
        scene = folder / f'grasp_{seed}.yaml'
        text = yaml.safe_dump(object_scene(seed), sort_keys=False)
        with whole_file(scene) as new:
            new.write_text(text, encoding='utf-8')
        live = heard[seed] = play_grasp(recorder, seed, config, scene)
        latencies_s += live.latencies_s()
        last_m = float(live.position[-1, 1])
        nodes[str(seed)] = {
            'slide_mm': None if last_m >= trial.length_m else last_m * 1e3,
            'command_percent': 100.0 * trial.mean_n(live.command_n(trial.time_s)) / limit_n,
            'simulated': {
                'slide_mm': None if trial.slide_m is None else trial.slide_m * 1e3,
                'command_percent': 100.0 * trial.mean_n(trial.command_n) / limit_n,
            },
        }
    latency_ms = None
    if latencies_s:
        latency_ms = {
            'median': float(np.median(latencies_s)) * 1e3, 'most': max(latencies_s) * 1e3,
        }  # fmt: skip
    return {'nodes': nodes, 'latency_ms': latency_ms}, heard


def seed_range(text: str) -> range:
    """Return the seeds that a text stands for: ``N`` seeds from 0, or ``FIRST:LAST`` inclusive.

    Raises
    ------
    ArgumentTypeError
        When the text is neither.

    Examples
    --------
    >>> list(seed_range('3')), list(seed_range('7000:7001'))
    ([0, 1, 2], [7000, 7001])
    """
    first, colon, last = text.partition(':')
    try:
        seeds = range(int(first), int(last) + 1) if colon else range(int(text))
    except ValueError:
        seeds = range(0)
    if not 1 <= seeds.stop - seeds.start <= MOST_OBJECTS or seeds.start < 0:
        raise argparse.ArgumentTypeError(
            f'is {text}, allowed: N, at least 1, or FIRST:LAST, from 0 on, with FIRST at most '
            f'LAST; at most {MOST_OBJECTS} objects'
        )
    return seeds


def main() -> None:
    """Entry point of ``slip_grasp``."""
    parser = argparse.ArgumentParser(prog='slip_grasp', description=__doc__.splitlines()[0])
    parser.add_argument(
        '--seeds', type=seed_range, default=range(30), metavar='N',
        help='how many objects, from seed 0 on (default: 30), or FIRST:LAST, both included',
    )  # fmt: skip
    parser.add_argument(
        '--live', type=int, default=4, metavar='N',
        help='how many of them, the first ones, through the nodes (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--config', type=Path, help='parameter file of all nodes')
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    arguments = parser.parse_args()
    many = len(arguments.seeds)
    if not 0 <= arguments.live <= many:
        parser.error(f'--live is {arguments.live}, allowed: 0 to {many}, all seeds')
    run_demonstration('slip_grasp', lambda: _demonstrate(arguments))


def _demonstrate(arguments: argparse.Namespace) -> None:
    config = arguments.config or shared_folder() / 'config' / 'grasp.yaml'
    chain, grasp = ChainConfig.from_yaml(config), GraspConfig.from_yaml(config)
    for executable in EXECUTABLES:
        check_sections(config, executable, f'/{NAMESPACE}/{executable}')
    writable_folder(arguments.out)
    seeds = list(arguments.seeds)
    trials = {name: play_trials(*both, seeds) for name, both in conditions(chain, grasp).items()}
    parts = {name: grasp_figures(mine, grasp.limit_n) for name, mine in trials.items()}
    harder = {
        name: grasp_figures(
            play_trials(chain, grasp, seeds, SCENE, TRANSPORT_S, **factors), grasp.limit_n
        )
        for name, factors in HARDER.items()
    }
    mine = trials[CONTROLLER][: arguments.live]
    live, heard = _through_nodes(
        seeds[: arguments.live], config, arguments.out, mine, grasp.limit_n
    )
    result = {
        'seeds': seeds,
        'conditions': parts,
        'harder': harder,
        'transport_ms': TRANSPORT_S * 1e3,
        **live,
        'wanted': check_wanted({**parts, **harder}),
    }
    with whole_file(arguments.out / 'grasp.json') as new:
        new.write_text(json.dumps(result, indent=2) + '\n')
    from slip_detector.report.grasp import draw_grasp, grasp_table

    drawn = min(SHOWN, len(seeds) - 1)
    shown = heard.get(seeds[drawn])
    draw_grasp(
        arguments.out / 'grasp.png',
        {name: mine[drawn] for name, mine in trials.items()},
        parts,
        grasp.limit_n,
        {'position': shown.position, 'command': shown.command} if shown else {},
        WANTED[CONTROLLER]['worst_slide_mm'].high,
    )
    print(grasp_table(result))
    print(f'Written: {arguments.out / "grasp.json"}, {arguments.out / "grasp.png"}')


if __name__ == '__main__':
    main()
