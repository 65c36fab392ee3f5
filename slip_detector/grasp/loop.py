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

"""The closed loop of a grasp without ROS, the conditions of its trials, and their figures.

An object, the chain and the control law run sample by sample, in simulated time. Each seed has its
own object and its own fingertip. Chain and law know nothing of the object but the samples. A
command reaches the gripper ``TRANSPORT_S`` after the sample that caused the command, and then the
grip follows with the lag of the scene's part ``motion``.
"""

import dataclasses
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.samples import Bools, Floats
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.grasp.law import GraspLaw
from slip_detector.parameters import ChainConfig, GraspConfig, read_yaml, refuse
from slip_detector.scenes import Scene, find_scene
from slip_detector.scenes.surface import FINGERS, STANDARD_GRAVITY_M_S2

#: Time from sample to command: somewhat more than the nodes take.
TRANSPORT_S = 5e-3

#: A command that arrives less than this after a sample arrives with the sample.
ROUND_OFF_S = 1e-9

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
    seed: int, *, lag_factor: float = 1.0, ridge_factor: float = 1.0
) -> dict[str, Any]:
    """Return the scene ``grasp`` with the object and the fingertip of one seed.

    ``lag_factor`` multiplies the time in which the gripper follows its command, ``ridge_factor``
    the height of the ridges.
    """
    scene = read_yaml(find_scene('grasp'))
    rng = np.random.default_rng([seed, 1])
    drawn = {name: float(rng.uniform(*limits)) for name, limits in RANGES.items()}
    mass_kg, static = drawn['mass_kg'], drawn['static_coefficient']
    filling = [step for step in scene['steps'] if 'pull_n' in step]
    filling[0]['duration_s'] = drawn['growing_s']
    for step in filling:
        step['pull_n'] = (drawn['growth'] - 1.0) * mass_kg * STANDARD_GRAVITY_M_S2
    scene['object']['mass_kg'] = mass_kg
    kinetic, height_m = static * drawn['kinetic_share'], drawn['ridge_height_m'] * ridge_factor
    scene['friction'] |= {'static_coefficient': static, 'kinetic_coefficient': kinetic}
    scene['texture'] |= {'spatial_period_m': drawn['spatial_period_m'], 'ridge_height_m': height_m}
    scene['electronics']['fingertip_seed'] = seed
    scene['taps']['times_s'] = [drawn['knock_s']]
    scene['motion']['ringing_hz'] /= lag_factor
    return scene


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
    def slide_mm(self) -> float | None:
        """Distance that the object slid; None when it was dropped."""
        return None if self.dropped else float(self.position_m[-1]) * 1e3

    @property
    def onsets_s(self) -> Floats:
        """Times at which slip turned ON while the object had to be held."""
        onsets = self.slip[1:] & ~self.slip[:-1] & (self.needed_n[1:] > 0.0)
        return self.time_s[1:][onsets]

    def mean_n(self, force_n: Floats) -> float:
        """Return the mean of a force over the time in which the object has to be held."""
        return float(force_n[self.needed_n > 0.0].mean())


def play_trial(
    chain_config: ChainConfig, grasp: GraspConfig, seed: int, **factors: float
) -> GraspTrial:
    """Close the loop over the whole scene of a seed; ``factors`` as in :func:`object_scene`.

    Raises
    ------
    ValueError
        When the scene has another sample rate than the chain.

    Examples
    --------
    >>> play_trial(ChainConfig(), GraspConfig(grip_n=10.0, limit_n=10.0), seed=0).dropped
    False
    """
    chain, law = SlipChain(chain_config), GraspLaw(grasp)
    scene = Scene(object_scene(seed, **factors), np.random.default_rng(seed))
    if scene.sample_rate_hz != chain_config.sample_rate_hz:
        allowed = f'{chain_config.sample_rate_hz:g} Hz, the parameter sample_rate_hz'
        refuse(f'the scene has {scene.sample_rate_hz:g} Hz', allowed)
    under_way: deque[tuple[float, float]] = deque()
    rows: list[tuple[float, ...]] = []
    now_s, commanded_n = 0.0, -1.0
    while True:
        next_s = now_s + 1.0 / scene.sample_rate_hz if rows else 0.0
        while under_way and under_way[0][0] <= next_s + ROUND_OFF_S:
            scene.hold_force(under_way.popleft()[1])
        samples: Any = scene.read(1)  # A scene's samples have truth and positions.
        if not len(samples.volts):
            break
        result = chain.update(samples.volts, envelope=False, level=False)
        # Without the rounding of the stamps to nanoseconds.
        time_s = np.rint(samples.stamps_ns * 1e-9 * scene.sample_rate_hz) / scene.sample_rate_hz
        before_s, now_s, slip = now_s, float(time_s[0]), bool(result.slip[0])
        command_n = law.update(now_s - before_s, slip, bool(result.can_vote.any()))
        if command_n != commanded_n:
            commanded_n = command_n
            under_way.append((now_s + TRANSPORT_S, command_n))
        force_n, position_m = scene.force_n(time_s)[0], samples.position_m[0]
        rows.append((now_s, command_n, force_n, slip, samples.truth[0], position_m))
    times, commands, forces, slips, slidings, positions = np.array(rows).T
    load_n = np.interp(times, *scene.drive_numbers.load)
    needed_n = load_n / (FINGERS * scene.parts['friction'].static_coefficient)
    return GraspTrial(
        times, commands, forces, slips > 0.0, slidings > 0.0, positions, needed_n,
        scene.parts['object'].length_m,
    )  # fmt: skip


#: The conditions, by the names that reports have.
UNCONTROLLED, AT_LIMIT = 'no controller', 'always at the limit'
CONTROLLER, PAPER = 'controller', "controller, paper's detector"

#: Longest time, in seconds, from an onset to a raise of the grip that counts as the answer to it.
ANSWER_S = 0.05


def conditions(
    chain: ChainConfig, grasp: GraspConfig
) -> dict[str, tuple[ChainConfig, GraspConfig]]:
    """Return the parameters of detector and controller under each condition."""
    paper = ChainConfig(sample_rate_hz=chain.sample_rate_hz)
    return {
        UNCONTROLLED: (chain, dataclasses.replace(grasp, limit_n=grasp.grip_n)),
        AT_LIMIT: (chain, dataclasses.replace(grasp, grip_n=grasp.limit_n)),
        CONTROLLER: (chain, grasp),
        PAPER: (paper, grasp),
    }


def grasp_figures(trials: Sequence[GraspTrial], limit_n: float) -> dict[str, Any]:
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
        The number of ``trials`` and of ``dropped`` objects; ``slide_mm`` of each trial,
        ``mean_slide_mm`` and ``worst_slide_mm``, None where an object was dropped. While the
        object has to be held: ``force_percent``, the mean grip as a share of the limit, and
        ``most_force_percent``, that of the trial with the largest; ``needed_percent``, the mean of
        the smallest grip that would hold the object; ``onsets``, the mean number of onsets.
    """
    slides_mm = [trial.slide_mm for trial in trials]
    known = [slide_mm for slide_mm in slides_mm if slide_mm is not None]
    dropped = len(trials) - len(known)
    shares = [100.0 * trial.mean_n(trial.force_n) / limit_n for trial in trials]
    needed = [100.0 * trial.mean_n(trial.needed_n) / limit_n for trial in trials]
    return {
        'trials': len(trials),
        'dropped': dropped,
        'slide_mm': slides_mm,
        'mean_slide_mm': None if dropped else float(np.mean(known)),
        'worst_slide_mm': None if dropped else max(known),
        'force_percent': float(np.mean(shares)),
        'most_force_percent': max(shares),
        'needed_percent': float(np.mean(needed)),
        'onsets': float(np.mean([len(trial.onsets_s) for trial in trials])),
    }


class LiveGraspTrial(NamedTuple):
    """The messages of one grasp; times are stamps, relative to the first sample.

    ``position`` has times and the metres that the object has slid, shape (n, 2); ``command`` times
    and commanded grip forces in newtons, shape (m, 2); ``onset_s`` the times of the samples at
    which slip came ON.
    """

    position: Floats
    command: Floats
    onset_s: Floats

    def command_n(self, time_s: Floats) -> Floats:
        """Return the latest commanded grip force at each time."""
        last = np.searchsorted(self.command[:, 0], time_s, side='right') - 1
        return np.asarray(self.command[np.maximum(last, 0), 1])

    def latencies_s(self) -> list[float]:
        """Return the time from the sample of each onset to the command that answers it.

        An onset while the last raise still takes effect has no answer.
        """
        raised_s = self.command[1:, 0][np.diff(self.command[:, 1]) > 0.0]
        answers = [raised_s[raised_s > onset_s][:1] - onset_s for onset_s in self.onset_s]
        return [float(answer[0]) for answer in answers if answer.size and answer[0] < ANSWER_S]


def live_figures(
    heard: Mapping[int, LiveGraspTrial], trials: Sequence[GraspTrial], limit_n: float
) -> dict[str, Any]:
    """Return the figures ``nodes`` and ``latency_ms``.

    ``trials`` are the same seeds in simulated time.
    """

    def figures(trial: GraspTrial) -> dict[str, Any]:
        command_percent = 100.0 * trial.mean_n(trial.command_n) / limit_n
        return {'slide_mm': trial.slide_mm, 'command_percent': command_percent}

    nodes = {}
    for (seed, live), trial in zip(heard.items(), trials, strict=True):
        command_n = live.command_n(trial.time_s)
        played = trial._replace(position_m=live.position[:, 1], command_n=command_n)
        nodes[str(seed)] = {**figures(played), 'simulated': figures(trial)}
    all_ms = [1e3 * latency_s for live in heard.values() for latency_s in live.latencies_s()]
    latency_ms = {'median': float(np.median(all_ms)), 'most': max(all_ms)} if all_ms else None
    return {'nodes': nodes, 'latency_ms': latency_ms}
