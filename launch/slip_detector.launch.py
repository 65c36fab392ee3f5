"""One driver and one detector.

ros2 launch slip_detector slip_detector.launch.py namespace:=index config:=my.yaml source:=none
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


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
            Node(
                package='slip_detector',
                executable='slip_driver',
                namespace=namespace,
                parameters=[config, {'source': source, 'recording': recording}],
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
