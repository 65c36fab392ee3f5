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
from launch.actions import IncludeLaunchDescription, OpaqueFunction, SetLaunchConfiguration
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from slip_detector.nodes.launching import (
    clock_parameters,
    declarations,
    node_settings,
    source_settings,
)
from slip_detector.parameters import find_parameter_file, read_yaml, sections_of, shared_folder

# By name, the default value and what it is; the included launch file has the others.
ARGUMENTS = {
    'fingers': (
        '',
        'Names of fingers, with commas between: a pair of nodes for each, in a namespace of its '
        'name within the other; empty: one pair.',
    ),
    'config': (
        '',
        'Parameter file of all nodes: a path, or the name of one of the package. Several, with '
        'commas between: a detector for each, in a namespace of its name. Empty: '
        'slip_detector.yaml, and a simulated scene unless source is given.',
    ),
    'source': (
        '',
        'What the drivers play or listen to; none: no driver, your sensors publish; empty: as in '
        'the parameter file.',
    ),
    'recording': ('', 'Path, for source:=recording.'),
    'name': (
        '',
        "Name of the detector's node, and of its section in the parameter file; empty: "
        'slip_detector.',
    ),
    'voltages': (
        '',
        'Topic of the samples, such as that of a sensor with a driver of its own, for one '
        'parameter file only; empty: voltages.',
    ),
}
CHOICES = {'source': ['', 'scene', 'recording', 'serial', 'udp', 'none']}


def set_configs(context):
    """Set ``configs``, the paths of all parameter files, which have to be there.

    Without that the nodes would silently run on their defaults. A recording beside another source
    would not be played.
    """
    given = context.launch_configurations
    names = given['config'] or 'slip_detector.yaml'
    paths = [str(find_parameter_file(name.strip())) for name in names.split(',')]
    source, recording = given['source'], given['recording']
    if recording and source not in ('', 'recording'):
        raise ValueError(f'recording is {recording!r}, allowed: none beside source:={source}')
    return [SetLaunchConfiguration('configs', ','.join(paths))]


def nodes(context):
    """Start the nodes; an argument that is given replaces the value in the parameter file."""
    given = context.launch_configurations
    config, source, recording, voltages, name = (
        given[name] for name in ('config', 'source', 'recording', 'voltages', 'name')
    )
    configs = given['configs'].split(',')
    # Without a parameter file, a recording or a source the demonstration is played.
    source = source or ('' if config or recording else 'scene')
    arguments = ['--fingers', given['fingers']] if given['fingers'] else []
    several = len(configs) > 1
    settings, clock = node_settings(context), clock_parameters(context)
    settings['remappings'] = remappings = [('voltages', voltages)] if voltages else []
    sections = sections_of(read_yaml(configs[0]), configs[0])
    in_file = {key: value for _, its in sections for key, value in its.items()}
    of_driver, of_detector, played = source_settings(source, recording, in_file)
    detector = Node(
        executable='slip_detector',
        arguments=[*arguments, '--configs', ','.join(configs)] if several else arguments,
        parameters=[*([] if several else configs), of_detector, *clock],
        # With `name` launch gives the parameters to that of no finger.
        **settings | {'remappings': [*remappings, *([('__node', name)] if name else [])]},
    )
    # The driver waits for all detectors, so that none misses samples while it starts.
    of_driver['wait_for_subscribers'] = len(configs)
    if recording:
        of_driver['recording'] = ParameterValue(recording, value_type=str)
    driver = Node(
        executable='slip_driver',
        arguments=arguments,
        parameters=[configs[0], of_driver, *clock],
        # What has been played is not played again.
        **settings | {'respawn': settings['respawn'] and not played},
    )
    return [detector] if source == 'none' else [detector, driver]


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
