"""One driver and one detector per finger, each pair in the finger's namespace.

ros2 launch slip_detector hand.launch.py fingers:=thumb,index,middle
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

PASSED_ON = ('config', 'source', 'recording')


def fingers_of(context):
    share = FindPackageShare('slip_detector')
    one_finger = PathJoinSubstitution([share, 'launch', 'slip_detector.launch.py'])
    prefix = LaunchConfiguration('namespace').perform(context).strip('/')
    text = LaunchConfiguration('fingers').perform(context)
    fingers = [finger.strip() for finger in text.split(',')]
    if not all(fingers) or len(set(fingers)) < len(fingers):
        raise ValueError(f'fingers is {text!r}, allowed: different names with commas between')
    return [
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(one_finger),
            launch_arguments={
                'namespace': f'{prefix}/{finger}' if prefix else finger,
                **{name: LaunchConfiguration(name) for name in PASSED_ON},
            }.items(),
        )
        for finger in fingers
    ]


def generate_launch_description():
    own_config = PathJoinSubstitution(
        [FindPackageShare('slip_detector'), 'config', 'slip_detector.yaml']
    )
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
                'config', default_value=own_config, description='Parameter file of all nodes.'
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
            OpaqueFunction(function=fingers_of),
        ]
    )
