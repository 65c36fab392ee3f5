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

"""grasp.launch.py, run by launch_testing."""

import unittest

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.nodes.messages import event_qos, state_qos
from slip_detector.parameters.grasp import GraspConfig
from support.harness import patient_qos
from support.launching import SHARE, check_ends, launch_testing, launched

CONFIG = SHARE / 'config' / 'grasp.yaml'


@pytest.mark.launch_test
def generate_test_description():
    return launched('grasp', {'namespace': 'hand', 'seed': '3', 'config': 'grasp.yaml'})


class TestGrasp(unittest.TestCase):
    def test_the_object_slips_and_the_grip_rises_within_its_limit(self, bench):
        valid = bench.listen(Bool, 'hand/slip_valid', state_qos())
        forces = bench.listen(JointState, 'hand/grip_force', state_qos(depth=1000))
        position = bench.listen(JointState, 'hand/platform_position', patient_qos())
        onsets = bench.listen(Header, 'hand/slip_onset', event_qos())
        config = GraspConfig.from_yaml(CONFIG)
        bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')
        bench.wait_for(lambda: forces and forces[-1].effort[0] >= config.grip_n, 'the grip')
        bench.wait_for(lambda: onsets, 'the slip of the scene')
        bench.wait_for(lambda: forces[-1].effort[0] > config.grip_n, 'the grip to rise')
        assert max(message.effort[0] for message in forces) <= config.limit_n
        assert list(position[-1].name) == ['object']


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_all_three_nodes_end_with_exit_code_0(self, proc_info, bench):
        check_ends(bench, proc_info, 3)
