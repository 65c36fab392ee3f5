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

"""What launch files refuse before they start a node."""

import subprocess

import pytest

from support.launching import launching


def refused(name, *arguments, started=False):
    """Launch a file that is to end by itself, with or without a node; return what it says."""
    command = launching(name, *arguments)
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    said = ended.stdout + ended.stderr
    assert ended.returncode == 1, said
    assert ('process started' in said) == started
    return said


@pytest.mark.parametrize(
    ('name', 'arguments', 'words'),
    [
        ('grasp', ['scene:=plate_400um'], "scene is 'plate_400um', allowed: a scene with an obj"),
        ('grasp', ['scene:=plate'], "no scene 'plate', allowed: dead_channel, "),
        ('grasp', ['seed:=-1'], "seed is '-1', allowed: a whole number from 0"),
        ('grasp', ['config:=none.yaml'], "config is 'none.yaml', allowed: the path of a param"),
        ('hand', ['source:=none', 'recording:=a'], "recording is 'a', allowed: none beside sour"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_line_and_no_node_starts(name, arguments, words):
    said = refused(name, *arguments)
    (line,) = [line for line in said.splitlines() if 'ERROR' in line]
    assert words in line
    assert 'Traceback' not in said


@pytest.mark.parametrize('name', ['hand', 'grasp'])
def test_no_node_starts_where_an_argument_of_the_page_is_refused(name):
    assert "Valid options are: ['true', 'True', " in refused(name, 'view:=maybe')


@pytest.mark.parametrize(
    ('name', 'arguments', 'node'),
    [
        ('slip_detector', ['source:=scene'], 'slip_detector'),
        ('grasp', [], 'grasp_controller'),
        ('view', ['view:=true', 'view_options:=--host nowhere.invalid'], 'slip_view'),
    ],
)
def test_a_node_that_refuses_to_start_ends_the_launch(
    bench, tmp_path, monkeypatch, name, arguments, node
):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(bench.domain))
    config = tmp_path / 'wrong.yaml'
    config.write_text(f'/**/{node}:\n  ros__parameters: {{of_nobody: 1}}\n')
    if name != 'view':
        arguments = [*arguments, f'config:={config}']
    said = refused(name, *arguments, started=True)
    assert f'{node}-' in said.split('Caught exception in launch')[1]
    # The others were ended, and none was left.
    assert said.count('process started') == said.count('process has')
