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

"""The demonstrations, run as a user runs them."""

import argparse
import json
import signal

import numpy as np
import pytest

from slip_detector.grasp import loop
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.recordings import open_recording
from slip_detector.sources import open_source
from support.harness import DEADLINE_S, ROOT, compile_nodes
from support.python_runs import run_python

from slip_detector.nodes.demo import seed_range  # isort: skip, needs rclpy as the harness does


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    pytest.importorskip('rosbags', reason='needs rosbags')
    compile_nodes()
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
    process.end_quietly(signal.SIGINT, signal.SIGTERM)
    assert process.lines()[-1] == 'slip_demo: interrupted before it was done'
    bench.wait_for(lambda: 'slip_detector' not in bench.node.get_node_names(), 'the node to end')


FIRST, LAST, LIVE = 5003, 5004, 1
SEEDS = [*range(FIRST, LAST + 1)]
TIMEOUT_S = 200.0


@pytest.fixture(scope='module')
def grasped(tmp_path_factory):
    compile_nodes()
    out = tmp_path_factory.mktemp('grasp')
    words = '--seeds', f'{FIRST}:{LAST}', '--live', str(LIVE), '--out', str(out)
    done = run_python('-m', 'slip_detector.nodes.run', 'slip_grasp', *words, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    for words in ('2 objects in simulated time: controller\n', f'seed {FIRST} through the nodes'):
        assert words in done.stderr
    # The nodes end with the object, and none misses another before.
    assert 'no input any more' not in done.stderr
    assert 'cannot be relied on (slip' not in done.stderr
    return out, done.stdout


def test_the_objects_are_held_and_figures_table_and_picture_tell_of_them(grasped):
    result = json.loads((grasped[0] / 'grasp.json').read_text())
    assert result['seeds'] == SEEDS
    parts = result['conditions']
    assert parts[loop.CONTROLLER]['dropped'] == 0
    assert parts[loop.UNCONTROLLED]['dropped'] == len(SEEDS)
    (part,) = result['nodes'].values()
    assert list(result['nodes']) == [str(FIRST)]
    assert part['simulated']['slide_mm'] == parts[loop.CONTROLLER]['slide_mm'][0]
    # On a busy machine the grip is raised late, so how far it slides, and if it falls, is open.
    assert part['slide_mm'] is None or part['slide_mm'] > 0.0
    assert GraspConfig().grip_n < part['command_percent'] / 100 * GraspConfig().limit_n * 1.01
    if result['latency_ms'] is not None:
        median_ms, most_ms = result['latency_ms'].values()
        assert 0.0 < median_ms <= most_ms < 1e3 * loop.ANSWER_S
    words = (*loop.conditions(ChainConfig(), GraspConfig()), 'smallest grip', 'nodes')
    for word in words:
        assert word in grasped[1]
    assert f'figures: {grasped[0] / "grasp.json"}' in grasped[1]
    assert (grasped[0] / 'grasp.png').read_bytes().startswith(b'\x89PNG')


def test_the_figures_of_the_docs_are_those_of_thirty_objects():
    file = shared_folder() / 'config' / 'grasp.yaml'
    chain, grasp = ChainConfig.from_yaml(file), GraspConfig.from_yaml(file)
    found = loop.grasp_figures(
        [loop.play_trial(chain, grasp, seed) for seed in seed_range('30')], grasp.limit_n
    )
    assert found['trials'] == 30
    assert found['dropped'] == 0
    assert found['mean_slide_mm'] == pytest.approx(0.06, abs=0.005)
    assert found['worst_slide_mm'] == pytest.approx(0.21, abs=0.005)
    assert found['force_percent'] == pytest.approx(40.2, abs=0.1)


def test_seeds_are_a_number_of_them_or_the_first_and_the_last_and_others_are_refused():
    for text, seeds in {'3': [0, 1, 2], '5000:5001': [5000, 5001], '7:7': [7]}.items():
        assert list(seed_range(text)) == seeds
    for text in ('0', '-2', '9:8', '-1:3', '1:', ':', '1:2:3', 'x', '1.5'):
        with pytest.raises(argparse.ArgumentTypeError, match=f'is {text}, allowed: '):
            seed_range(text)
