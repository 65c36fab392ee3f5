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

"""How far objects slide in a simulated grasp, in the ordinary condition and in harder ones.

Keys of ``python -m benchmarks grasp --json``:

``controller``
    The figures of :func:`slip_detector.grasp.loop.grasp_figures` for ``config/grasp.yaml``.
``lag``, ``half_ridges``, ``quarter_ridges``
    The same with a gripper of 60 ms of lag, and with ridges half and a quarter as high.
"""

import argparse
from typing import Any

from benchmarks.measurement import Bound, shared_options
from slip_detector.grasp.loop import grasp_figures, play_trial
from slip_detector.parameters import ChainConfig, GraspConfig, shared_folder

WANTED = {
    'controller.dropped': Bound(high=0.0),
    'controller.mean_slide_mm': Bound(high=0.2),
    'controller.worst_slide_mm': Bound(high=0.6),
    'controller.force_percent': Bound(high=43.0),
    'lag.mean_slide_mm': Bound(high=0.5, strict=True),
    'lag.worst_slide_mm': Bound(high=3.5, strict=True),
    'half_ridges.worst_slide_mm': Bound(high=1.0, strict=True),
    'quarter_ridges.worst_slide_mm': Bound(high=2.1, strict=True),
}

#: Conditions that are harder for the controller, as factors of :func:`.object_scene`.
HARDER = {
    'lag': {'lag_factor': 2.0},
    'half_ridges': {'ridge_factor': 0.5},
    'quarter_ridges': {'ridge_factor': 0.25},
}

#: Objects of each condition, and with ``--quick``.
OBJECTS, QUICK_OBJECTS = 30, 2


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    return shared_options('grasp', 'Play grasps in simulated time, as slip_grasp does.')


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Play the same objects in each condition."""
    file = shared_folder() / 'config' / 'grasp.yaml'
    chain, grasp = ChainConfig.from_yaml(file), GraspConfig.from_yaml(file)
    seeds = range(QUICK_OBJECTS if words.quick else OBJECTS)
    return {
        part: grasp_figures(
            [play_trial(chain, grasp, seed, **changes) for seed in seeds], grasp.limit_n
        )
        for part, changes in {'controller': {}, **HARDER}.items()
    }
