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

"""The grasp's demonstration, run as a user runs it."""

import argparse
import json

import pytest

from slip_detector.grasp.loop import (
    ANSWER_S,
    CONTROLLER,
    UNCONTROLLED,
    conditions,
    grasp_figures,
    play_trial,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.grasp import GraspConfig
from support.harness import compile_nodes
from support.python_runs import run_python

from slip_detector.nodes.demo import seed_range  # isort: skip, needs rclpy as the harness does

FIRST, LAST, LIVE = 5003, 5004, 1
SEEDS = [*range(FIRST, LAST + 1)]
TIMEOUT_S = 200.0


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
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


def test_the_objects_are_held_and_figures_table_and_picture_tell_of_them(finished):
    result = json.loads((finished[0] / 'grasp.json').read_text())
    assert result['seeds'] == SEEDS
    parts = result['conditions']
    assert parts[CONTROLLER]['dropped'] == 0
    assert parts[UNCONTROLLED]['dropped'] == len(SEEDS)
    (part,) = result['nodes'].values()
    assert list(result['nodes']) == [str(FIRST)]
    assert part['simulated']['slide_mm'] == parts[CONTROLLER]['slide_mm'][0]
    # On a busy machine the grip is raised late, so how far it slides, and if it falls, is open.
    assert part['slide_mm'] is None or part['slide_mm'] > 0.0
    assert GraspConfig().grip_n < part['command_percent'] / 100 * GraspConfig().limit_n * 1.01
    latency_ms = result['latency_ms']
    assert latency_ms is None or 0.0 < latency_ms['median'] <= latency_ms['most'] < 1e3 * ANSWER_S
    words = (*conditions(ChainConfig(), GraspConfig()), 'smallest grip', 'nodes')
    for word in words:
        assert word in finished[1]
    assert f'figures: {finished[0] / "grasp.json"}' in finished[1]
    assert (finished[0] / 'grasp.png').read_bytes().startswith(b'\x89PNG')


def test_the_figures_of_the_docs_are_those_of_thirty_objects():
    file = shared_folder() / 'config' / 'grasp.yaml'
    chain, grasp = ChainConfig.from_yaml(file), GraspConfig.from_yaml(file)
    found = grasp_figures(
        [play_trial(chain, grasp, seed) for seed in seed_range('30')], grasp.limit_n
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
