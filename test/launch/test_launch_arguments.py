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

"""The arguments that ``ros2 launch --show-args`` shows."""

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from support.harness import package_share

reason = 'needs launch_testing and launch_ros, which come with a ROS 2 installation'
launch = pytest.importorskip('launch', reason=reason)
pytest.importorskip('launch_ros', reason=reason)

from launch.launch_description_sources import PythonLaunchDescriptionSource  # noqa: E402
from launch.utilities import perform_substitutions  # noqa: E402

SHARE = package_share()

ALL_FILES = {'namespace', 'config', 'source', 'view', 'view_options'}


def shown(name):
    """Return the defaults of a launch file's arguments, read as without running it."""
    source = PythonLaunchDescriptionSource(str(SHARE / 'launch' / f'{name}.launch.py'))
    description = source.try_get_launch_description_without_context()
    return {
        argument.name: perform_substitutions(launch.LaunchContext(), argument.default_value)
        for argument in description.get_launch_arguments()
    }


def test_the_arguments_of_included_files_are_shown_too():
    assert shown('slip_detector').keys() == ALL_FILES | {'fingers', 'recording'}
    assert shown('hand').keys() == shown('slip_detector').keys()
    assert shown('grasp').keys() == ALL_FILES | {'scene', 'seed'}


def test_a_hand_has_five_fingers_unless_others_are_named():
    assert shown('slip_detector')['fingers'] == ''
    assert shown('hand')['fingers'] == 'thumb,index,middle,ring,little'
