"""One driver and one detector; or, with one process of each kind, both for every finger.

ros2 launch slip_detector slip_detector.launch.py namespace:=index config:=my.yaml source:=none
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def nodes(context):
    """Start the nodes; an argument that is given replaces the value in the parameter file."""
    config, source, recording = (
        LaunchConfiguration(name).perform(context) for name in ('config', 'source', 'recording')
    )
    if not Path(config).is_file():
        # The nodes would run on their defaults, unasked.
        raise FileNotFoundError(f'config is {config!r}, allowed: the path of a parameter file')
    namespace = LaunchConfiguration('namespace')
    fingers = LaunchConfiguration('fingers').perform(context)
    arguments = ['--fingers', fingers] if fingers else []
    detector = Node(
        package='slip_detector',
        executable='slip_detector',
        namespace=namespace,
        arguments=arguments,
        parameters=[config],
    )
    # The detector misses nothing while it starts.
    given = {'wait_for_subscribers': 1}
    if source:
        given['source'] = source
    if recording:
        given['recording'] = ParameterValue(recording, value_type=str)
    driver = Node(
        package='slip_detector',
        executable='slip_driver',
        namespace=namespace,
        arguments=arguments,
        parameters=[config, given],
    )
    return [detector] if source == 'none' else [detector, driver]


def generate_launch_description():
    own_config = PathJoinSubstitution(
        [FindPackageShare('slip_detector'), 'config', 'slip_detector.yaml']
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of both nodes.'
            ),
            DeclareLaunchArgument(
                'fingers',
                default_value='',
                description='Names of fingers, with commas between: a pair of nodes for each, in '
                'a namespace of its name within the other; empty: one pair.',
            ),
            DeclareLaunchArgument(
                'config', default_value=own_config, description='Parameter file of both nodes.'
            ),
            DeclareLaunchArgument(
                'source',
                default_value='',
                choices=['', 'scene', 'recording', 'serial', 'udp', 'none'],
                description='What the driver plays or listens to; none: no driver, your sensor '
                'publishes; empty: as in the parameter file.',
            ),
            DeclareLaunchArgument(
                'recording', default_value='', description='Path, for source:=recording.'
            ),
            OpaqueFunction(function=nodes),
        ]
    )
