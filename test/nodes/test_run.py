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

import re
import signal
import sys
import time
from pathlib import Path

import pytest
from std_msgs.msg import Bool

from slip_detector.compiled import COMPILED
from slip_detector.nodes.launching import transport_environment
from slip_detector.nodes.messages import state_qos
from slip_detector.nodes.spinning import _arguments_of_each
from support.harness import ROOT, compile_nodes
from support.python_runs import run_python

#: Parameters of drivers: of a scene, and of a sensor that is not there.
SCENE, SENSOR = {'source': 'scene'}, {'source': 'serial', 'serial_port': '/dev/none'}

GRASP = str(ROOT / 'config' / 'grasp.yaml')


def run(*words):
    return run_python('-m', 'slip_detector.nodes.run', *words)


@pytest.fixture(autouse=True, scope='module')
def _compiled():
    compile_nodes()


@pytest.mark.parametrize(
    ('executable', 'parameters', 'said'),
    [
        ('slip_driver', SCENE, 'playing'),
        ('slip_driver', SENSOR, '/dev/none'),
        ('slip_detector', {}, '16 channels'),
        ('grasp_controller', {}, 'waiting for the detector'),
    ],
)
def test_a_node_that_ends_says_goodbye(bench, executable, parameters, said):
    process = bench.start(executable, parameters=parameters)
    bench.wait_for(lambda: executable in bench.node.get_node_names(), 'the node')
    bench.wait_for(lambda: said in process.log(), said)
    # Those of a terminal and of a parent come at once.
    process.end_quietly(signal.SIGINT, signal.SIGTERM, signal.SIGINT)
    ended_s = time.monotonic()
    bench.wait_until_forgotten(executable)
    # One that says nothing is forgotten after 14 to 20 s.
    assert time.monotonic() - ended_s < 8.0


@pytest.mark.parametrize(
    ('start', 'name'), [('driver', 'slip_driver'), ('view', 'slip_view'), ('demo', 'slip_demo')]
)
def test_without_rclpy_one_line_says_what_is_needed(start, name):
    begin = "import sys; sys.modules['rclpy'] = None"
    done = run_python('-c', f'{begin}; from slip_detector.nodes import run; run.{start}()')
    assert done.returncode == 1
    assert re.fullmatch(rf'{name}: needs ROS 2 \(.*rclpy.*\): source .*\n', done.stderr)


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['slip_driver', '--configs', GRASP], f'unrecognized arguments: --configs {GRASP}'),
        (['slip_detector', '--finger', 'thumb'], 'unrecognized arguments: --finger thumb'),
        (['slip_detector', '--ros-args', '-r', '__ns:=/1'], 'Failed to parse ROS arguments: '),
        (['slip_detector', '--ros-args', '-r', f'__ns:=/{"a" * 300}'], ''),
        (['slip_detector', '--ros-args', 'bogus'], ''),
        (['slip_demo', '--seed', '-1'], 'argument --seed: is '),
        (['slip_grasp', '--seeds', '1:0'], 'argument --seeds: is 1:0, allowed: N, at least 1'),
    ],
)
def test_a_word_that_is_not_known_or_allowed_stops_the_start_with_one_line(words, said):
    done = run(*words)
    assert done.returncode == (2 if said.startswith(('unrecognized', 'argument')) else 1)
    assert done.stderr.splitlines()[-1].startswith(f'{words[0]}: {said}')
    assert 'Traceback' not in done.stderr


def test_parameters_are_refused_in_our_words_before_rcl_reads_them(tmp_path):
    file = tmp_path / 'a.yaml'
    file.write_text('slip_detector: {ros__parameters: {passband_hz: [10, 100.0]}}\n')
    said = 'passband_hz is [10, 100.0], allowed: numbers of one kind: write 10.0\n'
    for where, *words in (
        (file, '--params-file', str(file)),
        ('-p', '-p', 'passband_hz:=[10, 100.0]'),
    ):
        done = run('slip_detector', '--ros-args', *words)
        assert (done.returncode, done.stderr) == (1, f'slip_detector: {where}: {said}')


@pytest.mark.skipif(not COMPILED, reason='without Numba nothing is compiled')
@pytest.mark.parametrize(('executable', 'given'), [('slip_detector', {}), ('slip_driver', SCENE)])
def test_a_signal_ends_a_node_before_it_has_compiled_all(
    bench, monkeypatch, tmp_path, executable, given
):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    process = bench.start(executable, parameters=given)
    bench.wait_for(lambda: 'compiling' in process.log(), 'the node to compile')
    process.end_quietly()
    assert 'all takes up to a minute, the first time' in process.lines()[0]
    # The start of a driver compiles more than thirty functions.
    assert len(list(tmp_path.rglob('*.nbi'))) < 20


def arguments_of_each(monkeypatch, *words):
    monkeypatch.setattr(sys, 'argv', ['slip_detector', *words])
    return [' '.join(arguments) for arguments in _arguments_of_each('slip_detector')]


#: The parameter files of a detector each: one of the package by its name, and one by its path.
CONFIGS = '--configs', f'onset.yaml, {GRASP}'
ONSET = str(ROOT / 'config' / 'onset.yaml')


def of_configs(above):
    """Return the arguments of the detectors of a finger, which have the same input."""
    return [
        f'-r __ns:={above}/{name} -r voltages:={above}/voltages --params-file {path} -p gain:=2.0'
        for name, path in (('onset', ONSET), ('grasp', GRASP))
    ]


@pytest.mark.parametrize(
    ('options', 'of_ros', 'wanted'),
    [
        # A finger is a namespace in that of the process.
        (['--fingers', 'thumb'], '', ['-r __ns:=/thumb']),
        (['--fingers', 'thumb'], '-r __ns:=/left', ['-r __ns:=/left/thumb']),
        (['--fingers', 'thumb'], '-r __ns:=/', ['-r __ns:=/thumb']),
        (['--fingers', 'thumb'], '-r __ns:=/a -r __ns:=/b/c/', ['-r __ns:=/b/c/thumb']),
        # What follows a parameter file is given to each node again.
        ([], f'-p a:=1 --params-file {GRASP}', ['']),
        ([], f'--params-file {GRASP} --param vote:=2 -r slip:=/slip', ['--param vote:=2']),
        # Each parameter file is a namespace.
        (CONFIGS, '-p gain:=2.0', of_configs('')),
        (CONFIGS, '-r __ns:=/left -p gain:=2.0', of_configs('/left')),
        (
            [*CONFIGS, '--fingers', 'a,b'],
            '-r __ns:=/left -p gain:=2.0',
            [*of_configs('/left/a'), *of_configs('/left/b')],
        ),
    ],
)
def test_each_node_of_a_process_has_arguments_of_its_own(monkeypatch, options, of_ros, wanted):
    found = arguments_of_each(monkeypatch, *options, '--ros-args', *of_ros.split())
    assert found == [f'--ros-args {words}'.strip() for words in wanted]


@pytest.mark.parametrize(
    ('option', 'text'),
    [
        *(('--fingers', text) for text in ('1', 'ü', '../b', 'a__b', 'a b', 'a' * 65, 'a,,b')),
        *(('--configs', text) for text in ('a.yaml,b/a.yaml', 'my sensor.yaml', '1.yaml')),
    ],
)
def test_names_that_cannot_be_namespaces_are_refused(monkeypatch, option, text):
    with pytest.raises(ValueError, match=rf'^{option} gives the namespaces .*, allowed: diff'):
        arguments_of_each(monkeypatch, option, text)


@pytest.mark.parametrize(
    ('where', 'transport', 'shares'),
    [('LOCALHOST', '', True), ('LOCALHOST', 'udp', False), ('SUBNET', 'udp', False)],
)
def test_a_node_without_shared_memory_is_heard_by_one_with_it(
    bench, monkeypatch, where, transport, shares
):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', where)
    given = {'ROS_AUTOMATIC_DISCOVERY_RANGE': where, **transport_environment(transport)}
    slip = bench.listen(Bool, 'slip', state_qos())
    process = bench.start('slip_detector', environment=given)
    bench.wait_for(lambda: slip, 'slip')
    assert ('/dev/shm/fast' in Path(f'/proc/{process.pid}/maps').read_text()) == shares
    assert 'deprecated' not in process.log()


def test_a_transport_is_refused_beside_a_profile_that_may_give_another(monkeypatch):
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', 'own.xml')
    assert transport_environment('') == {}
    with pytest.raises(ValueError, match="transport is 'udp', allowed: none beside FAST"):
        transport_environment('udp')


SIGNALLED = """
import signal, time
from slip_detector.nodes.ending import END_SIGNAL, end_on_signals, init_ros

end_on_signals()
{begin}
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
    signal.raise_signal(number)
END_SIGNAL.wait()
print('is to end', flush=True)
time.sleep(3600)
"""


@pytest.mark.parametrize(('begin', 'said'), [('', ''), ('init_ros()', 'is to end\n')])
def test_a_process_ends_at_once_or_is_asked_to_and_ends_soon_whatever_it_does(begin, said):
    done = run_python('-c', SIGNALLED.format(begin=begin), timeout=60.0)
    assert (done.returncode, done.stdout, done.stderr) == (0, said, '')
