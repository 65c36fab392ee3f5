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

"""The run time of a scene, of each of its parts, and of its slowest read."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.sizes import SceneSizes
from benchmarks.timing import garbage_collection_off
from slip_detector.parameters.files import read_yaml
from slip_detector.scenes.parts import PARTS

Floats = NDArray[np.float64]

#: Number of rows that a live driver reads at once, at most.
PACE_ROWS = 32

#: Number of rows in the pieces in which the run time of the parts is measured.
PIECE_ROWS = 95

#: Parts that every scene has: left out of the description, they have their defaults.
ALWAYS = ('motion', 'contact', 'skin', 'electronics')


def scene_costs(path: Path, sizes: SceneSizes) -> dict[str, Any]:
    """Measure the run time of a scene, and of the scene without each of its parts."""
    description = read_yaml(path)
    scene = build_scene(description)
    parts = [name for name in description if name in PARTS]
    without: dict[str, dict[str, Any]] = {}
    sides: dict[str, dict[str, Any]] = {'': description}
    for part in (name for name in parts if name not in ALWAYS):
        left = {name: content for name, content in description.items() if name != part}
        without[part] = {'share': None, 'said': ''}
        try:
            build_scene(left)
        except ValueError as error:
            without[part]['said'] = str(error)
        else:
            sides[part] = left

    # The sides take turns piece by piece, and the shortest time of each piece counts, because the
    # load of the machine changes from moment to moment.
    pieces = range(0, scene.length, PIECE_ROWS)
    least_s = np.full((len(sides), len(pieces)), math.inf)
    for _ in range(sizes.cost_rounds):
        ready = [build_scene(content) for content in sides.values()]
        with garbage_collection_off():
            for piece in range(len(pieces)):
                for i, side in enumerate(ready):
                    start_s = time.thread_time()
                    side.read(PIECE_ROWS)
                    taken_s = time.thread_time() - start_s
                    least_s[i, piece] = min(least_s[i, piece], taken_s)
    times_s = least_s.sum(axis=1).tolist()
    for part, time_s in zip(sides, times_s, strict=True):
        if part:
            without[part]['share'] = time_s / times_s[0]
    return {
        'scene': path.stem,
        'parts': parts,
        'run_time_per_s': times_s[0] / scene.duration_s,
        'speed': scene.duration_s / times_s[0],
        'without': without,
    }


def read_pace(path: Path, sizes: SceneSizes) -> dict[str, Any]:
    """Measure how long reads of a few rows take, as a share of the time that the rows span."""
    least: Floats | None = None
    for _ in range(sizes.rounds):
        scene = build_scene(read_yaml(path))
        taken = []
        with garbage_collection_off():
            while True:
                start_s = time.perf_counter()
                n = len(scene.read(PACE_ROWS).volts)
                if n < PACE_ROWS:
                    break
                taken.append(time.perf_counter() - start_s)
        # A disturbance by other programs is in one round only, so the minimum is free of it.
        least = np.array(taken) if least is None else np.minimum(least, taken)
    lasts_s = PACE_ROWS / scene.sample_rate_hz
    assert least is not None
    return {
        'rows': PACE_ROWS,
        'slowest_share': float(least.max()) / lasts_s,
        'mean_share': float(least.mean()) / lasts_s,
    }
