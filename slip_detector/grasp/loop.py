"""The grasp's closed loop without ROS: an object, the chain and the control law, sample by sample.

Each seed is another object: its weight, its friction, its texture, how fast it is filled and when
something knocks on it are drawn from :data:`RANGES`, and so is the fingertip. Nothing of that is
known to the chain or the law.

Time is simulated. A command reaches the gripper ``transport_s`` after the sample that it is the
answer to, and from then on the grip follows with the lag of the scene's part ``motion``.
"""

import copy
import dataclasses
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.grasp.law import GraspLaw
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.parameters.sets import read_yaml
from slip_detector.scenes import Scene, find_scene
from slip_detector.scenes.free_object import STANDARD_GRAVITY_M_S2

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: The scene that is varied.
SCENE = 'grasp'

#: From sample to command, unless told otherwise: what the nodes take, and some more.
TRANSPORT_S = 5e-3

#: What is compared: no controller, a grip that is always at the limit, the controller, and the
#: controller with a detector that has the paper's parameters.
UNCONTROLLED, AT_LIMIT, CONTROLLER, PAPER = (
    'no controller',
    'always at the limit',
    'controller',
    "controller, paper's detector",
)

#: The fingertips that hold the object.
FINGERS = 2.0

#: What differs from seed to seed, lowest and highest; uniformly drawn, in this order.
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


class Trial(NamedTuple):
    """What happened in one trial, sample by sample.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        When each sample was taken.
    command_n, force_n : ndarray, shape (n,)
        Grip that was commanded on it, and the normal force that there was.
    slip : ndarray of bool, shape (n,)
        What the chain said.
    sliding : ndarray of bool, shape (n,)
        The truth.
    position_m : ndarray, shape (n,)
        How far the object has moved through the fingers.
    needed_n : ndarray, shape (n,)
        Normal force that would just have held it, at rest.
    length_m : float
        How far it can slide before it is lost.
    """

    time_s: Floats
    command_n: Floats
    force_n: Floats
    slip: Bools
    sliding: Bools
    position_m: Floats
    needed_n: Floats
    length_m: float

    @property
    def dropped(self) -> bool:
        """Whether the object was lost."""
        return bool(self.position_m[-1] >= self.length_m)

    @property
    def slide_m(self) -> float | None:
        """How far it slid; None when it was dropped."""
        return None if self.dropped else float(self.position_m[-1])

    @property
    def onsets_s(self) -> Floats:
        """Times at which slip came on."""
        return self.time_s[1:][self.slip[1:] & ~self.slip[:-1]]

    def mean_n(self, force_n: Floats) -> float:
        """Return the mean of a force over the time in which the object has to be held."""
        return float(force_n[self.needed_n > 0.0].mean())


def object_scene(seed: int, scene: str = SCENE) -> dict[str, Any]:
    """Return the scene of one seed: that of the file, with another object and fingertip.

    Raises
    ------
    ValueError
        When the file cannot be read or has no object whose weight grows; names it.
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


def play(
    description: Mapping[str, Any],
    seed: int,
    chain: SlipChain,
    law: GraspLaw,
    transport_s: float = TRANSPORT_S,
) -> Trial:
    """Close the loop over a scene with an object, from its beginning to its end.

    Parameters
    ----------
    description
        Of the scene.
    seed
        Of its noise.
    chain, law
        Not used before.
    transport_s
        From sample to command.

    Raises
    ------
    ValueError
        When the scene has no object, or another sample rate than the chain.
    """
    scene = Scene(description, np.random.default_rng(seed))
    body, friction = scene.parts.get('object'), scene.parts.get('friction')
    if body is None or friction is None:
        raise ValueError('the scene holds nothing, allowed: one with the part object')
    if scene.sample_rate_hz != chain.config.sample_rate_hz:
        raise ValueError(
            f'the scene has {scene.sample_rate_hz:g} Hz, allowed: '
            f'{chain.config.sample_rate_hz:g} Hz, the parameter sample_rate_hz'
        )
    under_way: deque[tuple[float, float]] = deque()
    rows: list[tuple[float, ...]] = []
    commanded_n = -1.0
    next_s = 0.0
    while True:
        while under_way and under_way[0][0] <= next_s:
            scene.hold_force(under_way.popleft()[1])
        volts, sliding, position_m, time_s = scene.read(1)
        if not len(volts):
            break
        assert sliding is not None
        assert position_m is not None
        assert time_s is not None
        now_s = float(time_s[0])
        result = chain.update(volts, envelope=False, level=False)
        slip = bool(result.slip[0])
        command_n = law.update(now_s, slip, bool(result.can_vote[0].any()))
        if command_n != commanded_n:
            commanded_n = command_n
            under_way.append((now_s + transport_s, command_n))
        force_n = float(scene.force_n(time_s)[0])
        rows.append((now_s, command_n, force_n, slip, bool(sliding[0]), float(position_m[0])))
        next_s = now_s + 1.0 / scene.sample_rate_hz
    times, commands, forces, slips, slidings, positions = np.array(rows).T
    load_n = np.interp(times, *scene.drive_numbers.load)
    needed_n = load_n / (FINGERS * friction.static_coefficient)
    return Trial(
        times, commands, forces, slips > 0.0, slidings > 0.0, positions, needed_n, body.length_m
    )


def play_seeds(
    chain: ChainConfig,
    grasp: GraspConfig,
    seeds: Iterable[int],
    scene: str = SCENE,
    transport_s: float = TRANSPORT_S,
) -> list[Trial]:
    """Play the trials of some seeds, each with an object of its own.

    Raises
    ------
    ValueError
        As :func:`object_scene` and :func:`play`.
    """
    return [
        play(object_scene(seed, scene), seed, SlipChain(chain), GraspLaw(grasp), transport_s)
        for seed in seeds
    ]


def conditions(
    chain: ChainConfig, grasp: GraspConfig
) -> dict[str, tuple[ChainConfig, GraspConfig]]:
    """Return what is compared, by its name: the detector's and the controller's parameters."""
    paper = ChainConfig(sample_rate_hz=chain.sample_rate_hz)
    return {
        UNCONTROLLED: (chain, dataclasses.replace(grasp, limit_n=grasp.grip_n)),
        AT_LIMIT: (chain, dataclasses.replace(grasp, grip_n=grasp.limit_n)),
        CONTROLLER: (chain, grasp),
        PAPER: (paper, grasp),
    }


def figures(trials: Sequence[Trial], limit_n: float) -> dict[str, Any]:
    """Return the figures of merit of some trials.

    Parameters
    ----------
    trials
        At least one.
    limit_n
        Grip that the forces are compared with.

    Returns
    -------
    dict
        ``trials``, ``dropped``; ``slide_mm`` of each, and their ``mean_slide_mm`` and
        ``worst_slide_mm``, None where an object was dropped; ``force_percent``, the mean grip
        while the object has to be held as a share of the limit, and ``most_force_percent``, that
        of the trial with the most; ``needed_percent``, the same of a grip that knows weight and
        friction and is always just enough; ``onsets``, the mean number of onsets from when the
        object has to be held.
    """
    slides_m = [trial.slide_m for trial in trials]
    slides_mm = [None if slide_m is None else slide_m * 1e3 for slide_m in slides_m]
    known = [slide_mm for slide_mm in slides_mm if slide_mm is not None]
    all_known = len(known) == len(trials)
    shares = [100.0 * trial.mean_n(trial.force_n) / limit_n for trial in trials]
    needed = [100.0 * trial.mean_n(trial.needed_n) / limit_n for trial in trials]
    lifted_s = [trial.time_s[np.argmax(trial.needed_n > 0.0)] for trial in trials]
    return {
        'trials': len(trials),
        'dropped': sum(trial.dropped for trial in trials),
        'slide_mm': slides_mm,
        'mean_slide_mm': float(np.mean(known)) if all_known else None,
        'worst_slide_mm': max(known) if all_known else None,
        'force_percent': float(np.mean(shares)),
        'most_force_percent': max(shares),
        'needed_percent': float(np.mean(needed)),
        'onsets': float(
            np.mean(
                [
                    np.count_nonzero(trial.onsets_s >= begin_s)
                    for trial, begin_s in zip(trials, lifted_s, strict=True)
                ]
            )
        ),
    }
