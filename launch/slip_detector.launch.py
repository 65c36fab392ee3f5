"""One driver and one detector.

ros2 launch slip_detector slip_detector.launch.py namespace:=index config:=my.yaml source:=none
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def check_config(context):
    """Refuse a file that is not there: the nodes would run on their defaults, unasked."""
    config = LaunchConfiguration('config').perform(context)
    if not Path(config).is_file():
        raise FileNotFoundError(f'config is {config!r}, allowed: the path of a parameter file')


def generate_launch_description():
    namespace = LaunchConfiguration('namespace')
    config = LaunchConfiguration('config')
    source = LaunchConfiguration('source')
    own_config = PathJoinSubstitution(
        [FindPackageShare('slip_detector'), 'config', 'slip_detector.yaml']
    )
    recording = LaunchConfiguration('recording')
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='Namespace of both nodes.'
            ),
            DeclareLaunchArgument(
                'config', default_value=own_config, description='Parameter file of both nodes.'
            ),
            DeclareLaunchArgument(
                'source',
                default_value='scene',
                choices=['scene', 'recording', 'none'],
                description='What the driver plays; none: no driver, your sensor publishes.',
            ),
            DeclareLaunchArgument(
                'recording', default_value='', description='Path, for source:=recording.'
            ),
            OpaqueFunction(function=check_config),
            Node(
                package='slip_detector',
                executable='slip_driver',
                namespace=namespace,
                parameters=[
                    config,
                    # The detector misses nothing while it starts.
                    {'source': source, 'recording': recording, 'wait_for_subscribers': 1},
                ],
                condition=IfCondition(PythonExpression(["'", source, "' != 'none'"])),
            ),
            Node(
                package='slip_detector',
                executable='slip_detector',
                namespace=namespace,
                parameters=[config],
            ),
        ]
    )
