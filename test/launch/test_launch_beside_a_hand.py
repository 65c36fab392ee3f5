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

"""A launch file of a hand's own that includes ours, with all that it may want to be different."""

import os
import re
import signal

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool

from slip_detector.nodes.messages import event_qos, state_qos
from support.harness import DEADLINE_S
from support.launching import launch_file, start_launch

CONFIG = """
/**/slip_detector:
  ros__parameters: {heartbeat_hz: 20.0}
/**/slip_driver:
  ros__parameters: {source: udp}
"""

OF_A_HAND = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import SetParameter, SetRemap

# Fast DDS may delete the shared memory of a process that follows a killed one: hence udp.
# True as Nav2 has it.
ARGUMENTS = {{
    'namespace': 'hand', 'name': 'left_slip', 'log_level': 'DEBUG', 'use_sim_time': 'True',
    'use_respawn': 'True', 'transport': 'udp', 'config': {config!r}, 'source': 'scene',
}}
OF_THE_ROBOT = SetRemap('slip', '/grip/slip'), SetParameter('use_sim_time', True)


def generate_launch_description():
    ours = PythonLaunchDescriptionSource({ours!r})
    included = IncludeLaunchDescription(ours, launch_arguments=ARGUMENTS.items())
    return LaunchDescription([GroupAction([*OF_THE_ROBOT, included])])
"""


def test_a_detector_has_the_name_topics_and_log_level_of_its_hand_and_comes_back(bench, tmp_path):
    config, file, log = (tmp_path / name for name in ('hand.yaml', 'hand.launch.py', 'log'))
    config.write_text(CONFIG)
    file.write_text(OF_A_HAND.format(config=str(config), ours=launch_file('slip_detector')))
    slip = bench.listen(Bool, 'grip/slip', state_qos())
    health = bench.listen(DiagnosticArray, '/diagnostics', event_qos())

    def starts():
        return re.findall(r'slip_detector-1\]: process started .*?(\d+)', log.read_text())

    launched = start_launch(bench, log, file)
    try:
        bench.wait_for(lambda: slip, 'the topic that was renamed')
        bench.wait_for(lambda: '[DEBUG]' in log.read_text(), 'a line of the level debug')
        os.kill(int(starts()[0]), signal.SIGKILL)
        bench.wait_for(lambda: len(starts()) == 2, 'the next process')
        health.clear()

        def alive():
            names = [status.name for array in health for status in array.status]
            return 'hand/left_slip: input' in names

        bench.wait_for(alive, 'its health, started again')
        launched.send_signal(signal.SIGINT)
        assert launched.wait(timeout=DEADLINE_S) == 0, log.read_text()
    finally:
        launched.kill()
