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

"""The grasp's closed loop without ROS: an object, the chain and the control law, sample by sample.

The chain and the law receive no data about the object but the samples.

Time is simulated. A command reaches the gripper ``transport_s`` after the sample that it responds
to, and then the grip follows with the lag of the scene's part ``motion``.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.grasp.law import GraspLaw
from slip_detector.grasp.objects import SCENE, object_scene
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.scenes import Scene
from slip_detector.scenes.free_object import FINGERS

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Default time from sample to command: somewhat more than the nodes take.
TRANSPORT_S = 5e-3

#: A command that arrives less than this after a sample arrives with it, but for round-off.
ROUND_OFF_S = 1e-9


class GraspTrial(NamedTuple):
    """The course of one trial, sample by sample.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        When each sample was taken.
    command_n, force_n : ndarray, shape (n,)
        Grip that was commanded after the sample, and the normal force at its time.
    slip : ndarray of bool, shape (n,)
        The decision of the chain.
    sliding : ndarray of bool, shape (n,)
        Whether the object slides.
    position_m : ndarray, shape (n,)
        Distance that the object has moved through the fingers.
    needed_n : ndarray, shape (n,)
        The smallest normal force that would hold the object at rest.
    length_m : float
        Distance that the object can slide before it is lost.

    Examples
    --------
    >>> time_s, none = np.arange(3) / 380.0, np.zeros(3)
    >>> slip, slid_m = np.array([False, True, True]), np.array([0.0, 1e-4, 2e-4])
    >>> trial = GraspTrial(time_s, none + 5.0, none + 5.0, slip, slip, slid_m, none + 4.0, 0.1)
    >>> trial.dropped, trial.slide_m, len(trial.onsets_s), trial.mean_n(trial.force_n)
    (False, 0.0002, 1, 5.0)
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
        """Distance that the object slid; None when it was dropped."""
        return None if self.dropped else float(self.position_m[-1])

    @property
    def onsets_s(self) -> Floats:
        """Times at which slip turned ON."""
        return self.time_s[1:][self.slip[1:] & ~self.slip[:-1]]

    def mean_n(self, force_n: Floats) -> float:
        """Return the mean of a force over the time in which the object has to be held."""
        return float(force_n[self.needed_n > 0.0].mean())


def play_trial(
    description: Mapping[str, Any],
    seed: int,
    chain: SlipChain,
    law: GraspLaw,
    transport_s: float = TRANSPORT_S,
) -> GraspTrial:
    """Close the loop over a scene with an object, from its beginning to its end.

    Parameters
    ----------
    description
        The content of a scene file.
    seed
        Seed of the noise.
    chain, law
        A new chain and a new law: they are not reset here.
    transport_s
        Time from a sample to the arrival of the command that responds to it.

    Raises
    ------
    ValueError
        When the scene has no object, or another sample rate than the chain.

    Examples
    --------
    >>> chain, law = SlipChain(ChainConfig()), GraspLaw(GraspConfig())
    >>> trial = play_trial(object_scene(0), 0, chain, law)
    >>> bool(trial.command_n.max() <= GraspConfig().limit_n)
    True
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
    next_s, period_s = 0.0, 1.0 / scene.sample_rate_hz
    while True:
        while under_way and under_way[0][0] <= next_s:
            scene.hold_force(under_way.popleft()[1])
        # All samples before the next command arrives are read at once.
        arrives_s = under_way[0][0] if under_way else next_s + transport_s
        many = 1
        while next_s + many * period_s < arrives_s - ROUND_OFF_S:
            many += 1
        samples = scene.read(many)
        if not len(samples.volts):
            break
        result = chain.update(samples.volts, envelope=False, level=False)
        forces_n = scene.force_n(samples.time_s).tolist()
        can_vote = [bool(row.any()) for row in result.can_vote]
        for now_s, slip, valid, force_n, sliding, position_m in zip(
            samples.time_s.tolist(), result.slip.tolist(), can_vote, forces_n,
            samples.truth.tolist(), samples.position_m.tolist(), strict=True,
        ):  # fmt: skip
            command_n = law.update(now_s, slip, valid)
            if command_n != commanded_n:
                commanded_n = command_n
                under_way.append((now_s + transport_s, command_n))
            rows.append((now_s, command_n, force_n, slip, sliding, position_m))
            next_s = now_s + period_s
    times, commands, forces, slips, slidings, positions = np.array(rows).T
    load_n = np.interp(times, *scene.drive_numbers.load)
    needed_n = load_n / (FINGERS * friction.static_coefficient)
    return GraspTrial(
        times, commands, forces, slips > 0.0, slidings > 0.0, positions, needed_n, body.length_m
    )


def play_trials(
    chain: ChainConfig,
    grasp: GraspConfig,
    seeds: Iterable[int],
    scene: str = SCENE,
    transport_s: float = TRANSPORT_S,
    **harder: float,
) -> list[GraspTrial]:
    """Play a trial for each seed, with another object each time.

    Parameters
    ----------
    chain, grasp
        The parameters of the detector and of the controller.
    seeds
        Seeds of the objects and of the noise.
    scene, transport_s
        As :func:`object_scene` and :func:`play_trial` take them.
    **harder
        The factors that :func:`object_scene` takes.

    Raises
    ------
    ValueError
        As :func:`object_scene` and :func:`play_trial`.

    Examples
    --------
    >>> held = GraspConfig(grip_n=10.0, limit_n=10.0)
    >>> [trial.dropped for trial in play_trials(ChainConfig(), held, seeds=[0])]
    [False]
    """
    return [
        play_trial(
            object_scene(seed, scene, **harder), seed, SlipChain(chain), GraspLaw(grasp),
            transport_s,
        )
        for seed in seeds
    ]  # fmt: skip
