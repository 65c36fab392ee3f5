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

"""Launch files of the installed package, in a test of launch_testing or as a process.

A module that imports this one is skipped where launch or the installed package is missing.
"""

import os
import subprocess
from pathlib import Path

import pytest

from support.harness import Bench

reason = 'needs launch_testing and ros2 launch, which come with a ROS 2 installation'
launch_testing = pytest.importorskip('launch_testing', reason=reason)
pytest.importorskip('ros2launch', reason=reason)

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.utilities import perform_substitutions
from launch_testing.actions import ReadyToTest
from launch_testing.asserts import assertExitCodes

try:
    #: The folder of the installed package.
    SHARE = Path(get_package_share_directory('slip_detector'))
except PackageNotFoundError:
    pytest.skip('the package is not built and sourced', allow_module_level=True)


def launch_file(name):
    """Return the path of an installed launch file."""
    return str(SHARE / 'launch' / f'{name}.launch.py')


def launching(name, *arguments):
    """Return the command that launches a file, ours by name, with arguments as ``name:=value``."""
    file = name if isinstance(name, Path) else launch_file(name)
    return ['ros2', 'launch', str(file), *arguments]


def start_launch(bench, log, *words, **options):
    """Launch a file in the domain of a bench, with its output in a file; return the process."""
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    with log.open('w') as output:
        return subprocess.Popen(
            launching(*words), env=environment, stdout=output, stderr=subprocess.STDOUT, **options
        )


def defaults_of(name):
    """Return the defaults of a launch file's arguments, found without running it."""
    source = PythonLaunchDescriptionSource(launch_file(name))
    description = source.try_get_launch_description_without_context()
    return {
        argument.name: perform_substitutions(LaunchContext(), argument.default_value)
        for argument in description.get_launch_arguments()
    }


def launched(name, arguments):
    """Describe a test of a launch file, in a domain of its own."""
    bench = Bench()
    os.environ['ROS_DOMAIN_ID'] = str(bench.domain)
    included = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(launch_file(name)), launch_arguments=arguments.items()
    )
    return LaunchDescription([included, ReadyToTest()]), {'bench': bench}


def check_ends(bench, proc_info, count):
    """Check the number of launched processes, and that each has ended with exit code 0."""
    bench.close()
    assert len(proc_info.process_names()) == count
    assertExitCodes(proc_info)
