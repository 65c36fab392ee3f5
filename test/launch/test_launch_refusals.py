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

"""What launch files refuse before they start a node, and what the nodes they start refuse."""

import os
import signal
import subprocess

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from support.harness import DEADLINE_S
from support.launching import launching


def refused(name, argument):
    """Launch a file that is to end without having started a node; return what it says."""
    command = launching(name, argument)
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    said = ended.stdout + ended.stderr
    assert ended.returncode == 1, said
    assert 'process started' not in said
    return said


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
    said = refused('grasp', argument)
    (line,) = [line for line in said.splitlines() if 'ERROR' in line]
    assert words in line
    assert 'Traceback' not in said


@pytest.mark.parametrize('name', ['slip_detector', 'hand', 'grasp'])
def test_no_node_starts_where_an_argument_of_the_page_is_refused(name):
    assert "Valid options are: ['true', 'false']" in refused(name, 'view:=maybe')


@pytest.mark.parametrize(
    ('text', 'arguments', 'words'),
    [
        (
            'slip_driver:\n  ros__parameters: {source: serial, serial_port: /dev/none}\n',
            ['namespace:=index'],
            'has sections for slip_driver, none for this node, /index/slip_driver, allowed: ',
        ),
        (
            '/**/slip_detector:\n  ros__parameters: {threshold: 0.7}\n',
            [],
            'parameter source is not given, allowed: ',
        ),
    ],
    ids=['a file for another namespace', 'a file without a source'],
)
def test_no_simulation_takes_the_place_of_a_sensor(bench, tmp_path, text, arguments, words):
    config = tmp_path / 'robot.yaml'
    config.write_text(text)
    log = tmp_path / 'log'
    with log.open('w') as output:
        launched = subprocess.Popen(
            launching('slip_detector', f'config:={config}', *arguments),
            env={**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)},
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        bench.wait_for(lambda: words in log.read_text(), 'the refusal')
        bench.wait_for(lambda: 'process has died' in log.read_text(), 'the driver to end')
    finally:
        os.killpg(launched.pid, signal.SIGINT)
        launched.wait(timeout=DEADLINE_S)
    (line,) = [line for line in log.read_text().splitlines() if words in line]
    assert 'slip_driver' in line
    assert 'playing' not in log.read_text()
