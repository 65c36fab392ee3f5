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
from launch.actions import OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from slip_detector.nodes.launching import clock_parameters, declarations, node_settings

# As users of other launch files write them.
TRUE_OR_FALSE = ['true', 'True', 'TRUE', '1', 'false', 'False', 'FALSE', '0']
# By name, the default value and what it is.
ARGUMENTS = {
    'namespace': ('', 'Namespace of all nodes.'),
    'configs': (
        '',
        "Paths of the detectors' parameter files, with commas between, for the live page; where "
        'there is an argument config, it sets them.',
    ),
    'view': ('false', 'Whether slip_view serves a live page of all fingers.'),
    'view_options': ('', 'Options of slip_view, such as --host 0.0.0.0 or --read-only.'),
    'transport': (
        '',
        'udp: the nodes use no shared memory, so that Fast DDS does not hold them up when others '
        'join; empty: what the middleware uses.',
    ),
    'use_sim_time': (
        'false',
        'true: time comes from /clock; false: as in the parameter file.',
    ),
    'log_level': (
        'info',
        'Least severity of what the nodes log: debug, info, warn, error, fatal.',
    ),
    'use_respawn': (
        'false',
        'Whether a node that dies is started again after 2 s. Not the grasp controller: it would '
        'begin with an open grip.',
    ),
}
CHOICES = dict.fromkeys(('view', 'use_sim_time', 'use_respawn'), TRUE_OR_FALSE)
CHOICES['transport'] = ['', 'udp']


def page(context):
    """Start the node that serves the page."""
    options = shlex.split(context.launch_configurations['view_options'])
    node = Node(
        executable='slip_view',
        arguments=['--config', context.launch_configurations['configs'], *options],
        parameters=clock_parameters(context),
        output='screen',  # It prints the address of the page.
        **node_settings(context),
    )
    return [node]


def generate_launch_description():
    return LaunchDescription(
        [
            *declarations(ARGUMENTS, CHOICES),
            OpaqueFunction(function=page, condition=IfCondition(LaunchConfiguration('view'))),
        ]
    )
