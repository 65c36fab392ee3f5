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

"""A grasp: a driver that plays an object in a grip, a detector, and a controller of the grip.

ros2 launch slip_detector grasp.launch.py seed:=7
"""

import shlex
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from slip_detector.parameters.grasp import commands_of_a_scene
from slip_detector.parameters.reading import read_yaml
from slip_detector.scenes.scene_files import find_scene


def nodes(context):
    """Start the nodes; an argument that is given replaces the value in the parameter file."""
    config, source, scene, seed = (
        LaunchConfiguration(name).perform(context)
        for name in ('config', 'source', 'scene', 'seed')
    )
    if not Path(config).is_file():
        # The nodes would run on their defaults, unasked.
        raise FileNotFoundError(f'config is {config!r}, allowed: the path of a parameter file')
    # The detector misses nothing while it starts, and nothing falls while the controller does.
    given = {'source': 'scene', 'wait_for_subscribers': 1, 'wait_for_grip': True}
    if scene:
        if 'object' not in read_yaml(find_scene(scene)):
            raise ValueError(f'scene is {scene!r}, allowed: a scene with an object')
        given['scene'] = ParameterValue(scene, value_type=str)
    if seed:
        if not seed.isdecimal():
            raise ValueError(f'seed is {seed!r}, allowed: a whole number from 0')
        given['seed'] = int(seed)
    executables = {'slip_detector': {}, 'grasp_controller': {}}
    if source != 'none':
        executables['slip_driver'] = given
        executables['grasp_controller'] = commands_of_a_scene()
    namespace = LaunchConfiguration('namespace')
    view = Node(
        package='slip_detector',
        executable='slip_view',
        namespace=namespace,
        arguments=[
            *('--config', config),
            *shlex.split(LaunchConfiguration('view_options').perform(context)),
        ],
        output='screen',  # It prints the address of the page.
        condition=IfCondition(LaunchConfiguration('view')),
    )
    return [
        *(
            Node(
                package='slip_detector',
                executable=executable,
                namespace=namespace,
                parameters=[config, parameters],
            )
            for executable, parameters in executables.items()
        ),
        view,
    ]


def generate_launch_description():
    own_config = PathJoinSubstitution([FindPackageShare('slip_detector'), 'config', 'grasp.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of all nodes.'
            ),
            DeclareLaunchArgument(
                'config', default_value=own_config, description='Parameter file of all nodes.'
            ),
            DeclareLaunchArgument(
                'source',
                default_value='scene',
                choices=['scene', 'none'],
                description='scene: a driver plays an object in a grip; none: no driver, your '
                'sensor publishes and your gripper follows grip_force.',
            ),
            DeclareLaunchArgument(
                'scene',
                default_value='',
                description='Scene with an object, its name or path; empty: as in the parameter '
                'file.',
            ),
            DeclareLaunchArgument('seed', default_value='', description='Seed of its noise.'),
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
            OpaqueFunction(function=nodes),
        ]
    )
