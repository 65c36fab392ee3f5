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

"""slip_detector.launch.py with several parameter files, run by launch_testing."""

import tempfile
import unittest
from pathlib import Path

import pytest
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.launching import check_ends, launch_testing, launched


@pytest.mark.launch_test
def generate_test_description():
    own = Path(tempfile.mkdtemp()) / 'own.yaml'
    own.write_text('/**/slip_detector:\n  ros__parameters: {threshold: 0.2}\n')
    # One of the package by its name, and one by its path.
    configs = f'onset.yaml,{own}'
    arguments = {'namespace': 'index', 'source': 'scene', 'config': configs}
    return launched('slip_detector', arguments)


class TestTopics(unittest.TestCase):
    def test_a_detector_for_each_file_hears_the_one_driver(self, bench):
        for name in ('onset', 'own'):
            valid = bench.listen(Bool, f'index/{name}/slip_valid', state_qos())
            slip = bench.listen(Bool, f'index/{name}/slip', state_qos())
            bench.wait_for(lambda heard=valid: heard and heard[-1].data, f'{name}/slip_valid')
            bench.wait_for(
                lambda heard=slip: any(message.data for message in heard), f'the slip of {name}'
            )

    def test_the_driver_goes_on_after_the_end_of_the_scene(self, bench):
        assert bench.values_of('index/slip_driver', 'loop') == [True]


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_both_processes_end_with_exit_code_0(self, proc_info, bench):
        check_ends(bench, proc_info, 2)
