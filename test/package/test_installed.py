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

"""The package as colcon installed it; skipped where colcon has not."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from support.pages import ROOT

PREFIX = os.environ.get('SLIP_DETECTOR_PREFIX', '')

pytestmark = pytest.mark.skipif(
    not PREFIX, reason='SLIP_DETECTOR_PREFIX does not name a folder that colcon installed into'
)

EXECUTABLES = re.findall(r"f'(\w+) = ", (ROOT / 'setup.py').read_text())


def test_the_index_and_all_shared_files_are_there():
    share = Path(PREFIX) / 'share'
    assert (share / 'ament_index/resource_index/packages/slip_detector').is_file()
    for name in (
        'package.xml',
        'launch/hand.launch.py',
        'config/slip_detector.yaml',
        'config/slip.rviz',
        'config/slip.plotjuggler.xml',
        'config/slip.foxglove.json',
        'examples/send_packets.c',
    ):
        assert (share / 'slip_detector' / name).is_file()


@pytest.mark.parametrize('name', EXECUTABLES)
def test_the_command_lines_run_where_ros2_run_looks_for_them(name):
    command = [Path(PREFIX) / 'lib' / 'slip_detector' / name, '--help']
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert name in done.stdout
