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

"""What the chain decides, figures of the commands, parameters and topics are what they were.

The golden files are written anew by ``python test/golden/test_golden.py``; a change to one is a
decision, which the message of its commit names.
"""

import dataclasses
import functools
import hashlib
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import numpy as np
import pytest
import scipy

from benchmarks.paper import protocol
from slip_detector import ChainConfig, SlipChain
from slip_detector.parameters import RecordingConfig
from slip_detector.parameters.fields import allowed
from slip_detector.parameters.sections import SECTIONS, set_of
from slip_detector.scenes import load_scene

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = Path(__file__).parent
SCENES = sorted(path.stem for path in (ROOT / 'config' / 'scenes').glob('*.yaml'))
#: Those for the simulated finger; the file of the uSkin has channels of its own.
PRESETS = 'slip_detector', 'onset', 'sure', 'grasp'

#: Only this row in so many is kept of the levels.
STRIDE = 400

#: Words for each node: parameters that add all topics that they can add.
NODES = {
    'slip_driver': ['-p', 'source:=scene', '-p', 'scene:=grasp', '-p', 'wait_for_grip:=true'],
    'slip_detector': ['-p', 'publish_channels:=true'],
    'grasp_controller': [],
}

#: What every node of rclpy has.
OF_RCLPY = '/rosout', '/parameter_events'

#: Runs an executable, prints what its nodes publish and subscribe to, and ends it.
PRINT = """
import json, os, sys
from rclpy.executors import Executor
from rclpy.subscription import Subscription
from slip_detector.nodes import detector
from slip_detector.nodes.run import main

POLICIES = 'history', 'reliability', 'durability', 'liveliness'
TIMES = 'deadline', 'lifespan', 'liveliness_lease_duration'

def described(entity):
    topic = entity.topic_name if isinstance(entity, Subscription) else entity.topic
    qos = entity.qos_profile
    message = type(entity).__name__, f'{entity.msg_type.__module__}.{entity.msg_type.__name__}'
    return topic, *message, {
        'depth': qos.depth,
        **{name: getattr(qos, name).name for name in POLICIES},
        **{name: getattr(qos, name).nanoseconds for name in TIMES},
    }

def print_and_end(self):
    nodes = self.get_nodes()
    for timer in [timer for node in nodes for timer in node.timers]:
        timer.callback()
    entities = [e for node in nodes for e in (*node.publishers, *node.subscriptions)]
    print(json.dumps(sorted(map(described, entities), key=lambda line: line[:3])), flush=True)
    os._exit(0)

detector.LISTEN_S = 0.0  # It listens without waiting for a subscriber to slip.
initialise = Executor.__init__

def initialise_to_print(self, *words, **named):
    initialise(self, *words, **named)
    self.spin = self.spin_once = lambda *_: print_and_end(self)

Executor.__init__ = initialise_to_print
main(sys.argv.pop(1))
"""


def computer():
    """Return what decides about the last bits of a level: processor and libraries."""
    cpuinfo = Path('/proc/cpuinfo')
    text = cpuinfo.read_text(encoding='utf-8') if cpuinfo.is_file() else ''
    named = re.search(r'^model name\s*: (.*)$', text, re.M)
    model = named[1] if named else platform.processor() or platform.machine()
    libraries = f'NumPy {np.__version__}, SciPy {scipy.__version__}, Numba {numba.__version__}'
    return f'{model}, {libraries}'


def digest(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:16]


@functools.cache
def samples_of(name):
    """Return the samples of a whole scene."""
    scene = load_scene(ROOT / 'config' / 'scenes' / f'{name}.yaml', np.random.default_rng(0))
    return scene.read(scene.length)


def decided(scene, preset):
    """Return the decisions of a preset on a scene, and some of its levels."""
    config = ChainConfig.from_yaml(ROOT / 'config' / f'{preset}.yaml')
    result = SlipChain(config).update(samples_of(scene).volts)
    decisions = np.column_stack([result.slip, result.groups, result.channels, result.valid])
    return {
        'slip_rows': int(result.slip.sum()),
        'decisions': digest(np.packbits(decisions)),
        'levels': result.level[::STRIDE, 0].tolist(),
        'level_bits': digest(result.level),
    }


def paper_figures():
    scenes = protocol.SCENES.items()
    plates = {plate: protocol.simulate_trials(scene, [0]) for plate, scene in scenes}
    return protocol.run_protocol(plates, ChainConfig())


def grasp_figures():
    """Return what ``slip_grasp`` writes about two objects in simulated time."""
    command = [sys.executable, '-m', 'slip_detector.nodes.run', 'slip_grasp']
    with tempfile.TemporaryDirectory() as folder:
        words = ['--seeds', '2', '--live', '0', '--out', folder]
        subprocess.run([*command, *words], check=True, stdout=subprocess.DEVNULL)
        return json.loads((Path(folder) / 'grasp.json').read_text(encoding='utf-8'))


def figures_of_the_demo():
    """Return the figures of ``slip_demo`` as if each message arrived at once."""
    from slip_detector.evaluation.demo import Heard, demo_figures
    from slip_detector.parameters.detector import DetectorConfig

    config = DetectorConfig.from_yaml(ROOT / 'config' / 'slip_detector.yaml')
    samples = samples_of('plate_400um')
    stamps_s = samples.stamps_ns * 1e-9
    result = SlipChain(config).update(samples.volts)
    topics = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    topics += [f'slip/channel/{name}' for name in config.names]
    states = np.column_stack([result.slip, result.groups, result.channels])
    changes = {}
    for topic, state in zip(topics, states.T, strict=True):
        changed = np.diff(state, prepend=~state[:1])
        changes[topic] = stamps_s[changed], state[changed]
    heard = Heard(
        stamps_s, samples.volts, stamps_s, samples.position_m, np.zeros(len(stamps_s)), changes
    )
    return demo_figures(heard, config)


def parameters():
    """Return what users see of each parameter, by its set."""
    sets = sorted((RecordingConfig, *map(set_of, SECTIONS)), key=lambda kind: kind.__name__)
    return {
        kind.__name__: {
            field.name: {
                'type': str(field.type),
                'default': repr(field.metadata['default']),
                'allowed': allowed(field),
                **{key: field.metadata[key] for key in ('unit', 'low', 'high', 'heading')},
                'choices': list(field.metadata['choices']),
            }
            for field in dataclasses.fields(kind)
        }
        for kind in sets
    }


def topics():
    """Return the topics of each node: name, kind, type and quality of service."""
    found = {}
    for node, words in NODES.items():
        run = subprocess.run(
            [sys.executable, '-c', PRINT, node, '--ros-args', *words],
            env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        lines = [line for line in run.stdout.splitlines() if line.startswith('[[')]
        found[node] = [topic for topic in json.loads(lines[-1]) if topic[0] not in OF_RCLPY]
    return found


#: What makes the content of each golden file but that of the decisions.
WITHOUT_ROS = {'paper.json': paper_figures, 'parameters.json': parameters}
WITH_ROS = {'grasp.json': grasp_figures, 'demo.json': figures_of_the_demo, 'topics.json': topics}


def golden(name):
    return json.loads((GOLDEN / name).read_text(encoding='utf-8'))


def assert_same(found, wanted):
    """Compare to nine digits what two JSON objects hold; the last digits are the processor's."""
    (found, found_floats), (wanted, wanted_floats) = map(without_floats, (found, wanted))
    assert found == wanted
    assert found_floats == pytest.approx(wanted_floats, rel=1e-9, abs=1e-12, nan_ok=True)


def without_floats(content):
    """Return the text of a JSON object with null for each float, and the floats."""
    floats = []

    def take(number):
        floats.append(float(number))

    rest = json.loads(json.dumps(content), parse_float=take, parse_constant=take)
    return json.dumps(rest, indent=1), floats


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('scene', SCENES)
def test_every_scene_is_decided_as_it_was(scene, preset):
    kept = golden('decisions.json')
    found, wanted = decided(scene, preset), kept['scenes'][scene][preset]
    if kept['computer'] != computer():
        del found['level_bits'], wanted['level_bits']
    assert_same(found, wanted)


@pytest.mark.parametrize('name', WITHOUT_ROS)
def test_figures_and_parameters_are_what_they_were(name):
    assert_same(WITHOUT_ROS[name](), golden(name))


@pytest.mark.nodes
@pytest.mark.parametrize('name', WITH_ROS)
def test_figures_and_topics_of_nodes_are_what_they_were(name):
    pytest.importorskip('rclpy', reason='needs rclpy')
    assert_same(WITH_ROS[name](), golden(name))


def write(name, content):
    text = json.dumps(content, indent=1)
    (GOLDEN / name).write_text(text + '\n', encoding='utf-8')


if __name__ == '__main__':
    scenes = {scene: {preset: decided(scene, preset) for preset in PRESETS} for scene in SCENES}
    write('decisions.json', {'computer': computer(), 'scenes': scenes})
    for name, made in {**WITHOUT_ROS, **WITH_ROS}.items():
        write(name, made())
