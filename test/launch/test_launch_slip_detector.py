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

"""slip_detector.launch.py, run by launch_testing."""

import unittest

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.harness import patient_qos
from support.launching import check_ends, launch_testing, launched


@pytest.mark.launch_test
def generate_test_description():
    return launched('slip_detector', {'namespace': 'index', 'source': 'scene'})


class TestTopics(unittest.TestCase):
    def test_both_nodes_talk_in_the_namespace(self, bench):
        voltages = bench.listen(JointState, 'index/voltages', patient_qos())
        valid = bench.listen(Bool, 'index/slip_valid', state_qos())
        slip = bench.listen(Bool, 'index/slip', state_qos())
        bench.wait_for(lambda: len(voltages) > 100, 'voltages')
        bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')
        bench.wait_for(lambda: any(message.data for message in slip), 'the slip of the scene')


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_both_nodes_end_with_exit_code_0(self, proc_info, bench):
        check_ends(bench, proc_info, 2)
