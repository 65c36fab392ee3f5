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

"""What ``slip_demo`` and ``slip_grasp`` do with real nodes."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import compile_chain
from slip_detector.evaluation.demo import Heard, demo_figures, demo_words, states_at
from slip_detector.grasp import loop
from slip_detector.grasp.loop import CONTROLLER, GraspTrial, LiveGraspTrial
from slip_detector.nodes.ending import init_ros
from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.nodes.processes import RecordedNodes
from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig, GraspConfig
from slip_detector.parameters.files import find_parameter_file, shared_folder, whole_file
from slip_detector.parameters.grasp import commands_of_a_scene
from slip_detector.recordings import write_recording
from slip_detector.report.pictures import draw_grasp, draw_trial, grasp_table
from slip_detector.sources.played import SceneSource

ENVELOPE = 'slip_detector/envelope'

#: Parameters of the detector, which is not to complain of the silence after the driver's end.
PATIENT = {'input_timeout_s': 10.0}

#: Topics of the nodes of a grasp, with their types and qualities of service.
TOPICS: dict[str, tuple[Any, QoSProfile]] = {
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


def slip_demo(arguments: argparse.Namespace, path: Path) -> tuple[dict[str, Any], str]:
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
    _say('slip_demo', f'{arguments.scene} through both nodes, {source.duration_s:.0f} s')
    heard = _play(arguments, file, config)
    result = demo_figures(heard, config)
    states = {topic: states_at(*each, heard.stamps_s) for topic, each in heard.changes.items()}
    groups = {name: states[f'slip/group/{name}'] for name in config.groups}
    draw_trial(path, heard.stamps_s, heard.volts, config, groups, states['slip'], heard.motion_s)
    return result, demo_words(result)


def _play(arguments: argparse.Namespace, file: Path, config: DetectorConfig) -> Heard:
    """Run both nodes on a scene, and record what they publish."""
    decisions = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    decisions += [f'slip/channel/{name}' for name in config.names]
    topics: dict[str, tuple[Any, QoSProfile]] = {
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


def slip_grasp(arguments: argparse.Namespace, picture: Path) -> tuple[dict[str, Any], str]:
    """Play the grasps, draw one, and return the figures and their table."""
    own = shared_folder() / 'config' / 'grasp.yaml'
    config = arguments.config = find_parameter_file(arguments.config or str(own))
    chain, grasp = ChainConfig.from_yaml(config), GraspConfig.from_yaml(config)
    seeds = list(arguments.seeds)
    minutes = (len(seeds) * SIMULATED_S + arguments.live * LIVE_S) / 60.0
    _say('slip_grasp', f'this takes some {minutes:.1f} minutes, more on a busy machine')

    def play(name: str, chain: ChainConfig, grasp: GraspConfig) -> list[GraspTrial]:
        _say('slip_grasp', f'{len(seeds)} objects in simulated time: {name}')
        return [loop.play_trial(chain, grasp, seed) for seed in seeds]

    trials = {name: play(name, *both) for name, both in loop.conditions(chain, grasp).items()}
    init_ros(local=True)
    live = seeds[: arguments.live]
    heard = {seed: _play_live(seed, arguments) for seed in live}
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


def _play_live(seed: int, arguments: argparse.Namespace) -> LiveGraspTrial:
    """Play a scene through a driver, a detector and a controller, each a process of its own.

    The scene of the seed is written to the folder. A ValueError says that a node has failed.
    """
    scene = arguments.out / f'grasp_{seed}.yaml'
    with whole_file(scene) as new:
        new.write_text(yaml.safe_dump(loop.object_scene(seed), sort_keys=False), encoding='utf-8')
    _say('slip_grasp', f'seed {seed} through the nodes, in real time')
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


def _say(command: str, words: str) -> None:
    """Say what goes on, as it takes a while."""
    print(f'{command}: {words}', file=sys.stderr, flush=True)
