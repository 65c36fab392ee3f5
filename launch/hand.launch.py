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

All drivers share a process, and all detectors: that takes half the processor time.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

PASSED_ON = (
    *('fingers', 'namespace', 'config', 'source', 'recording'),
    *('view', 'view_options'),
)


def generate_launch_description():
    share = FindPackageShare('slip_detector')
    one_finger = PathJoinSubstitution([share, 'launch', 'slip_detector.launch.py'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'fingers',
                default_value='thumb,index,middle,ring,little',
                description='Names of the fingers, with commas between; each is a namespace.',
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of the whole hand.'
            ),
            DeclareLaunchArgument(
                'config',
                default_value='',
                description='Parameter file of all nodes: a path, or the name of one of the '
                'package. Several, with commas between: a detector of each finger for each, in a '
                'namespace of its name. Empty: slip_detector.yaml, and simulated scenes unless '
                'source is given.',
            ),
            DeclareLaunchArgument(
                'source',
                default_value='',
                choices=['', 'scene', 'recording', 'serial', 'udp', 'none'],
                description='What the drivers play or listen to; none: no drivers, your sensors '
                'publish; empty: as in the parameter file.',
            ),
            DeclareLaunchArgument(
                'recording', default_value='', description='Path, for source:=recording.'
            ),
            DeclareLaunchArgument(
                'view',
                default_value='false',
                choices=['true', 'false'],
                description='Whether slip_view serves a live page of all fingers.',
            ),
            DeclareLaunchArgument(
                'view_options',
                default_value='',
                description='Its options, as --host 0.0.0.0 or --read-only.',
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(one_finger),
                launch_arguments=[(name, LaunchConfiguration(name)) for name in PASSED_ON],
            ),
        ]
    )
