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

"""A driver and a detector per finger, each pair in the finger's namespace.

ros2 launch slip_detector hand.launch.py fingers:=thumb,index,middle

All drivers share one process, and all detectors another, which halves the processor time.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from slip_detector.parameters import shared_folder


def generate_launch_description():
    any_fingers = str(shared_folder() / 'launch' / 'slip_detector.launch.py')
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'fingers',
                default_value='thumb,index,middle,ring,little',
                description='Names of the fingers, with commas between; each is a namespace.',
            ),
            # It declares all other arguments.
            IncludeLaunchDescription(PythonLaunchDescriptionSource(any_fingers)),
        ]
    )
