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
    For each condition the figures of :func:`slip_detector.grasp.loop.grasp_figures`.
``harder``
    The same figures of the controller under harder conditions, see
    :data:`slip_detector.grasp.loop.HARDER`.
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
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from slip_detector.chain.samples import Floats
from slip_detector.commands.command_line import whole_number
from slip_detector.grasp import loop
from slip_detector.grasp.loop import CONTROLLER, GraspTrial, LiveGraspTrial
from slip_detector.nodes.demo import TIMEOUT_S, NodeProcesses, Recorder, run_demonstration
from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import shared_folder, whole_file
from slip_detector.parameters.grasp import GraspConfig, commands_of_a_scene

NAMESPACE = 'slip_grasp'

#: Topics of the nodes, with their types and qualities of service.
TOPICS: dict[str, tuple[Any, QoSProfile]] = {
    'voltages': (JointState, sensor_qos()),
    'platform_position': (JointState, sensor_qos()),
    'grip_force': (JointState, state_qos(depth=1000)),
    'slip_onset': (Header, event_qos()),
}

#: Index of the object that is drawn, if there are as many; the default one slips five times.
SHOWN = 2


def _play_live(recorder: Recorder, seed: int, config: Path, folder: Path) -> LiveGraspTrial:
    """Play a scene through a driver, a detector and a controller, each a process of its own.

    The scene of the seed is written to the folder. A ValueError says that a node has failed.
    """
    scene = folder / f'grasp_{seed}.yaml'
    with whole_file(scene) as new:
        new.write_text(yaml.safe_dump(loop.object_scene(seed), sort_keys=False), encoding='utf-8')
    _say(f'seed {seed} through the nodes, in real time')
    played = {'source': 'scene', 'scene': scene, 'seed': seed, 'wait_for_grip': 'true'}
    recorder.messages.update({topic: [] for topic in TOPICS})
    with NodeProcesses(NAMESPACE, recorder.receive) as nodes:
        nodes.start('slip_detector', config, input_timeout_s=TIMEOUT_S)
        nodes.start('grasp_controller', config, **commands_of_a_scene())
        nodes.start('slip_driver', config, wait_for_subscribers=2, **played)
        nodes.wait_for_end('slip_driver')
    begin_s = recorder.stamps_s('voltages')[0]

    def course(topic: str, field: str) -> Floats:
        times_s = recorder.stamps_s(topic) - begin_s
        return np.column_stack([times_s, recorder.values(topic, field)])

    position, command = course('platform_position', 'position'), course('grip_force', 'effort')
    return LiveGraspTrial(position, command, recorder.stamps_s('slip_onset') - begin_s)


def seed_range(text: str) -> range:
    """Return the seeds that a text stands for: ``N`` seeds from 0, or ``FIRST:LAST`` inclusive."""
    try:
        first, last = map(int, text.split(':')) if ':' in text else (0, int(text) - 1)
    except ValueError:
        first, last = 0, -1
    if not 0 <= first <= last:
        raise argparse.ArgumentTypeError(
            f'is {text}, allowed: N, at least 1, or FIRST:LAST, from 0 on, FIRST at most LAST'
        )
    return range(first, last + 1)


def _say(words: str) -> None:
    """Say what goes on, as it takes a while."""
    print(f'slip_grasp: {words}', file=sys.stderr, flush=True)


def main() -> None:
    """Entry point of ``slip_grasp``."""
    parser = argparse.ArgumentParser(prog='slip_grasp', description=__doc__.splitlines()[0])
    parser.add_argument(
        '--seeds', type=seed_range, default=range(30), metavar='N',
        help='how many objects, from seed 0 on (default: 30), or FIRST:LAST, both included',
    )  # fmt: skip
    parser.add_argument(
        '--live', type=whole_number(0, 1000), default=4, metavar='N',
        help='how many of them, the first ones, through the nodes (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--config', type=Path, help='parameter file of all nodes')
    run_demonstration(parser, _demonstrate)


def _demonstrate(arguments: argparse.Namespace, picture: Path) -> tuple[dict[str, Any], str]:
    config = arguments.config or shared_folder() / 'config' / 'grasp.yaml'
    chain, grasp = ChainConfig.from_yaml(config), GraspConfig.from_yaml(config)
    seeds = list(arguments.seeds)

    def played(
        name: str, chain: ChainConfig, grasp: GraspConfig, **factors: float
    ) -> list[GraspTrial]:
        _say(f'{len(seeds)} objects in simulated time: {name}')
        return [loop.play_trial(chain, grasp, seed, **factors) for seed in seeds]

    trials = {name: played(name, *both) for name, both in loop.conditions(chain, grasp).items()}
    parts = {name: loop.grasp_figures(mine, grasp.limit_n) for name, mine in trials.items()}
    harder = {
        name: loop.grasp_figures(played(name, chain, grasp, **factors), grasp.limit_n)
        for name, factors in loop.HARDER.items()
    }
    recorder = Recorder(NAMESPACE, TOPICS)
    heard = {
        seed: _play_live(recorder, seed, config, arguments.out) for seed in seeds[: arguments.live]
    }
    result = {
        'seeds': seeds,
        'conditions': parts,
        'harder': harder,
        'transport_ms': loop.TRANSPORT_S * 1e3,
        **loop.live_figures(heard, trials[CONTROLLER][: arguments.live], grasp.limit_n),
        'wanted': loop.check_wanted({**parts, **harder}),
    }
    from slip_detector.report.grasp import draw_grasp, grasp_table

    drawn = min(SHOWN, len(seeds) - 1)
    shown = heard.get(seeds[drawn])
    live = shown._asdict() if shown else {}
    one = {name: mine[drawn] for name, mine in trials.items()}
    draw_grasp(picture, one, grasp.limit_n, live)
    return result, grasp_table(result)


if __name__ == '__main__':
    main()
