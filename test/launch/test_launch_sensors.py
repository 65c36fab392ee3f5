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

"""slip_detector.launch.py with the file of a sensor, on a bag of ROS 1, run by launch_testing."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import pytest
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.bags import START_NS, Bag
from support.launching import check_ends, launch_testing, launched


@pytest.mark.launch_test
def generate_test_description():
    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name, 'a.bag')
    finger, every = 'sr_robot_msgs/msg/Biotac', 'sr_robot_msgs/msg/BiotacAll'
    times_s = np.arange(8000) / 2000
    wave = np.rint(1000 * np.sin(2 * np.pi * 60 * times_s) * (times_s > 1.0)).astype(np.int16)
    types = [(finger, 'int16[] pac\n'), (every, 'Header header\nBiotac[5] tactiles\n')]
    with Bag(path, definitions=types) as bag:
        for k, rows in enumerate(wave.reshape(-1, 20), 1):
            fingers = [bag.make(finger, pac=rows)] * 5
            at_ns = START_NS + k * 10_000_000
            bag.write(
                '/rh/tactile', bag.make(every, header=bag.header(at_ns), tactiles=fingers), at_ns
            )
    arguments = {'config': 'sensors/biotac.yaml', 'recording': str(path)}
    description, context = launched('slip_detector', {**arguments, 'voltages': '/rh/pac'})
    return description, {**context, 'folder': folder}


class TestTopics(unittest.TestCase):
    def test_the_slide_in_the_bag_is_found(self, bench):
        heard = bench.listen(Bool, 'slip', state_qos())
        bench.wait_for(lambda: any(message.data for message in heard), 'the slide')
        assert bench.node.count_publishers('/rh/pac') == 1


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_both_processes_end_with_exit_code_0(self, proc_info, bench, folder):
        folder.cleanup()
        check_ends(bench, proc_info, 2)
