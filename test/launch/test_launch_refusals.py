"""What launch files refuse before they start a node."""

import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from support.harness import package_share

reason = 'needs launch_testing and launch_ros, which come with a ROS 2 installation'
pytest.importorskip('launch', reason=reason)
pytest.importorskip('launch_ros', reason=reason)

SHARE = package_share()

#: What `ros2 launch` does with a file and its arguments.
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


@pytest.mark.parametrize(
    ('argument', 'words'),
    [
        ('scene:=plate_400um', "scene is 'plate_400um', allowed: a scene with an object"),
        ('scene:=plate', "no scene 'plate', allowed: dead_channel, "),
        ('seed:=-1', "seed is '-1', allowed: a whole number from 0"),
        ('config:=none.yaml', "config is 'none.yaml', allowed: the path of a parameter file"),
    ],
)
def test_a_wrong_argument_of_a_grasp_is_refused_in_one_line_and_no_node_starts(argument, words):
    file = SHARE / 'launch' / 'grasp.launch.py'
    command = [sys.executable, '-c', LAUNCH, str(file), argument]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    said = ended.stdout + ended.stderr
    assert ended.returncode == 1, said
    (line,) = [line for line in said.splitlines() if 'ERROR' in line]
    assert words in line
    assert 'process started' not in said
    assert 'Traceback' not in said
