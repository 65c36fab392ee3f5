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

"""Launch files of the installed package, run by ``ros2 launch``.

A module that imports this one is skipped where launch or the installed package is missing.
"""

import contextlib
import os
import signal
import subprocess
from pathlib import Path

import pytest

from support.harness import DEADLINE_S

pytest.importorskip('ros2launch', reason='needs ros2 launch, of a ROS 2 installation')

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from launch import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.utilities import perform_substitutions

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


def living(group):
    """Return the processes of a group that have not ended, whether or not somebody asked."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            _, _, rest = stat.read_text().rpartition(') ')
        except OSError:
            continue  # It has just gone.
        state, _, group_of_process, *_ = rest.split()
        if int(group_of_process) == group and state != 'Z':
            found.append(int(stat.parent.name))
    return found


@contextlib.contextmanager
def launched(bench, log, *words, send=os.kill, number=signal.SIGINT, code=0, died=0):
    """Launch a file in the domain of a bench; give the process, and end it by a signal.

    ``ros2 launch`` has to end with the exit code, and all its processes with it, without an error
    in the log but for processes that have died.
    """
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain), 'PYTHONUNBUFFERED': '1'}
    with log.open('w') as output:
        launch = subprocess.Popen(
            launching(*words), env=environment, stdout=output, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
    try:
        yield launch
        send(launch.pid, number)
        assert launch.wait(timeout=DEADLINE_S) == code, log.read_text()
        bench.wait_for(lambda: not living(launch.pid), 'all nodes to end')
    finally:
        print(log.read_text())  # pytest shows this if the test fails.
        for process in living(launch.pid):
            os.kill(process, signal.SIGKILL)
        launch.wait()
    assert 'Traceback' not in log.read_text()
    assert log.read_text().count('process has died') == died


def defaults_of(name):
    """Return the defaults of a launch file's arguments, found without running it."""
    source = PythonLaunchDescriptionSource(launch_file(name))
    description = source.try_get_launch_description_without_context()
    return {
        argument.name: perform_substitutions(LaunchContext(), argument.default_value)
        for argument in description.get_launch_arguments()
    }
