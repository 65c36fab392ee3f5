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

"""What the demonstrations share: nodes as processes, exit codes."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

import rclpy

from slip_detector.nodes.demonstration import NodeProcesses, run_demonstration
from support.harness import DEADLINE_S


def nothing_comes():
    """Wait for messages, as a node that spins does."""
    time.sleep(0.02)


@pytest.fixture
def nodes():
    with NodeProcesses('demonstration', receive=nothing_comes) as nodes:
        yield nodes


def test_the_end_of_a_node_is_waited_for(nodes, tmp_path):
    path = tmp_path / 'rest.npz'
    np.savez(path, volts=np.full((20, 16), 4.3), sample_rate_hz=380.0)
    nodes.start('slip_driver', '-p', 'source:=recording', '-p', f'recording:={path}')
    nodes.wait_for_end('slip_driver', 'the recording to end', DEADLINE_S)


def test_a_node_that_fails_while_something_is_waited_for_is_named(nodes):
    nodes.start('slip_driver', '-p', 'source:=scene', '-p', 'scene:=moon')
    with pytest.raises(RuntimeError, match=r'^slip_driver ended with the exit code 1$'):
        nodes.wait_until(lambda: False, 'anything', DEADLINE_S)
    with pytest.raises(RuntimeError, match=r'^slip_driver ended with the exit code 1$'):
        nodes.wait_for_end('slip_driver', 'its end', DEADLINE_S)


def test_what_does_not_happen_in_time_is_named():
    received = []
    with NodeProcesses('demonstration', lambda: received.append(1)) as nodes:
        with pytest.raises(RuntimeError, match=r'^waited in vain for a miracle$'):
            nodes.wait_until(lambda: False, 'a miracle', timeout_s=0.0)
        nodes.wait_until(lambda: len(received) >= 3, 'three calls', DEADLINE_S)


def test_leaving_ends_the_nodes():
    with NodeProcesses('demonstration', nothing_comes) as nodes:
        nodes.start('slip_driver', '-p', 'source:=scene', '-p', 'wait_for_subscribers:=1')
        (process,) = nodes._processes.values()
        assert process.poll() is None
    assert process.poll() is not None


@pytest.mark.parametrize(
    ('error', 'code', 'said'),
    [
        (ValueError('no scene moon'), 1, 'slip_demo: no scene moon\n'),
        (RuntimeError('waited in vain'), 1, 'slip_demo: waited in vain\n'),
        (KeyboardInterrupt(), 130, ''),
    ],
)
def test_an_error_is_one_line_and_an_exit_code(capsys, error, code, said):
    def fails():
        raise error

    with pytest.raises(SystemExit) as ended:
        run_demonstration('slip_demo', fails)
    assert ended.value.code == code
    assert capsys.readouterr().err == said


@pytest.mark.parametrize('error', [TypeError('a mistake'), RuntimeError('a call was cut off')])
def test_an_error_after_a_signal_is_not_reported(capsys, error):
    def fails():
        rclpy.init()
        rclpy.get_default_context().shutdown()  # as the signal handler of rclpy does
        raise error

    with pytest.raises(SystemExit) as ended:
        run_demonstration('slip_demo', fails)
    assert ended.value.code == 130
    assert capsys.readouterr().err == ''


@pytest.mark.parametrize('initialise', [lambda: None, rclpy.init])
def test_a_mistake_in_a_demonstration_is_a_traceback(initialise):
    def fails():
        initialise()
        raise TypeError('a mistake')

    with pytest.raises(TypeError, match='a mistake'):
        run_demonstration('slip_demo', fails)
