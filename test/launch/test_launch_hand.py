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

"""hand.launch.py, run by launch_testing."""

import unittest

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.harness import patient_qos
from support.launching import check_ends, launch_testing, launched

FINGERS = ('thumb', 'index')


@pytest.mark.launch_test
def generate_test_description():
    return launched('hand', {'namespace': 'left', 'fingers': ', '.join(FINGERS)})


class TestTopics(unittest.TestCase):
    def test_each_finger_has_a_pair_of_nodes_in_its_namespace(self, bench):
        for finger in FINGERS:
            voltages = bench.listen(JointState, f'left/{finger}/voltages', patient_qos())
            valid = bench.listen(Bool, f'left/{finger}/slip_valid', state_qos())
            bench.wait_for(lambda heard=voltages: len(heard) > 100, f'voltages of {finger}')
            bench.wait_for(lambda heard=valid: heard and heard[-1].data, f'{finger}/slip_valid')


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_both_processes_end_with_exit_code_0(self, proc_info, bench):
        check_ends(bench, proc_info, 2)
