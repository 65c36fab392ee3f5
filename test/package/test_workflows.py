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

"""What continuous integration does on the usual host."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]

#: The long-term releases whose images are in https://hub.docker.com/_/ros: add the next one when
#: its image is there.
IMAGES = ['ros:jazzy-ros-base', 'ros:lyrical-ros-base']


def test_all_checks_run_on_the_wheels_and_a_build_in_each_official_image():
    workflow = yaml.safe_load((ROOT / '.github' / 'workflows' / 'ci.yml').read_text())
    wheels, robot = workflow['jobs']['wheels'], workflow['jobs']['robot']
    runs = [step['run'] for step in wheels['steps'] if 'run' in step]
    assert runs == ['make test ROS=${{ matrix.ros }}']
    matrix = [step['run'] for step in workflow['jobs']['matrix']['steps'] if 'run' in step]
    assert matrix == ['make test-matrix']
    known = re.findall(r"ros_wheels\('(\w+)'\)", (ROOT / 'setup.py').read_text())
    assert wheels['strategy']['matrix']['ros'] == known
    names = robot['strategy']['matrix']['ros']
    assert [robot['container'].replace('${{ matrix.ros }}', name) for name in names] == IMAGES
    commands = '\n'.join(step.get('run', '') for step in robot['steps'])
    assert 'colcon build --packages-select slip_detector' in commands
    for path in re.findall(r'test/[\w/.]+', commands):
        assert (ROOT / path).exists(), path
