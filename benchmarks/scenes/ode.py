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

"""A scene as dy/dt = f(t, y), for SciPy's integrators; used by the benchmarks only."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import equations
from slip_detector.scenes import Scene
from slip_detector.scenes.drive import drive_at
from slip_detector.scenes.friction import COULOMB, LIGHTEST_LOAD_N
from slip_detector.scenes.mechanics import SceneConstants
from slip_detector.scenes.motion import LoadNumbers, PlateNumbers

Floats = NDArray[np.float64]

#: Contact is looked for at this many points within the shortest feature of the force, and at no
#: more than this many points of the whole scene.
LIFT_POINTS, MOST_LIFT_POINTS = 40, 200_000

#: Corners closer together than this count as one.
SAME_S = 1e-12


def _lifts_s(scene: Scene) -> list[float]:
    """Return when the fingertip touches down and lifts off.

    They become corners, because a method with long steps could miss a short contact.
    """
    fastest_s = 1.0 / scene.motion.ringing_hz
    if 'taps' in scene.parts:
        fastest_s = min(fastest_s, scene.parts['taps'].duration_s)
    n = min(math.ceil(LIFT_POINTS * scene.duration_s / fastest_s), MOST_LIFT_POINTS)
    times_s = np.linspace(0.0, scene.duration_s, n + 1)
    touches = scene.force_n(times_s) > 0.0
    found = []
    for i in np.flatnonzero(touches[1:] != touches[:-1]):
        low, high = times_s[i], times_s[i + 1]
        while high - low > 0.0:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            if (scene.force_n(np.array([middle]))[0] > 0.0) == touches[i]:
                low = middle
            else:
                high = middle
        found.append(float(high))
    return found


@dataclasses.dataclass
class Ode:
    """A scene as dy/dt = f(t, y).

    The states of each patch are the displacement of the skin, its velocity (where it has mass),
    the deflection of the bristles and the state of the low-pass (where there is one). Position and
    velocity of an object, where there is one, follow those of all patches.

    Parameters
    ----------
    scene
        The scene; how much of it has been read does not matter.

    Attributes
    ----------
    size : int
        Number of states; 0 when the volts are a closed form of the time.
    scales : ndarray, shape (size,)
        How large each state may become; the tolerances and differences are relative to it.
    own_at : ndarray of int, shape (16,)
        Where the states of each patch begin.
    side_s : float
        A time within the smooth piece of the drive that is being solved; the caller sets it.

    Raises
    ------
    ValueError
        For Coulomb's friction, whose force at rest is no function of the state, and for skin that
        has neither mass nor damping.
    """

    scene: Scene

    def __post_init__(self) -> None:
        """Collect the numbers."""
        scene = self.scene
        self.constants: SceneConstants = scene.constants
        constants = self.constants
        if constants.patches.size and constants.friction.model == COULOMB:
            raise ValueError(
                'friction: model is coulomb, whose force at rest is no function of the state; '
                'allowed: lugre for LSODA, BDF, Radau, RK45 and DOP853, or the live stepper'
            )
        skin = constants.skin
        damping = skin.damping_n_s_m + constants.friction.viscous_n_s_m
        if constants.patches.size and skin.mass_kg == 0.0 and damping == 0.0:
            raise ValueError(
                'skin: mass_kg and damping_n_s_m are 0, so that no state says how fast it moves; '
                'allowed: one of them above 0 for LSODA, BDF, Radau, RK45 and DOP853, or the live '
                'stepper'
            )
        self.drive = scene.drive_numbers
        self.with_object = constants.body.mass_kg > 0.0
        self.with_mass = constants.skin.mass_kg > 0.0
        self.cutoff_rad_s = 2.0 * np.pi * scene.electronics.bandwidth_hz
        self._loads = np.zeros(max(constants.patches.size, constants.positions_m.shape[0]))
        n_channels = constants.positions_m.shape[0]
        self._own = (2 + self.with_mass) if constants.patches.size else 0
        times = np.linspace(0.0, scene.duration_s, 2001)
        load_n = scene.contact.largest_load_n(float(scene.force_n(times).max()))
        load_n = max(load_n, LIGHTEST_LOAD_N)
        law = constants.friction
        shear_n = law.static * load_n if constants.patches.size else 0.0
        x_m, z_m = shear_n / max(skin.stiffness_n_m, 1e-9), shear_n / law.bristle_n_m
        self.speed_m_s = max(scene.largest_velocity_m_s, 1e-3)
        volts = float(np.abs(constants.normal_v_n).max()) * load_n
        volts += float(np.abs(constants.shear_v_n).max()) * shear_n
        own = [x_m, self.speed_m_s, z_m] if self.with_mass else [x_m, z_m]
        own = own if constants.patches.size else []
        filtered = [max(volts, 1e-6)] if self.cutoff_rad_s else []
        scales = (own + filtered) * n_channels
        self.own_at = np.arange(n_channels) * (self._own + len(filtered))
        if self.with_object:
            scales += [*own, 1e-3, 1e-2]
        self.scales = np.array(scales)
        self.size = len(scales)
        self._lifts_s = _lifts_s(scene)
        self.side_s = 0.0
        self._smooth_at = self.own_at + self._own if self.cutoff_rad_s else None

    def rates(self, t: float, y: Floats) -> Floats:
        """Return dy/dt."""
        out = np.empty(self.size)
        equations.rates(
            t, self.side_s, y, self.drive, self.constants, self.cutoff_rad_s, self._loads,
            out,
        )  # fmt: skip
        return out

    def jacobian(self, t: float, y: Floats) -> Floats:
        """Return the derivatives of the rates by the states, shape (size, size)."""
        out = np.zeros((self.size, self.size))
        equations.jacobian(
            t, self.side_s, y, self.scales, self.drive, self.constants, self.cutoff_rad_s,
            self._loads, out,
        )  # fmt: skip
        return out

    def start(self) -> Floats:
        """Return the state at time 0: at rest, the low-pass settled."""
        y = np.zeros(self.size)
        if self._smooth_at is not None:
            direct_v = np.empty((1, len(self.own_at)))
            equations.volts_and_positions(
                np.zeros(1), y[np.newaxis], self._own, self._own + 1, self.drive,
                self.constants, self._loads, direct_v, np.empty(1),
            )  # fmt: skip
            y[self._smooth_at] = direct_v[0]
        return y

    def corners_s(self) -> Floats:
        """Return the times between which the drive is smooth, with touch-down and lift-off."""
        rising = np.unique([*self.scene.corners_s(), *self._lifts_s])
        # Corners that differ only by round-off are one: no method can step between them.
        return rising[np.diff(rising, prepend=-1.0) > SAME_S]

    def moving_s(self) -> float:
        """Return when plate or object begins to move; infinite if neither does."""
        if self.with_object:
            load = LoadNumbers(*self.drive.load)
            pulled = np.flatnonzero(load.force_n)
            return float(load.corners_s[pulled[0] - 1]) if len(pulled) else math.inf
        # The start of the piece at whose end there is a velocity for the first time.
        plate = PlateNumbers(*self.drive.plate)
        moved = np.flatnonzero(plate.velocity_m_s)
        return float(plate.starts_s[moved[0] - 1]) if len(moved) else math.inf

    def position_m(self, t: float, y: Floats) -> float:
        """Return where the surface is."""
        if self.with_object:
            return float(y[-2])
        return float(drive_at(t, t, self.drive).position_m)

    def volts(self, time_s: Floats, states: Floats) -> tuple[Floats, Floats]:
        """Return the volts of the channels, less their baselines, and the surface's positions."""
        n_channels = len(self.own_at)
        smooth = self._smooth_at is not None
        position_m = np.empty(len(time_s))
        clean_v = states[:, self._smooth_at] if smooth else np.empty((len(time_s), n_channels))
        equations.volts_and_positions(
            time_s, states, self._own, self._own + smooth, self.drive, self.constants,
            self._loads, np.empty((0, n_channels)) if smooth else clean_v, position_m,
        )  # fmt: skip
        return clean_v, position_m

    def bands(self) -> dict[str, int]:
        """Return how far from the diagonal the Jacobian reaches, without an object."""
        smooth = self._smooth_at is not None
        if not self._own:
            return {'lband': 0, 'uband': 0}
        return {'lband': self._own if smooth else self._own - 1, 'uband': self._own - 1}

    def stiffness_1_s(self, span_s: tuple[float, float]) -> tuple[float, float]:
        """Return the mean and the largest rate at which bristles settle in a span of time."""
        times_s = np.linspace(*span_s, 2001)
        mean, most = equations.settling_rates(times_s, self.drive, self.constants, self._loads)
        return float(mean), float(most)
