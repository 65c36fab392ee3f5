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

"""The demonstrations, ``slip_demo`` and ``slip_grasp``: each plays scenes through real nodes.

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
import contextlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import compile_chain
from slip_detector.commands import command_line
from slip_detector.commands.command_line import Parser, whole_number
from slip_detector.evaluation.demo import Heard, demo_figures, demo_words, states_at
from slip_detector.grasp import loop
from slip_detector.grasp.loop import CONTROLLER, GraspTrial, LiveGraspTrial
from slip_detector.nodes.ending import init_ros
from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.nodes.processes import RecordedNodes, Topics
from slip_detector.parameters import (
    ChainConfig,
    DetectorConfig,
    DriverConfig,
    GraspConfig,
    commands_of_a_scene,
    find_parameter_file,
    shared_folder,
    whole_file,
    writable_folder,
)
from slip_detector.recordings import write_recording
from slip_detector.report.pictures import draw_grasp, draw_trial, grasp_table
from slip_detector.sources.played import SceneSource

ENVELOPE = 'slip_detector/envelope'

#: Topics of the nodes of a grasp, with their types and qualities of service.
TOPICS: Topics = {
    'voltages': (JointState, sensor_qos()),
    'platform_position': (JointState, sensor_qos()),
    'grip_force': (JointState, state_qos(depth=1000)),
    'slip_onset': (Header, event_qos()),
}

#: About how long, in seconds, an object takes in simulated time under all conditions, and through
#: the nodes.
SIMULATED_S, LIVE_S = 5.0, 15.0

#: Index of the object that is drawn, if there are as many; that of the default seeds slips five
#: times.
DRAWN = 2

#: Parameters of the detector, which is not to complain of the silence after the driver's end.
PATIENT = {'input_timeout_s': 10.0}


def _demonstrate(
    parser: argparse.ArgumentParser,
    play: Callable[[argparse.Namespace, Path], tuple[dict[str, Any], str]],
) -> int:
    """Play a demonstration, write its figures and print its words; return the exit code.

    The function that plays it gets the arguments and the path of the picture to draw, and returns
    figures and words. A signal while nodes run gives one line, and the code 0.
    """
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    parser.add_argument('--verbose', action='store_true', help='print what the nodes log too')
    arguments = parser.parse_args()
    file = arguments.out / f'{parser.prog.removeprefix("slip_")}.json'
    picture = file.with_suffix('.png')

    def work() -> str:
        writable_folder(arguments.out)
        result, text = play(arguments, picture)
        with whole_file(file) as new:
            new.write_text(json.dumps(result, indent=2) + '\n')
        return f'{text}\nPicture: {picture}; figures: {file}\nNext: make view; docs/your_sensor.md'

    try:
        return command_line.run(parser.prog, work)
    except ExternalShutdownException:
        say(parser.prog, 'interrupted before it was done')
        return 0


def say(command: str, words: str) -> None:
    """Say what goes on, as it takes a while."""
    print(f'{command}: {words}', file=sys.stderr, flush=True)


def slip_demo(executable: str, takedown: contextlib.ExitStack) -> int:
    """Play a trial with the arguments of the command line; return the exit code."""
    parser = Parser(
        prog=executable,
        description='Play a scene through driver and detector, and say what a controller gets.',
    )
    parser.add_argument('--scene', default='plate_400um', help='its name or path (%(default)s)')
    parser.add_argument(
        '--seed',
        type=whole_number(0, 2**31 - 1),
        default=0,
        help='seed of its noise (%(default)s)',
    )
    parser.add_argument(
        '--record', metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )  # fmt: skip
    return _demonstrate(parser, _play_trial)


def _play_trial(arguments: argparse.Namespace, picture: Path) -> tuple[dict[str, Any], str]:
    """Play a trial through both nodes, draw it, and return its figures and what to print."""
    # A wrong argument is reported before anything is started.
    source = SceneSource(DriverConfig(scene=arguments.scene, seed=arguments.seed))
    if arguments.record:
        samples = source.read(round(source.duration_s * source.sample_rate_hz) + 1)
        samples = samples._replace(stamps_ns=time.time_ns() + samples.stamps_ns)
        write_recording(arguments.record, [samples], source.sample_rate_hz, source.channel_names)
        print(f'Written: {arguments.record}')
    # Compile first: a node that compiles may hold up the other one.
    source.read(1)
    compile_chain()
    init_ros(local=True)
    file = shared_folder() / 'config' / 'slip_detector.yaml'
    config = DetectorConfig.from_yaml(file)
    say('slip_demo', f'{arguments.scene} through both nodes, {source.duration_s:.0f} s')
    heard = _hear_trial(arguments, file, config)
    result = demo_figures(heard, config)
    states = {topic: states_at(*each, heard.stamps_s) for topic, each in heard.changes.items()}
    groups = {name: states[f'slip/group/{name}'] for name in config.groups}
    draw_trial(
        picture, heard.stamps_s, heard.volts, config, groups, states['slip'], heard.motion_s
    )
    return result, demo_words(result)


def _hear_trial(arguments: argparse.Namespace, file: Path, config: DetectorConfig) -> Heard:
    """Run both nodes on a scene, and record what they publish."""
    decisions = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    decisions += [f'slip/channel/{name}' for name in config.names]
    topics: Topics = {
        topic: (JointState, sensor_qos()) for topic in ('voltages', 'platform_position', ENVELOPE)
    }
    topics |= dict.fromkeys(decisions, (Bool, state_qos(depth=1000)))
    with RecordedNodes('slip_demo', topics, arguments.verbose) as nodes:
        nodes.start('slip_detector', file, **PATIENT)
        nodes.wait_until(lambda: all(map(nodes.messages.get, decisions)))
        scene = {'source': 'scene', 'scene': arguments.scene, 'seed': arguments.seed}
        driver = nodes.start('slip_driver', file, wait_for_subscribers=2, loop='false', **scene)
        nodes.wait_for_end(driver)
    begin_s, changes = nodes.stamps_s('voltages')[0], {}
    for topic in decisions:
        states = nodes.values(topic, 'data')
        differs = np.diff(states, prepend=~states[:1])
        changes[topic] = nodes.received_s(topic)[differs] - begin_s, states[differs]
    return Heard(
        nodes.stamps_s('voltages') - begin_s,
        nodes.values('voltages', 'position'),
        nodes.stamps_s('platform_position') - begin_s,
        nodes.values('platform_position', 'position').ravel(),
        nodes.received_s(ENVELOPE) - nodes.stamps_s(ENVELOPE),
        changes,
    )


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


def slip_grasp(executable: str, takedown: contextlib.ExitStack) -> int:
    """Play the grasps with the arguments of the command line; return the exit code."""
    parser = Parser(
        prog=executable,
        description='Play a few grasps through the real nodes and many in simulated time.',
    )
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
    return _demonstrate(parser, _play_grasps)


def _play_grasps(arguments: argparse.Namespace, picture: Path) -> tuple[dict[str, Any], str]:
    """Play the grasps, draw one, and return the figures and their table."""
    own = str(shared_folder() / 'config' / 'grasp.yaml')
    config = arguments.config = find_parameter_file(arguments.config or own)
    chain, grasp = ChainConfig.from_yaml(config), GraspConfig.from_yaml(config)
    seeds = list(arguments.seeds)
    minutes = (len(seeds) * SIMULATED_S + arguments.live * LIVE_S) / 60.0
    say('slip_grasp', f'this takes some {minutes:.1f} minutes, more on a busy machine')

    def play(name: str, chain: ChainConfig, grasp: GraspConfig) -> list[GraspTrial]:
        say('slip_grasp', f'{len(seeds)} objects in simulated time: {name}')
        return [loop.play_trial(chain, grasp, seed) for seed in seeds]

    trials = {name: play(name, *both) for name, both in loop.conditions(chain, grasp).items()}
    init_ros(local=True)
    live = seeds[: arguments.live]
    heard = {seed: _hear_grasp(seed, arguments) for seed in live}
    result = {
        'seeds': seeds,
        'conditions': {
            name: loop.grasp_figures(played, grasp.limit_n) for name, played in trials.items()
        },
        'transport_ms': loop.TRANSPORT_S * 1e3,
        **loop.live_figures(heard, trials[CONTROLLER][: len(live)], grasp.limit_n),
    }
    index = min(DRAWN, len(seeds) - 1)
    drawn = {name: played[index] for name, played in trials.items()}
    drawn_live = heard[seeds[index]]._asdict() if index < len(live) else {}
    draw_grasp(picture, drawn, grasp.limit_n, drawn_live)
    return result, grasp_table(result)


def _hear_grasp(seed: int, arguments: argparse.Namespace) -> LiveGraspTrial:
    """Play a scene through a driver, a detector and a controller, each a process of its own.

    The scene of the seed is written to the folder. A ValueError says that a node has failed.
    """
    scene = arguments.out / f'grasp_{seed}.yaml'
    with whole_file(scene) as new:
        new.write_text(yaml.safe_dump(loop.object_scene(seed), sort_keys=False), encoding='utf-8')
    say('slip_grasp', f'seed {seed} through the nodes, in real time')
    played = {'source': 'scene', 'scene': scene, 'seed': seed, 'wait_for_grip': 'true'}
    with RecordedNodes('slip_grasp', TOPICS, arguments.verbose) as nodes:
        nodes.start('slip_detector', arguments.config, **PATIENT)
        nodes.start('grasp_controller', arguments.config, **commands_of_a_scene())
        driver = nodes.start('slip_driver', arguments.config, wait_for_subscribers=2, **played)
        nodes.wait_for_end(driver)
    begin_s = nodes.stamps_s('voltages')[0]

    def course(topic: str, field: str) -> Floats:
        times_s = nodes.stamps_s(topic) - begin_s
        return np.column_stack([times_s, nodes.values(topic, field)])

    position, command = course('platform_position', 'position'), course('grip_force', 'effort')
    return LiveGraspTrial(position, command, nodes.stamps_s('slip_onset') - begin_s)
