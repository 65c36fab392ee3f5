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

"""A grasp: a driver that plays an object in a grip, a detector, and a grasp controller.

ros2 launch slip_detector grasp.launch.py seed:=7
"""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction, SetLaunchConfiguration
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from slip_detector.nodes.launching import clock_parameters, declarations, node_settings
from slip_detector.parameters import (
    commands_of_a_scene,
    find_parameter_file,
    read_yaml,
    shared_folder,
)
from slip_detector.scenes.scene import find_scene

# By name, the default value and what it is; the included launch file has the others.
ARGUMENTS = {
    'config': (
        str(shared_folder() / 'config' / 'grasp.yaml'),
        'Parameter file of all nodes: a path, or the name of one of the package.',
    ),
    'source': (
        'scene',
        'scene: a driver plays an object in a grip; none: no driver, your sensor publishes and '
        'your gripper follows grip_force.',
    ),
    'scene': (
        '',
        'Scene with an object, its name or path; empty: as in the parameter file.',
    ),
    'seed': ('', 'Seed of its noise.'),
}
CHOICES = {'source': ['scene', 'none']}


def set_configs(context):
    """Set ``configs``, the path of the parameter file, which has to be there."""
    path = find_parameter_file(context.launch_configurations['config'])
    return [SetLaunchConfiguration('configs', str(path))]


def nodes(context):
    """Start the nodes; an argument that is given replaces the value in the parameter file."""
    config, source, scene, seed = (
        context.launch_configurations[name] for name in ('configs', 'source', 'scene', 'seed')
    )
    # The driver waits for the other two: no sample is missed, and no object falls meanwhile.
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
    settings = node_settings(context)
    return [
        Node(
            executable=executable,
            parameters=[config, parameters, *clock_parameters(context)],
            # A controller that is started again would begin with an open grip.
            **settings | ({'respawn': False} if executable == 'grasp_controller' else {}),
        )
        for executable, parameters in executables.items()
    ]


def generate_launch_description():
    view = str(shared_folder() / 'launch' / 'view.launch.py')
    return LaunchDescription(
        [
            *declarations(ARGUMENTS, CHOICES),
            # First, so that no node starts if an argument of the page is refused.
            OpaqueFunction(function=set_configs),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(view)),
            OpaqueFunction(function=nodes),
        ]
    )
