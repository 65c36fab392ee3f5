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

"""examples/ros2_control.yaml: a grasp controller commands the joints of a gripper."""

import pytest
import yaml

from slip_detector.parameters.grasp import FLOAT64_ARRAY, GraspConfig
from support.pages import ROOT

EXAMPLE = ROOT / 'examples' / 'ros2_control.yaml'


def test_the_controllers_of_the_example_take_what_it_commands():
    sections = yaml.safe_load(EXAMPLE.read_text())
    config = GraspConfig.from_yaml(EXAMPLE)
    assert config.command_type == FLOAT64_ARRAY
    name = config.command_topic.removeprefix('/').removesuffix('/commands')
    assert name in sections['controller_manager']['ros__parameters']
    controller = sections[name]['ros__parameters']
    assert tuple(controller['joints']) == config.command_joints
    assert controller['interface_name'] == 'effort'


@pytest.mark.nodes
def test_each_joint_gets_its_share_of_the_force_through_slip(bench):
    from rclpy.qos import qos_profile_system_default
    from std_msgs.msg import Float64MultiArray

    from support.harness import Beating

    config = GraspConfig.from_yaml(EXAMPLE)
    # The profile with which ros2_control's controllers subscribe.
    commands = bench.listen(Float64MultiArray, config.command_topic, qos_profile_system_default)
    detector = Beating(bench)
    quick = {'closing_n_s': 50.0, 'settle_s': 0.0}
    bench.start('grasp_controller', '--params-file', EXAMPLE, parameters=quick)

    def commanded(force_n):
        wanted = [config.command_factor * force_n] * 2
        return lambda: commands and list(commands[-1].data) == pytest.approx(wanted)

    detector.wait_for(commanded(config.grip_n), 'the grip to close')
    detector.say(slip=True)
    detector.wait_for(commanded(config.limit_n), 'the limit')
    assert {len(command.data) for command in commands} == {2}
    assert bench.node.count_publishers('grip_force') == 0
