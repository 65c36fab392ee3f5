"""The objects of the grasp: each seed has its own object and its own fingertip."""

import copy
from typing import Any

import numpy as np

from slip_detector.parameters.reading import read_yaml
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


def object_scene(seed: int, scene: str = SCENE) -> dict[str, Any]:
    """Return the scene of a file with the object and the fingertip of one seed.

    Parameters
    ----------
    seed
        Seed of the object: the same seed gives the same object.
    scene
        Name or path of a scene with an object that gets heavier.

    Returns
    -------
    dict
        The content of a scene file.

    Raises
    ------
    ValueError
        When the file cannot be read or has no object whose weight grows; names it.

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
        'texture': {name: drawn[name] for name in ('spatial_period_m', 'ridge_height_m')},
        'electronics': {'fingertip_seed': seed},
        'taps': {'times_s': [drawn['knock_s']]},
    }
    for part, values in parts.items():
        description[part] = {**(description.get(part) or {}), **values}
    return description
