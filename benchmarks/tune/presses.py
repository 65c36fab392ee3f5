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

"""How long ``slip`` is ON in what is no slip, on a simulated finger whose contact makes noise.

:func:`measure_presses` gives for each configuration the share of the time, in per cent, in which
``slip`` is ON while the finger is pressed, idle, rolled or slides (scene ``press``; ``rolling``
with its disturbances; the plates with presses before and after), and in grasp, hold, slides and
release of ``grasp_and_release``: for the ``paper``'s, ``onset`` and ``sure`` (files of
``config``); for ``without_impacts``, which is onset so; and for ``learnt`` and ``active``, sure
with :data:`LEARNT_V` and with :data:`ACTIVE`.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.tune.families import disturbances, families
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters import ChainConfig, read_yaml, shared_folder
from slip_detector.scenes import Scene, find_scene
from slip_detector.scenes.electronics import CONTACT_N

#: Seeds other than those that the scenes and configurations were chosen on.
SEEDS = range(7800, 7810)

#: What ``slip_tune --quiet`` finds with ``config/sure.yaml`` for a noisy contact that is still.
LEARNT_V = (1.15e-3,)

#: What ``config/sure.yaml`` needs for presses where there is no hum.
ACTIVE: Any = {'common_mode': 'none', 'activity_range_db': 12.0, 'activity_cap_db': 6.0}

#: From when on, and for how long, ``rolling`` rolls; and what the gripper does, by its time.
ROLL_S = (2.0, 4.8)
GRASP_S = {'grasp': (1.0, 1.4), 'hold': (1.6, 2.56), 'release': (7.22, 7.6)}

Rows = NDArray[np.bool_]


def played(description: Mapping[str, Any], seeds: Sequence[int]) -> Iterator[tuple[Any, ...]]:
    """Yield of each seed the volts, the times, the truth, and where the finger is touched."""
    for seed in seeds:
        scene = Scene(description, np.random.default_rng(seed))
        samples = scene.read(scene.length)
        time_s = np.asarray(samples.stamps_ns * 1e-9, np.float64)
        yield samples.volts, time_s, samples.truth, scene.force_n(time_s) > CONTACT_N


def recorded(seeds: Sequence[int]) -> list[tuple[NDArray[np.float64], dict[str, Rows]]]:
    """Return volts, and the rows of each kind, of all scenes."""
    parts, found = disturbances()['presses'], []
    for volts, _, _, touched in played(read_yaml(find_scene('press')), seeds):
        first, *_, last = np.flatnonzero(touched)
        pressed = np.arange(len(touched)) == np.clip(np.arange(len(touched)), first, last)
        found.append((volts, {'press': pressed, 'idle': ~pressed}))
    for volts, time_s, _, _ in played({**read_yaml(find_scene('rolling')), **parts}, seeds):
        found.append((volts, {'roll': (time_s >= ROLL_S[0]) & (time_s < ROLL_S[1])}))
    for plate in families()['presses'][:-1]:
        found += [(volts, {'slide': truth}) for volts, _, truth, _ in played(plate, seeds)]
    for volts, time_s, truth, _ in played(read_yaml(find_scene('grasp_and_release')), seeds):
        kinds = {name: (time_s >= s[0]) & (time_s < s[1]) for name, s in GRASP_S.items()}
        found.append((volts, {**kinds, 'grasped slide': truth}))
    return found


def figures_of(config: ChainConfig, recordings: Sequence[Any]) -> dict[str, float]:
    """Return the figures of one configuration; the keys are in the module's docstring."""
    on: dict[str, list[Rows]] = {}
    for volts, kinds in recordings:
        slip = SlipChain(config).update(volts, envelope=False, level=False).slip
        for name, rows in kinds.items():
            on.setdefault(name, []).append(slip[rows])
    return {name: 100.0 * float(np.mean(np.concatenate(parts))) for name, parts in on.items()}


def measure_presses(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Measure each configuration; the keys are in the module's docstring.

    Parameters
    ----------
    seeds
        Seeds of the scenes; each scene is played with each.
    """
    folder, recordings = shared_folder() / 'config', recorded(seeds)
    configs = {name: ChainConfig.from_yaml(folder / f'{name}.yaml') for name in ('onset', 'sure')}
    configs = {'paper': ChainConfig(), **configs}
    sure = configs['sure']
    configs['without_impacts'] = dataclasses.replace(configs['onset'], impact_v=0.0)
    configs['learnt'] = dataclasses.replace(sure, noise_floor=LEARNT_V)
    configs['active'] = dataclasses.replace(sure, **ACTIVE)
    return {name: figures_of(config, recordings) for name, config in configs.items()}
