"""What `ros2 launch` does, as a process; the command itself comes with ROS 2 only."""

import sys

LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

file, *words = sys.argv[1:]
arguments = [word.split(':=', 1) for word in words]
service = LaunchService()
service.include_launch_description(
    LaunchDescription(
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(file), launch_arguments=arguments)]
    )
)
sys.exit(service.run())
"""


def launching(file, *arguments):
    """Return the command that launches a file with arguments as ``name:=value``."""
    return [sys.executable, '-c', LAUNCH, str(file), *arguments]
