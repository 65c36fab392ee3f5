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

"""A driver and a detector; or, in one process of each kind, both for every finger.

ros2 launch slip_detector slip_detector.launch.py namespace:=index config:=my.yaml source:=none

With several parameter files there is a detector for each, in a namespace named after the file; the
driver uses the first file.
"""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetLaunchConfiguration,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from slip_detector.nodes.run import node_settings, sim_time, source_settings
from slip_detector.parameters.files import find_parameter_file
from slip_detector.parameters.sections import our_sections


def set_configs(context):
    """Set ``configs``, the paths of all parameter files, which have to be there.

    Without that the nodes would silently run on their defaults. A recording beside another source
    would not be played.
    """
    names = LaunchConfiguration('config').perform(context) or 'slip_detector.yaml'
    paths = [str(find_parameter_file(name.strip())) for name in names.split(',')]
    source, recording = (
        LaunchConfiguration(name).perform(context) for name in ('source', 'recording')
    )
    if recording and source not in ('', 'recording'):
        raise ValueError(f'recording is {recording!r}, allowed: none beside source:={source}')
    return [SetLaunchConfiguration('configs', ','.join(paths))]


def nodes(context):
    """Start the nodes; an argument that is given replaces the value in the parameter file."""
    config, source, recording, voltages, name = (
        LaunchConfiguration(name).perform(context)
        for name in ('config', 'source', 'recording', 'voltages', 'name')
    )
    configs = LaunchConfiguration('configs').perform(context).split(',')
    # Without a parameter file, a recording or a source the demonstration is played.
    source = source or ('' if config or recording else 'scene')
    fingers = LaunchConfiguration('fingers').perform(context)
    arguments = ['--fingers', fingers] if fingers else []
    several = len(configs) > 1
    settings, clock = node_settings(context), sim_time(context)
    settings['remappings'] = remappings = [('voltages', voltages)] if voltages else []
    in_file = {key: value for _, its in our_sections(configs[0]) for key, value in its.items()}
    of_driver, of_detector, played = source_settings(source, recording, in_file)
    given = [of_detector, *clock]
    detector = Node(
        executable='slip_detector',
        arguments=[*arguments, '--configs', ','.join(configs)] if several else arguments,
        parameters=given if several else [*configs, *given],
        # With `name` launch gives the parameters to that of no finger.
        **settings | {'remappings': [*remappings, *([('__node', name)] if name else [])]},
    )
    # The driver waits for all detectors, so that none misses samples while it starts.
    given = {'wait_for_subscribers': len(configs), **of_driver}
    if recording:
        given['recording'] = ParameterValue(recording, value_type=str)
    driver = Node(
        executable='slip_driver',
        arguments=arguments,
        parameters=[configs[0], given, *clock],
        # What has been played is not played again.
        **settings | {'respawn': settings['respawn'] and not played},
    )
    return [detector] if source == 'none' else [detector, driver]


def generate_launch_description():
    share = FindPackageShare('slip_detector')
    view = PathJoinSubstitution([share, 'launch', 'view.launch.py'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of all nodes.'
            ),
            DeclareLaunchArgument(
                'fingers',
                default_value='',
                description='Names of fingers, with commas between: a pair of nodes for each, in '
                'a namespace of its name within the other; empty: one pair.',
            ),
            DeclareLaunchArgument(
                'config',
                default_value='',
                description='Parameter file of all nodes: a path, or the name of one of the '
                'package. Several, with commas between: a detector for each, in a namespace of '
                'its name. Empty: slip_detector.yaml, and a simulated scene unless source is '
                'given.',
            ),
            DeclareLaunchArgument(
                'source',
                default_value='',
                choices=['', 'scene', 'recording', 'serial', 'udp', 'none'],
                description='What the drivers play or listen to; none: no driver, your sensors '
                'publish; empty: as in the parameter file.',
            ),
            DeclareLaunchArgument(
                'recording', default_value='', description='Path, for source:=recording.'
            ),
            DeclareLaunchArgument(
                'name',
                default_value='',
                description="Name of the detector's node, and of its section in the parameter "
                'file; empty: slip_detector.',
            ),
            DeclareLaunchArgument(
                'voltages',
                default_value='',
                description='Topic of the samples, such as that of a sensor with a driver of its '
                'own, for one parameter file only; empty: voltages.',
            ),
            # First, so that no node starts if an argument of the page is refused.
            OpaqueFunction(function=set_configs),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(view)),
            OpaqueFunction(function=nodes),
        ]
    )
