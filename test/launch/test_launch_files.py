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

"""What the launch files start, where all is well, and how a signal ends it."""

import asyncio
import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.nodes.messages import event_qos, state_qos
from slip_detector.parameters.grasp import GraspConfig
from support.harness import DEADLINE_S, patient_qos
from support.launching import SHARE, defaults_of, launch_file, launched, living
from support.live_client import LiveClient

OF_VIEW = {'namespace', 'configs', 'view', 'view_options', 'transport'}
OF_VIEW |= {'use_sim_time', 'log_level', 'use_respawn'}
ALL_FILES = OF_VIEW | {'config', 'source'}

#: A launch file of a hand that includes ours, with all that it may want to be different.
OF_A_HAND = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import SetParameter, SetRemap

# Fast DDS may delete the shared memory of a process that follows a killed one: hence udp.
# True as Nav2 has it.
ARGUMENTS = {{
    'namespace': 'hand', 'name': 'left_slip', 'log_level': 'DEBUG', 'use_sim_time': 'True',
    'use_respawn': 'True', 'transport': 'udp', 'config': {config!r}, 'source': 'scene',
}}
OF_THE_ROBOT = SetRemap('slip', '/grip/slip'), SetParameter('use_sim_time', True)


def generate_launch_description():
    ours = PythonLaunchDescriptionSource({ours!r})
    included = IncludeLaunchDescription(ours, launch_arguments=ARGUMENTS.items())
    return LaunchDescription([GroupAction([*OF_THE_ROBOT, included])])
"""


def test_the_arguments_of_included_files_are_shown_and_no_name_of_a_file_is_a_default():
    detector, grasp, hand = map(defaults_of, ('slip_detector', 'grasp', 'hand'))
    assert detector.keys() == ALL_FILES | {'fingers', 'recording', 'name', 'voltages'}
    assert defaults_of('view').keys() == OF_VIEW
    assert grasp.keys() == ALL_FILES | {'scene', 'seed'}
    # A name would also be that of a file in the folder in which somebody launches.
    assert detector['config'] == ''
    assert grasp['config'].startswith('/')
    assert hand == detector | {'fingers': 'thumb,index,middle,ring,little'}


@pytest.mark.parametrize(
    ('send', 'number', 'code'),
    [
        # As systemd does, supervisord with stopasgroup, and a terminal (SIGINT).
        (os.killpg, signal.SIGTERM, -signal.SIGTERM),
        (os.killpg, signal.SIGINT, 0),
        (os.kill, signal.SIGINT, 0),
    ],
    ids=['SIGTERM to the group', 'SIGINT to the group', 'SIGINT to ros2 launch'],
)
def test_a_signal_leaves_no_node_behind(bench, tmp_path, send, number, code):
    valid = bench.listen(Bool, 'slip_valid', state_qos())
    how = {'send': send, 'number': number, 'code': code}
    with launched(bench, tmp_path / 'log', 'slip_detector', 'source:=scene', **how) as launch:
        bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')
        assert len(living(launch.pid)) == 3
    bench.wait_for(lambda: not valid[-1].data, 'slip_valid to be withdrawn')


def test_a_detector_for_each_file_hears_the_one_driver_which_goes_on(bench, tmp_path):
    own = tmp_path / 'own.yaml'
    own.write_text('/**/slip_detector:\n  ros__parameters: {threshold: 0.2}\n')
    # One of the package by its name, and one by its path.
    words = 'namespace:=index', 'source:=scene', f'config:=onset.yaml,{own}'
    with launched(bench, tmp_path / 'log', 'slip_detector', *words) as launch:
        for name in ('onset', 'own'):
            valid = bench.listen(Bool, f'index/{name}/slip_valid', state_qos())
            slip = bench.listen(Bool, f'index/{name}/slip', state_qos())
            bench.wait_for(lambda heard=valid: heard and heard[-1].data, f'{name}/slip_valid')
            bench.wait_for(
                lambda heard=slip: any(message.data for message in heard), f'the slip of {name}'
            )
        assert bench.values_of('index/slip_driver', 'loop') == [True]
        assert len(living(launch.pid)) == 3


def test_a_detector_has_the_name_topics_and_log_level_of_its_hand_and_comes_back(bench, tmp_path):
    config, file, log = (tmp_path / name for name in ('hand.yaml', 'hand.launch.py', 'log'))
    sections = {'slip_detector': '{heartbeat_hz: 20.0}', 'slip_driver': '{source: udp}'}
    parameters = [f'/**/{name}: {{ros__parameters: {of}}}' for name, of in sections.items()]
    config.write_text('\n'.join(parameters))
    file.write_text(OF_A_HAND.format(config=str(config), ours=launch_file('slip_detector')))
    slip = bench.listen(Bool, 'grip/slip', state_qos())
    health = bench.listen(DiagnosticArray, '/diagnostics', event_qos())

    def starts():
        return re.findall(r'slip_detector-1\]: process started .*?(\d+)', log.read_text())

    def alive():
        names = [status.name for array in health for status in array.status]
        return 'hand/left_slip: input' in names

    with launched(bench, log, file, died=1):
        bench.wait_for(lambda: slip, 'the topic that was renamed')
        bench.wait_for(lambda: '[DEBUG]' in log.read_text(), 'a line of the level debug')
        os.kill(int(starts()[0]), signal.SIGKILL)
        bench.wait_for(lambda: len(starts()) == 2, 'the next process')
        health.clear()
        bench.wait_for(alive, 'its health, started again')


def test_the_object_of_a_grasp_slips_and_the_grip_rises_within_its_limit(bench, tmp_path):
    valid = bench.listen(Bool, 'hand/slip_valid', state_qos())
    forces = bench.listen(JointState, 'hand/grip_force', state_qos(depth=1000))
    position = bench.listen(JointState, 'hand/platform_position', patient_qos())
    onsets = bench.listen(Header, 'hand/slip_onset', event_qos())
    config = GraspConfig.from_yaml(SHARE / 'config' / 'grasp.yaml')
    words = 'namespace:=hand', 'seed:=3', 'config:=grasp.yaml'
    with launched(bench, tmp_path / 'log', 'grasp', *words) as launch:
        bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')
        bench.wait_for(lambda: forces and forces[-1].effort[0] >= config.grip_n, 'the grip')
        bench.wait_for(lambda: onsets, 'the slip of the scene')
        bench.wait_for(lambda: forces[-1].effort[0] > config.grip_n, 'the grip to rise')
        assert len(living(launch.pid)) == 4
    assert max(message.effort[0] for message in forces) <= config.limit_n
    assert list(position[-1].name) == ['object']


def test_the_slide_in_a_recording_is_found_by_the_file_of_its_sensor(bench, tmp_path):
    path, times_s = tmp_path / 'a.npz', np.arange(8000) / 2000
    wave = 1000 * np.sin(2 * np.pi * 60 * times_s) * (times_s > 1.0)
    np.savez(path, volts=np.tile(wave, (5, 1)).T, sample_rate_hz=2000.0)
    slip = bench.listen(Bool, 'slip', state_qos())
    words = 'config:=sensors/biotac.yaml', f'recording:={path}', 'voltages:=/rh/pac'
    with launched(bench, tmp_path / 'log', 'slip_detector', *words):
        bench.wait_for(lambda: any(message.data for message in slip), 'the slide')
        bench.wait_for(lambda: bench.node.count_publishers('/rh/pac') == 1, 'the one driver')


def test_the_page_of_a_hand_has_the_fingers_their_slips_and_their_file(bench, tmp_path):
    log = tmp_path / 'log'
    words = 'namespace:=left', 'fingers:=thumb, index', 'view:=true', 'transport:=udp'
    words += ('view_options:=--port 0 --read-only',)

    async def view(address):
        page = await LiveClient.open(address)
        message = await page.until('fingers', lambda content: len(content['fingers']) == 2)
        assert [each['label'] for each in message['fingers']] == ['left/index', 'left/thumb']
        assert message['read_only']
        await page.view()
        slipped = set()
        while len(slipped) < 2:
            header, _ = await page.drawn_frame()
            slipped |= {state['name'] for state in header['fingers'] if state['slip']}
        message = await page.until('parameters', lambda content: len(content['fingers']) == 2)
        files = {Path(finger['file']).name for finger in message['fingers'].values()}
        assert files == {'slip_detector.yaml'}
        assert not any(finger['differs'] for finger in message['fingers'].values())
        page.close()

    with launched(bench, log, 'hand', *words) as launch:
        bench.wait_for(lambda: 'slip_view: http://' in log.read_text(), 'the address')
        address = re.search(r'slip_view: (http://\S+)', log.read_text())[1]
        asyncio.run(asyncio.wait_for(view(address), DEADLINE_S))
        nodes = {*living(launch.pid)} - {launch.pid}
        maps = [Path(f'/proc/{pid}/maps').read_text() for pid in nodes]
        shares = [('libfast' in text, '/dev/shm/fast' in text) for text in maps]
        assert shares == [(True, False)] * 3
