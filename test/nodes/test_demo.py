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

"""The demonstration, run as a user runs it."""

import json
import signal

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import open_recording
from slip_detector.sources import open_source
from support.harness import DEADLINE_S, ROOT
from support.python_runs import run_python

pytest.importorskip('rosbags', reason='needs rosbags')


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp('demo')
    words = '--out', out, '--record', out / 'trial.mcap', '--verbose'
    done = run_python('-m', 'slip_detector.nodes.run', 'slip_demo', *words, timeout=2 * DEADLINE_S)
    assert done.returncode == 0, done.stderr
    assert 'no input any more' not in done.stderr
    return out, done.stdout


def test_the_figures_are_those_of_the_decisions_and_of_the_way_to_this_process(finished):
    figures = json.loads((finished[0] / 'demo.json').read_text())
    golden = json.loads((ROOT / 'test' / 'golden' / 'demo.json').read_text())
    assert figures['motion'] == pytest.approx(golden['motion'], abs=1e-3)
    # A message is never there before its sample, and hardly ever a second after it.
    for name in ('channel_delay_ms', 'group_delay_ms'):
        assert list(figures[name]) == list(golden[name])
        for topic, delay_ms in golden[name].items():
            assert delay_ms <= figures[name][topic] < delay_ms + 1e3
    assert golden['global_delay_ms'] <= figures['global_delay_ms']
    assert figures['mean_delay_ms'] == pytest.approx(
        np.mean([*figures['channel_delay_ms'].values()]), abs=0.01
    )
    assert figures['false_positive_percent'] < golden['false_positive_percent'] + 20.0
    assert 0.0 < figures['latency_ms']['median'] <= figures['latency_ms']['p99']
    assert 'Slip was seen' in finished[1]
    assert (finished[0] / 'demo.png').read_bytes().startswith(b'\x89PNG')


def test_the_recording_is_the_trial_with_its_labels(finished):
    wanted = open_source(DriverConfig(source='scene')).read(100_000)
    recording = open_recording(finished[0] / 'trial.mcap')
    pieces = list(recording.pieces(DetectorConfig().sample_rate_hz))
    assert np.concatenate([piece.volts for piece in pieces]).tobytes() == wanted.volts.tobytes()
    np.testing.assert_array_equal(np.concatenate([piece.truth for piece in pieces]), wanted.truth)
    assert recording.channel_names == DetectorConfig().names
    assert recording.counts.gaps == recording.counts.dropped == 0
    assert str(finished[0] / 'trial.mcap') in finished[1]


#: Starts a node and is killed when setpriv has become the node. While it does, it has no words.
KILLED = """
import os, pathlib, time
from slip_detector.nodes.processes import NodeProcesses
process = NodeProcesses('killed').start('slip_detector', '{file}')
# Ctrl-C of the terminal is not for it.
assert os.getpgid(process.pid) != os.getpgid(0)
words = pathlib.Path(f'/proc/{{process.pid}}/cmdline')
while b'setpriv' in (words.read_bytes() or b'setpriv'):
    time.sleep(0.01)
os.kill(os.getpid(), 9)
"""


def test_nodes_end_with_the_process_that_started_them_even_if_it_is_killed():
    # It does not return before the last process that has the pipe has ended.
    done = run_python(
        '-c', KILLED.format(file=ROOT / 'config' / 'slip_detector.yaml'), timeout=DEADLINE_S
    )
    assert done.returncode == -signal.SIGKILL


def test_signals_end_a_demonstration_and_its_nodes_quietly(bench, tmp_path):
    process = bench.start_executable('slip_demo', '--out', tmp_path, '--verbose')
    bench.wait_for(lambda: 'channels at' in process.log(), 'a node')
    for number in (signal.SIGINT, signal.SIGTERM):
        process.signal(number)
    assert process.wait() == 0
    assert process.lines()[-1] == 'slip_demo: interrupted before it was done'
    assert 'Traceback' not in process.log()
    bench.wait_for(lambda: 'slip_detector' not in bench.node.get_node_names(), 'the node to end')
