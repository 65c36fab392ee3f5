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

"""hand.launch.py with a sensor for each finger, run by launch_testing."""

import tempfile
import unittest
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.harness import patient_qos
from support.launching import check_ends, launch_testing, launched
from support.sensors import SCALE_V, Sender, free_udp_port, make_packets, sending, vibration

RATE_HZ = 380.0

PORTS = {'thumb': free_udp_port(), 'index': free_udp_port()}

#: What is alike for both, and then what each has of its own.
CONFIG = '/**/slip_driver:\n  ros__parameters: {source: scene}\n' + ''.join(
    f'/left/{finger}/slip_driver:\n  ros__parameters: {{udp_port: {port}}}\n'
    for finger, port in PORTS.items()
)


@pytest.mark.launch_test
def generate_test_description():
    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name) / 'hand.yaml'
    path.write_text('/**/slip_detector:\n  ros__parameters: {}\n' + CONFIG)
    arguments = {'namespace': 'left', 'fingers': ','.join(PORTS), 'source': 'udp'}
    description, context = launched('hand', {**arguments, 'config': str(path)})
    return description, {**context, 'folder': folder}


class TestTopics(unittest.TestCase):
    def test_each_finger_hears_the_sensor_at_its_own_port(self, bench):
        for factor, (finger, port) in enumerate(PORTS.items(), 1):
            voltages = bench.listen(JointState, f'left/{finger}/voltages', patient_qos())
            slip = bench.listen(Bool, f'left/{finger}/slip', state_qos())
            rows = factor * vibration(20_000, RATE_HZ)
            sender = Sender(port)
            with sending(sender.send, make_packets(rows, RATE_HZ), RATE_HZ):
                bench.wait_for(lambda heard=slip: heard and heard[-1].data, f'slip of {finger}')
                # Two periods of the vibration and more: the highest value is among them.
                bench.wait_for(lambda heard=voltages: len(heard) > 200, f'samples of {finger}')
            sender.close()
            heard = {value for message in voltages for value in message.position}
            assert max(heard) == pytest.approx(SCALE_V * rows.max())


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_all_nodes_end_with_exit_code_0(self, proc_info, bench, folder):
        folder.cleanup()
        check_ends(bench, proc_info, 2)  # one of all drivers, one of all detectors
