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

"""The executables of the nodes: their words, and how they end."""

import os
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from slip_detector.chain.compiled import COMPILED
from slip_detector.nodes.run import EXECUTABLES, _arguments_of_each
from support.harness import compile_nodes

#: What an executable does not start without.
STARTED_WITH = {'slip_driver': {'source': 'scene'}}


def run(*words):
    command = [sys.executable, '-m', 'slip_detector.nodes.run', *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(autouse=True, scope='module')
def _compiled():
    compile_nodes()


def check_that_it_says_goodbye(bench, process, executable, number, code):
    bench.wait_for(lambda: executable in bench.node.get_node_names(), 'the node')
    process.signal(number)
    assert process.wait() == code
    ended_s = time.monotonic()
    bench.wait_until_forgotten(executable)
    # One that says nothing is forgotten after 14 to 20 s.
    assert time.monotonic() - ended_s < 8.0


@pytest.mark.parametrize('executable', EXECUTABLES)
def test_a_node_that_ends_says_goodbye(bench, executable):
    process = bench.start(executable, parameters=STARTED_WITH.get(executable))
    check_that_it_says_goodbye(bench, process, executable, signal.SIGTERM, 0)


# Runs an executable whose node, after a method of its base, waits for a signal.
WAITING = """
import signal, sys, time
import rclpy
from rclpy.node import Node
from slip_detector.nodes.run import main

name, told = sys.argv.pop(), []
method = getattr(Node, name)
signal.signal(signal.SIGUSR1, lambda *_: told.append(True))

def call_and_wait(self, *words, **named):
    result = method(self, *words, **named)
    deadline_s = time.monotonic() + 60.0
    while rclpy.ok() and not told and time.monotonic() < deadline_s:
        time.sleep(0.001)
    return result

setattr(Node, name, call_and_wait)
main(sys.argv.pop(1))
"""


@pytest.mark.parametrize(
    ('executable', 'method'),
    [
        ('slip_driver', 'get_logger'),
        ('slip_detector', 'create_timer'),
        ('grasp_controller', 'create_timer'),
    ],
)
def test_a_node_that_a_signal_ends_while_it_is_made_says_goodbye(bench, executable, method):
    words = ['--ros-args', '-p', 'source:=scene'] if executable == 'slip_driver' else []
    process = bench.start_python('-c', WAITING, executable, *words, method)
    check_that_it_says_goodbye(bench, process, executable, signal.SIGTERM, 0)


def test_help_says_how_a_parameter_file_is_given():
    done = run('slip_detector', '--help')
    assert (done.returncode, done.stderr) == (0, '')
    assert '  slip_detector --ros-args --params-file my_sensor.yaml\n' in done.stdout


def test_parameter_files_for_several_nodes_are_for_detectors_only():
    done = run('slip_driver', '--configs', 'a.yaml,b.yaml')
    assert done.returncode == 1
    assert done.stderr == 'slip_driver: --configs is given, allowed: for slip_detector only\n'


@pytest.mark.parametrize(
    ('executable', 'word'),
    [('slip_driver', '--finger'), ('slip_detector', '-v'), ('grasp_controller', 'thumb')],
)
def test_a_word_that_is_not_known_stops_the_start(executable, word):
    done = run(executable, word, 'thumb', '--ros-args', '-p', 'use_sim_time:=false')
    assert done.returncode == 1
    assert done.stderr == (
        f'{executable}: {word} is not known, allowed: --fingers, --configs, and --ros-args\n'
    )


def test_a_parameter_file_is_refused_in_our_words_before_rcl_reads_it(tmp_path):
    file = tmp_path / 'a.yaml'
    file.write_text('a: 1\na: 2\n')
    done = run('slip_detector', '--ros-args', '--params-file', str(file))
    assert done.returncode == 1
    assert (
        done.stderr == f'slip_detector: {file}: line 2: has a again, as in line 1, allowed: once\n'
    )


def test_an_option_is_given_once():
    done = run('slip_detector', '--fingers', 'thumb', '--fingers', 'index')
    assert done.returncode == 1
    assert done.stderr == 'slip_detector: --fingers is given twice, allowed: once\n'


@pytest.mark.parametrize('finger', ['1', 'ü', '../b', 'a/b', 'a__b', 'a b', 'a' * 65])
def test_a_finger_that_cannot_be_a_namespace_stops_the_start(finger):
    words = ['slip_detector', '--fingers', f'thumb,{finger}']
    with pytest.raises(ValueError, match=rf"^--fingers has '{finger}', allowed: up to 64 letters"):
        _arguments_of_each(words, words)


@pytest.mark.parametrize('given', ['__ns:=/ü', '__node:=1'])
def test_a_name_that_ros_does_not_take_is_no_traceback(given):
    done = run('slip_detector', '--ros-args', '-r', given)
    assert done.returncode == 1
    assert done.stderr.strip().splitlines()[-1].startswith('slip_detector: ')
    assert 'Traceback' not in done.stderr


LOGGED = """
from slip_detector.nodes.run import log_compiling
from slip_detector.chain.stamps import StampGrid

log_compiling('slip_detector')
grid = StampGrid(1.0, 1.0)
for stamp_ns in (0, 10**9, 2 * 10**9):
    grid.arrive(stamp_ns)
grid.arrive_all(__import__('numpy').arange(3) + 3 * 10**9)
"""


@pytest.mark.skipif(not COMPILED, reason='without Numba nothing is compiled')
def test_the_log_says_once_that_something_is_compiled_and_only_when_it_is(tmp_path):
    def logged():
        return subprocess.run(
            [sys.executable, '-c', LOGGED],
            env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)},
            capture_output=True, text=True, check=True, timeout=120,
        ).stderr  # fmt: skip

    (line,) = logged().splitlines()
    assert '[slip_detector]: compiling slip_detector.chain, which takes some seconds' in line
    assert logged() == ''


@pytest.mark.skipif(not COMPILED, reason='without Numba nothing is compiled')
@pytest.mark.parametrize('executable', ['slip_detector', 'slip_driver'])
def test_a_signal_ends_a_node_before_it_has_compiled_all(bench, monkeypatch, tmp_path, executable):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    given = {'source': 'scene'} if executable == 'slip_driver' else {}
    process = bench.start(executable, parameters=given)
    bench.wait_for(lambda: 'compiling slip_detector.' in process.log(), 'the node to compile')
    process.signal(signal.SIGINT)
    assert process.wait() == 0
    assert len(process.lines()) == 1
    # The start of a driver compiles more than thirty functions.
    assert len(list(tmp_path.rglob('*.nbi'))) < 20


@pytest.mark.parametrize(
    ('of_ros', 'wanted'),
    [
        ([], '/thumb'),
        (['--ros-args', '-r', '__ns:=/left'], '/left/thumb'),
        (['--ros-args', '-r', '__ns:=/'], '/thumb'),
        (['--ros-args', '-r', '__ns:=/a', '-r', '__ns:=/b/c/'], '/b/c/thumb'),
    ],
)
def test_a_finger_is_a_namespace_in_that_of_the_process(of_ros, wanted):
    ours = ['slip_detector', '--fingers', 'thumb']
    assert _arguments_of_each(ours + of_ros, ours) == [['--ros-args', '-r', f'__ns:={wanted}']]


@pytest.mark.parametrize(
    ('of_ros', 'fingers', 'above'),
    [
        ([], [], ['']),
        (['--ros-args', '-r', '__ns:=/left'], [], ['/left']),
        (['--ros-args', '-r', '__ns:=/left'], ['--fingers', 'a,b'], ['/left/a', '/left/b']),
    ],
)
def test_each_parameter_file_is_a_namespace_and_all_of_a_finger_have_the_same_input(
    of_ros, fingers, above
):
    ours = ['slip_detector', *fingers, '--configs', 'onset.yaml, etc/sure.yaml']
    assert _arguments_of_each(ours + of_ros, ours) == [
        [
            *('--ros-args', '-r', f'__ns:={namespace}/{name}'),
            *('-r', f'voltages:={namespace}/voltages', '--params-file', path),
        ]
        for namespace in above
        for name, path in (('onset', 'onset.yaml'), ('sure', 'etc/sure.yaml'))
    ]


@pytest.mark.parametrize('files', ['a.yaml,b/a.yaml', 'my sensor.yaml', '1.yaml,2.yaml'])
def test_parameter_files_that_cannot_be_namespaces_are_refused(files):
    with pytest.raises(ValueError, match=r'--configs is .*, allowed: files with different names'):
        _arguments_of_each(['--configs', files], ['--configs', files])
