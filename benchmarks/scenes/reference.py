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

"""Scenes solved by SciPy's integrators, with which the live stepper is compared."""

import itertools
import math
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy import integrate

from benchmarks.scenes import equations
from slip_detector.chain.samples import Floats
from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N

#: Contact is looked for at this many points within the shortest feature of the force, and at no
#: more than this many points of the whole scene.
LIFT_POINTS, MOST_LIFT_POINTS = 40, 200_000

#: Halvings of the time between two points, after which touch-down and lift-off are known exactly.
HALVINGS = 60

#: Corners closer together than this count as one.
SAME_S = 1e-12


def build_scene(description: Mapping[str, Any], **more: Any) -> Scene:
    """Build a scene, always with the same seed; ``more`` replaces parts or settings."""
    return Scene({**description, **more}, np.random.default_rng(0))


class Solution(NamedTuple):
    """The solution of a scene: n samples, up to where an object is lost."""

    clean_v: Floats
    position_m: Floats
    run_time_s: float = 0.0

    def error(self, of: 'Solution') -> float:
        """Return the largest difference of the volts, as a share of the range of these volts."""
        n = min(len(self.clean_v), len(of.clean_v))
        difference_v = np.abs(of.clean_v[:n] - self.clean_v[:n]).max()
        return float(difference_v / np.ptp(self.clean_v))

    def error_m(self, of: 'Solution') -> float:
        """Return the largest difference of the positions."""
        n = min(len(self.position_m), len(of.position_m))
        return float(np.abs(of.position_m[:n] - self.position_m[:n]).max())


def solve_live(scene: Scene, n: int) -> Solution:
    """Run the live stepper for up to ``n`` samples."""
    start_s = time.thread_time()
    _, clean_v, position_m, _ = scene.clean(n)
    return Solution(clean_v, position_m, time.thread_time() - start_s)


class Ode:
    """A scene as dy/dt = f(t, y); see :func:`benchmarks.scenes.equations.rates` for the states.

    ``size`` is the number of states: 0 when the volts are a closed form of the time.

    Raises
    ------
    ValueError
        For skin without damping.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self._constants, self._drive = scene, scene.constants, scene.drive_numbers
        constants, skin, law = scene.constants, scene.constants.skin, scene.constants.friction
        n_channels, with_friction = len(constants.positions_m), bool(constants.patches.size)
        if with_friction and skin.damping_n_s_m == 0.0:
            raise ValueError('no state says how fast skin without damping moves')
        self.with_object = constants.patches.size > n_channels
        self._cutoff_rad_s = 2.0 * np.pi * scene.parts['electronics'].bandwidth_hz
        self._loads = np.zeros(max(constants.patches.size, n_channels))
        self._own = 2 if with_friction else 0
        times_s = np.linspace(0.0, scene.duration_s, 2001)
        load_n = scene.parts['contact'].largest_load_n(float(scene.force_n(times_s).max()))
        load_n = max(load_n, LIGHTEST_LOAD_N)
        shear_n = law.static_coefficient * load_n if with_friction else 0.0
        volts = float(np.abs(constants.normal_v_n).max()) * load_n
        volts += float(np.abs(constants.shear_v_n).max()) * shear_n
        x_m, z_m = shear_n / skin.shear_stiffness_n_m, shear_n / law.bristle_stiffness_n_m
        # How large each state may become; the tolerances are relative to it.
        own = [x_m, z_m][: self._own]
        filtered = [max(volts, 1e-6)] if self._cutoff_rad_s else []
        scales = (own + filtered) * n_channels + ([*own, 1e-3, 1e-2] if self.with_object else [])
        self._scales, self.size = np.array(scales), len(scales)
        self._stride = self._own + len(filtered)
        self._smooth_at = np.arange(n_channels) * self._stride + self._own if filtered else None

    def _rates(self, t: float, y: Floats, end_s: float, until_s: float) -> Floats:
        if time.thread_time() > until_s:
            raise RuntimeError('given up')
        out = np.empty(self.size)
        # A piece of the drive ends just before its corner.
        inside = min(t, float(np.nextafter(end_s, -np.inf)))
        equations.rates(
            inside, y, self._drive, self._constants, self._cutoff_rad_s, self._loads, out
        )
        return out

    def solve(self, method: str, rtol: float, budget_s: float = math.inf) -> Solution:
        """Integrate the scene by a method of SciPy, which starts again at each corner.

        The absolute tolerance of each state is ``rtol`` times its scale.

        Raises
        ------
        RuntimeError
            When the method fails, or needs more processor time than ``budget_s``.
        """
        begin_s = time.thread_time()
        time_s = np.arange(self.scene.length) / self.scene.sample_rate_hz
        y = np.zeros(self.size)
        if self._smooth_at is not None:
            y[self._smooth_at] = self._volts(time_s[:1], y[np.newaxis])[0]
        options: dict[str, Any] = {}
        if method == 'LSODA' and not self.with_object:
            upper = max(self._own - 1, 0)
            options = {'lband': max(self._stride - 1, 0), 'uband': upper}
        states = [y[np.newaxis]]
        pieces = [0.0, *self._corners_s(time_s[-1]), time_s[-1]]
        for begin, end in itertools.pairwise(pieces):
            due = time_s[(time_s > begin) & (time_s <= end)]
            solution: Any = integrate.solve_ivp(
                self._rates, (begin, end), y, method, np.union1d(due, [end]), events=self._lost,
                args=(end, begin_s + budget_s), rtol=rtol, atol=rtol * self._scales, **options,
            )  # fmt: skip
            if solution.status < 0 or not np.isfinite(solution.y).all():
                raise RuntimeError(f'{method} failed: {solution.message}')
            states.append(solution.y.T[: len(due)])
            if solution.status == 1:
                break
            y = solution.y[:, -1]
        found = np.concatenate(states)
        clean_v, position_m = self._volts(time_s[: len(found)], found)
        if self._smooth_at is not None:
            clean_v = found[:, self._smooth_at]
        return Solution(clean_v, position_m, time.thread_time() - begin_s)

    def _lost(self, _t: float, y: Floats, *_: float) -> float:
        """Return below 0 while the object is held; the solution ends where it is lost."""
        return float(y[-2]) - self._constants.body.length_m if self.with_object else -1.0

    _lost.terminal = True  # type: ignore[attr-defined]

    def _volts(self, time_s: Floats, states: Floats) -> tuple[Floats, Floats]:
        """Return the volts before the low-pass, and the positions of the surface."""
        clean_v = np.empty((len(time_s), len(self._constants.positions_m)))
        positions_m = [
            equations.volts_at(
                t, y, self._own, self._stride, self._drive, self._constants, self._loads, row
            )
            for t, y, row in zip(time_s, states, clean_v, strict=True)
        ]
        return clean_v, np.array(positions_m)

    def _corners_s(self, until_s: float) -> list[float]:
        """Return the times between which the drive is smooth."""
        drive = self._drive
        corners = [drive.force.starts_s, drive.plate[0], drive.load[0], drive.taps.times_s]
        corners += [drive.taps.times_s + drive.taps.duration_s, _lifts_s(self.scene)]
        if drive.rolling.repeats:
            one_way = drive.rolling.duration_s + drive.rolling.hold_s
            begins_s = drive.rolling.start_s + one_way * np.arange(2 * drive.rolling.repeats)
            corners += [begins_s, begins_s + drive.rolling.duration_s]
        times_s = np.unique(np.concatenate(corners))
        # No method can step between corners that differ only by round-off.
        times_s = times_s[np.diff(times_s, prepend=-1.0) > SAME_S]
        kept: list[float] = times_s[(times_s > SAME_S) & (times_s < until_s - SAME_S)].tolist()
        return kept


def _lifts_s(scene: Scene) -> Floats:
    """Return when the fingertip touches down and lifts off: a long step could miss a contact."""
    fastest_s = 1.0 / scene.parts['motion'].ringing_hz
    if 'taps' in scene.parts:
        fastest_s = min(fastest_s, scene.parts['taps'].duration_s)
    n = min(math.ceil(LIFT_POINTS * scene.duration_s / fastest_s), MOST_LIFT_POINTS)
    times_s = np.linspace(0.0, scene.duration_s, n + 1)
    touches = scene.force_n(times_s) > 0.0
    changes = np.flatnonzero(touches[1:] != touches[:-1])
    low, high = times_s[changes], times_s[changes + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (scene.force_n(middle) > 0.0) == touches[changes]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high
