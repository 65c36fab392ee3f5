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

"""The live page, if ``view`` is true; included by the other launch files.

ros2 launch slip_detector view.launch.py view:=true
"""

import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from slip_detector.nodes.run import node_settings, sim_time

# As users of other launch files write them.
TRUE_OR_FALSE = ['true', 'True', 'TRUE', '1', 'false', 'False', 'FALSE', '0']
LEVELS = [
    write(level)
    for level in ('debug', 'info', 'warn', 'error', 'fatal')
    for write in (str.lower, str.title, str.upper)
]


def page(context):
    """Start the node that serves the page."""
    options = shlex.split(LaunchConfiguration('view_options').perform(context))
    node = Node(
        executable='slip_view',
        arguments=['--config', LaunchConfiguration('configs'), *options],
        parameters=sim_time(context),
        output='screen',  # It prints the address of the page.
        **node_settings(context),
    )
    return [node]


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of all nodes.'
            ),
            DeclareLaunchArgument(
                'configs',
                default_value='',
                description="Paths of the detectors' parameter files, with commas between, for "
                'the live page; where there is an argument config, it sets them.',
            ),
            DeclareLaunchArgument(
                'view',
                default_value='false',
                choices=TRUE_OR_FALSE,
                description='Whether slip_view serves a live page of all fingers.',
            ),
            DeclareLaunchArgument(
                'view_options',
                default_value='',
                description='Options of slip_view, such as --host 0.0.0.0 or --read-only.',
            ),
            DeclareLaunchArgument(
                'transport',
                default_value='',
                choices=['', 'udp'],
                description='udp: the nodes use no shared memory, so that Fast DDS does not hold '
                'them up when others join; empty: what the middleware uses.',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                choices=TRUE_OR_FALSE,
                description='true: time comes from /clock; false: as in the parameter file.',
            ),
            DeclareLaunchArgument(
                'log_level',
                default_value='info',
                choices=LEVELS,
                description='Least severity of what the nodes log.',
            ),
            DeclareLaunchArgument(
                'use_respawn',
                default_value='false',
                choices=TRUE_OR_FALSE,
                description='Whether a node that dies is started again after 2 s. Not the grasp '
                'controller: it would begin with an open grip.',
            ),
            OpaqueFunction(function=page, condition=IfCondition(LaunchConfiguration('view'))),
        ]
    )
