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

"""The objects of the grasp: each seed has its own object and its own fingertip."""

import copy
from typing import Any

import numpy as np

from slip_detector.parameters.files import read_yaml
from slip_detector.scenes import find_scene
from slip_detector.scenes.free_object import STANDARD_GRAVITY_M_S2

#: The scene that is varied.
SCENE = 'grasp'

#: Ranges of the values that differ from seed to seed; they are drawn uniformly, in this order.
RANGES: dict[str, tuple[float, float]] = {
    'mass_kg': (0.15, 0.3),
    'growth': (2.0, 3.0),  # last weight over first
    'growing_s': (1.0, 4.0),
    'static_coefficient': (0.5, 0.8),
    'kinetic_share': (0.75, 0.95),  # of the static coefficient
    'spatial_period_m': (300e-6, 800e-6),
    'ridge_height_m': (50e-6, 100e-6),
    'knock_s': (2.0, 7.0),
}


def object_scene(
    seed: int, scene: str = SCENE, *, lag_factor: float = 1.0, ridge_factor: float = 1.0
) -> dict[str, Any]:
    """Return the scene of a file with the object and the fingertip of one seed.

    Parameters
    ----------
    seed
        Seed of the object: the same seed gives the same object.
    scene
        Name or path of a scene with an object that gets heavier.
    lag_factor
        Factor on the time in which the gripper follows its command, above 0.
    ridge_factor
        Factor on the drawn height of the ridges, at least 0.

    Returns
    -------
    dict
        The content of a scene file.

    Raises
    ------
    ValueError
        When the file cannot be read, has no object whose weight grows, or does not describe the
        gripper although ``lag_factor`` is not 1; names it.

    Examples
    --------
    >>> 0.15 < object_scene(7)['object']['mass_kg'] < 0.3
    True
    """
    path = find_scene(scene)
    description = copy.deepcopy(read_yaml(path))
    rng = np.random.default_rng([seed, 1])
    drawn = {name: float(rng.uniform(*limits)) for name, limits in RANGES.items()}
    steps: list[dict[str, Any]] = description.get('steps') or []
    filling = [step for step in steps if isinstance(step, dict) and step.get('pull_n')]
    if not filling or 'object' not in description:
        raise ValueError(
            f'{path}: has no object that gets heavier, allowed: a scene with the part object and '
            'steps with pull_n'
        )
    if lag_factor != 1.0 and 'ringing_hz' not in (description.get('motion') or {}):
        raise ValueError(
            f'{path}: does not say how fast the gripper is, allowed: a scene with ringing_hz in '
            'the part motion'
        )
    mass_kg, static = drawn['mass_kg'], drawn['static_coefficient']
    filling[0]['duration_s'] = drawn['growing_s']
    for step in filling:
        step['pull_n'] = (drawn['growth'] - 1.0) * mass_kg * STANDARD_GRAVITY_M_S2
    parts: dict[str, dict[str, Any]] = {
        'object': {'mass_kg': mass_kg},
        'friction': {
            'static_coefficient': static,
            'kinetic_coefficient': static * drawn['kinetic_share'],
        },
        'texture': {
            'spatial_period_m': drawn['spatial_period_m'],
            'ridge_height_m': drawn['ridge_height_m'] * ridge_factor,
        },
        'electronics': {'fingertip_seed': seed},
        'taps': {'times_s': [drawn['knock_s']]},
    }
    if lag_factor != 1.0:
        parts['motion'] = {'ringing_hz': description['motion']['ringing_hz'] / lag_factor}
    for part, values in parts.items():
        description[part] = {**(description.get(part) or {}), **values}
    return description
