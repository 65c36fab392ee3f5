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

"""The topics of the nodes, their types and their qualities of service are what they were.

The golden file is written anew by ``python test/golden/test_topics.py``; a change to it is a
decision, which the message of its commit names.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

GOLDEN = Path(__file__).with_name('topics.json')

#: Parameters of each node: all topics that they can add.
NODES = {
    'slip_driver': {'source': 'scene', 'scene': 'grasp', 'wait_for_grip': 'true'},
    'slip_detector': {'publish_channels': 'true'},
    'grasp_controller': {},
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
    self.spin = self.spin_once = lambda **named: print_and_end(self)

Executor.__init__ = initialise_to_print
main(sys.argv.pop(1))
"""


def topics_of(executable, parameters):
    """Return the topics of a node: name, kind, type and quality of service of each."""
    pytest.importorskip('rclpy', reason='needs rclpy')
    given = [word for item in parameters.items() for word in ('-p', ':='.join(item))]
    run = subprocess.run(
        [sys.executable, '-c', PRINT, executable, '--ros-args', *given],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
    )
    lines = [line for line in run.stdout.splitlines() if line.startswith('[[')]
    return [topic for topic in json.loads(lines[-1]) if topic[0] not in OF_RCLPY]


@pytest.mark.nodes
@pytest.mark.parametrize('executable', NODES)
def test_topics_are_what_they_were(executable):
    golden = json.loads(GOLDEN.read_text(encoding='utf-8'))
    assert topics_of(executable, NODES[executable]) == golden[executable]


if __name__ == '__main__':
    made = {name: topics_of(name, parameters) for name, parameters in NODES.items()}
    GOLDEN.write_text(json.dumps(made, indent=1) + '\n', encoding='utf-8')
