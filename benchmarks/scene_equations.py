"""The mechanics of a scene as a differential equation, for SciPy's integrators.

The laws of contact, friction, texture and drive are those of the scene's own parts, and the
numbers those of its own plan. All that a step of SciPy's calls is compiled, Jacobian included, so
that the methods are compared and not the languages. :mod:`benchmarks.scene_integrators`
solves it; nothing that runs live needs either.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.scenes import Scene
from slip_detector.scenes.contact import spread_load
from slip_detector.scenes.drive import drive_at
from slip_detector.scenes.friction import COULOMB, LIGHTEST_LOAD_N, bristle_force
from slip_detector.scenes.mechanics import FINGERS, Plan
from slip_detector.scenes.motion import LoadNumbers, PlateNumbers
from slip_detector.scenes.roughness import roughness_between
from slip_detector.scenes.texture import ridges_between

Floats = NDArray[np.float64]

#: Change of a state for the differences that make the Jacobian, relative to its scale.
DIFFERENCE = 1e-7

#: Contact is looked for at so many points of the fastest thing that the force does, and at most
#: so many in all.
LIFT_POINTS, MOST_LIFT_POINTS = 40, 200_000

#: Corners no further apart are one.
SAME_S = 1e-12

#: Iterations for the velocity of skin without mass; about six are needed.
MOST_ITERATIONS = 100


@compiled
def _passing(v, x, z, load, skin, law):
    """Return the velocity w at which the surface passes over skin without mass.

    c (v - w) + k x = F(w, z), which has one root as long as something damps.
    """
    c = skin.damping_n_s_m
    pull = c * v + skin.stiffness_n_m * x
    at_rest, _ = bristle_force(0.0, z, load, law)
    balance = pull - at_rest
    if balance == 0.0:
        return 0.0
    # From here on w is positive in the direction in which it goes.
    sign = 1.0 if balance > 0.0 else -1.0
    low, high = 0.0, np.inf
    w = abs(balance) / (c + law.viscous_n_s_m + law.bristle_n_s_m)
    last, last_value = 0.0, abs(balance)
    for _ in range(MOST_ITERATIONS):
        force, _ = bristle_force(sign * w, z, load, law)
        value = sign * (pull - force) - c * w
        if value > 0.0:
            low = w
        else:
            high = w
        if value == 0.0 or abs(value) <= 1e-15 * abs(force):
            break
        following = w - value * (w - last) / (value - last_value) if value != last_value else -1.0
        last, last_value = w, value
        if not low < following < high:
            following = 0.5 * (low + high) if high < np.inf else 2.0 * w
        if abs(following - w) <= 1e-15 * w:
            break
        w = following
    return sign * w


@compiled
def _patch_rates(v, load, x, u, z, plan):
    """Return dx/dt, du/dt, dz/dt and the friction force of one patch."""
    skin = plan.skin
    if load == 0.0 and x == 0.0 and u == 0.0 and z == 0.0:
        return 0.0, 0.0, 0.0, 0.0  # Nothing touches it: as in the live stepper.
    if skin.mass_kg > 0.0:
        force, dz = bristle_force(v - u, z, load, plan.friction)
        pull = force - skin.damping_n_s_m * u - skin.stiffness_n_m * x
        return u, pull / skin.mass_kg, dz, force
    w = _passing(v, x, z, load, skin, plan.friction)
    force, dz = bristle_force(w, z, load, plan.friction)
    return v - w, 0.0, dz, force


@compiled
def _spread(drive, plan, loads):
    """Write the normal loads of the patches."""
    spread_load(
        drive.force_n, drive.centre_x_m, drive.centre_y_m, plan.positions_m, plan.hertz,
        plan.body.rest_patches, loads,
    )  # fmt: skip


@compiled
def _channel_volts(c, load, x, position, plan):
    """Return the voltage of a channel at an instant, before the low-pass."""
    way = position - x + plan.positions_m[c, 0]
    texture = 0.0
    if plan.ridges.amplitudes.size:
        texture += ridges_between(way, way, plan.ridges)
    if plan.rough.heights.size:
        texture += roughness_between(way, way, plan.rough)
    shear = plan.skin.stiffness_n_m * x
    return plan.normal_v_n[c] * load * (1.0 + texture) + plan.shear_v_n[c] * shear


@compiled
def _rates(t, side, y, numbers, plan, cutoff_rad_s, loads, out):
    """Write dy/dt; the states stand patch by patch: x, u (with mass), z, V (with a filter)."""
    drive = drive_at(t, side, numbers)
    n_channels, n_patches = plan.positions_m.shape[0], plan.patches.size
    with_object = plan.body.mass_kg > 0.0
    with_mass, smooth = plan.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    position, v = drive.position_m, drive.velocity_m_s
    if with_object:
        position, v = y[-2], y[-1]
    _spread(drive, plan, loads)
    i = 0
    total = 0.0
    for p in range(max(n_patches, n_channels)):
        x = 0.0
        if n_patches:
            x = y[i]
            u = y[i + 1] if with_mass else 0.0
            z = y[i + 1 + with_mass]
            dx, du, dz, friction = _patch_rates(v, loads[p], x, u, z, plan)
            total += plan.patches[p] * friction
            out[i] = dx
            if with_mass:
                out[i + 1] = du
            out[i + 1 + with_mass] = dz
            i += 2 + with_mass
        if smooth and p < n_channels:
            out[i] = cutoff_rad_s * (_channel_volts(p, loads[p], x, position, plan) - y[i])
            i += 1
    if with_object:
        out[-2] = v
        out[-1] = (drive.load_n - FINGERS * total) / plan.body.mass_kg


@compiled
def _jacobian(t, side, y, scales, numbers, plan, cutoff_rad_s, loads, out):
    """Write the Jacobian of :func:`_rates`: one patch's states do not show in another's."""
    drive = drive_at(t, side, numbers)
    n_channels, n_patches = plan.positions_m.shape[0], plan.patches.size
    with_object = plan.body.mass_kg > 0.0
    with_mass, smooth = plan.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    own = 2 + with_mass if n_patches else 0
    n = y.size
    position, v = drive.position_m, drive.velocity_m_s
    if with_object:
        position, v = y[-2], y[-1]
        out[n - 2, n - 1] = 1.0
    _spread(drive, plan, loads)
    i = 0
    changed = np.zeros(4)
    for p in range(max(n_patches, n_channels)):
        x = 0.0
        if n_patches:
            at = i + np.arange(own)
            x = y[i]
            u = y[i + 1] if with_mass else 0.0
            z = y[i + own - 1]
            dx, du, dz, friction = _patch_rates(v, loads[p], x, u, z, plan)
            for j in range(own + with_object):
                which = j if j == 0 or with_mass or j == own else 2
                change = DIFFERENCE * (scales[i + j] if j < own else scales[n - 1])
                changed[0], changed[1], changed[2], changed[3] = x, u, z, v
                changed[3 if j == own else which] += change
                dx2, du2, dz2, friction2 = _patch_rates(
                    changed[3], loads[p], changed[0], changed[1], changed[2], plan
                )
                column = at[j] if j < own else n - 1
                out[i, column] = (dx2 - dx) / change
                if with_mass:
                    out[i + 1, column] = (du2 - du) / change
                out[i + own - 1, column] = (dz2 - dz) / change
                if with_object:
                    share = plan.patches[p] * (friction2 - friction) / change
                    out[n - 1, column] -= FINGERS * share / plan.body.mass_kg
            i += own
        if smooth and p < n_channels:
            value = _channel_volts(p, loads[p], x, position, plan)
            if n_patches:
                change = DIFFERENCE * scales[i - own]
                value2 = _channel_volts(p, loads[p], x + change, position, plan)
                out[i, i - own] = cutoff_rad_s * (value2 - value) / change
            if with_object:
                change = DIFFERENCE * scales[n - 2]
                value2 = _channel_volts(p, loads[p], x, position + change, plan)
                out[i, n - 2] = cutoff_rad_s * (value2 - value) / change
            out[i, i] = -cutoff_rad_s
            i += 1


@compiled
def _all_volts(times_s, states, own, stride, numbers, plan, loads, clean_v, position_m):
    """Write volts before the low-pass and the position of the surface at given times.

    ``own`` is the number of states of a patch and ``stride`` that from patch to patch; no volts
    are computed where ``clean_v`` has no rows.
    """
    with_object = plan.body.mass_kg > 0.0
    for k in range(times_s.size):
        drive = drive_at(times_s[k], times_s[k], numbers)
        position = states[k, -2] if with_object else drive.position_m
        position_m[k] = position
        if not clean_v.shape[0]:
            continue
        _spread(drive, plan, loads)
        for c in range(plan.positions_m.shape[0]):
            x = states[k, c * stride] if own else 0.0
            clean_v[k, c] = _channel_volts(c, loads[c], x, position, plan)


@compiled
def _stiffness(times_s, numbers, plan, loads):
    """Return the mean and the largest rate (1/s) at which bristles settle, over given times."""
    total, most = 0.0, 0.0
    law, skin = plan.friction, plan.skin
    give = skin.damping_n_s_m + law.bristle_n_s_m + law.viscous_n_s_m
    for t in times_s:
        drive = drive_at(t, t, numbers)
        _spread(drive, plan, loads)
        fastest = 0.0
        if skin.mass_kg > 0.0:
            fastest = max(np.sqrt(law.bristle_n_m / skin.mass_kg), give / skin.mass_kg)
        elif give > 0.0:
            fastest = law.bristle_n_m / give
        fastest = max(fastest, 1.0 / law.unloading_s)
        for p in range(plan.patches.size):
            level = law.kinetic * max(loads[p], LIGHTEST_LOAD_N)
            fastest = max(fastest, law.bristle_n_m * abs(drive.velocity_m_s) / level)
        total += fastest
        most = max(most, fastest)
    return total / times_s.size, most


def _lifts_s(scene: Scene) -> list[float]:
    """Return when the fingertip is put on and lifts off.

    A method with long steps could step over a short contact.
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
        while high - low > 1e-15 * high:
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

    The states stand patch by patch: displacement of the skin, its velocity (where it has mass),
    deflection of the bristles, and the low-pass's state (where there is one); then position and
    velocity of an object.

    Parameters
    ----------
    scene
        Fresh or not: only its numbers are used.

    Attributes
    ----------
    size : int
        Number of states; 0 where the volts are a closed form of the time.
    scales : ndarray, shape (size,)
        How large each state may become, by which tolerances and differences are measured.
    own_at : ndarray of int, shape (16,)
        Where the states of each patch begin.
    side_s : float
        A time within the smooth piece of the drive that is under way; to be kept up to date.

    Raises
    ------
    ValueError
        For Coulomb's friction, which no differential equation says.
    """

    scene: Scene

    def __post_init__(self) -> None:
        """Collect the numbers."""
        scene = self.scene
        self.plan: Plan = scene.plan
        plan = self.plan
        if plan.patches.size and plan.friction.model == COULOMB:
            raise ValueError(
                'friction: model is coulomb, whose force at rest is no function of the state; '
                'allowed: lugre for LSODA, BDF, Radau, RK45 and DOP853, or the live stepper'
            )
        skin = plan.skin
        damping = skin.damping_n_s_m + plan.friction.viscous_n_s_m
        if plan.patches.size and skin.mass_kg == 0.0 and damping == 0.0:
            raise ValueError(
                'skin: mass_kg and damping_n_s_m are 0, so that no state says how fast it moves; '
                'allowed: one of them above 0 for LSODA, BDF, Radau, RK45 and DOP853, or the live '
                'stepper'
            )
        self.drive = scene.drive_numbers
        self.with_object = plan.body.mass_kg > 0.0
        self.with_mass = plan.skin.mass_kg > 0.0
        self.cutoff_rad_s = 2.0 * np.pi * scene.electronics.bandwidth_hz
        self._loads = np.zeros(max(plan.patches.size, plan.positions_m.shape[0]))
        n_channels = plan.positions_m.shape[0]
        self._own = (2 + self.with_mass) if plan.patches.size else 0
        times = np.linspace(0.0, scene.duration_s, 2001)
        load_n = scene.contact.largest_load_n(float(scene.force_n(times).max()))
        load_n = max(load_n, LIGHTEST_LOAD_N)
        law = plan.friction
        shear_n = law.static * load_n if plan.patches.size else 0.0
        x_m, z_m = shear_n / max(skin.stiffness_n_m, 1e-9), shear_n / law.bristle_n_m
        self.speed_m_s = max(scene.largest_velocity_m_s, 1e-3)
        volts = float(np.abs(plan.normal_v_n).max()) * load_n
        volts += float(np.abs(plan.shear_v_n).max()) * shear_n
        own = [x_m, self.speed_m_s, z_m] if self.with_mass else [x_m, z_m]
        own = own if plan.patches.size else []
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
        _rates(
            t, self.side_s, y, self.drive, self.plan, self.cutoff_rad_s, self._loads,
            out,
        )  # fmt: skip
        return out

    def jacobian(self, t: float, y: Floats) -> Floats:
        """Return the derivatives of the rates by the states, shape (size, size)."""
        out = np.zeros((self.size, self.size))
        _jacobian(
            t, self.side_s, y, self.scales, self.drive, self.plan, self.cutoff_rad_s,
            self._loads, out,
        )  # fmt: skip
        return out

    def start(self) -> Floats:
        """Return the state at time 0: at rest, the low-pass settled."""
        y = np.zeros(self.size)
        if self._smooth_at is not None:
            direct_v = np.empty((1, len(self.own_at)))
            _all_volts(
                np.zeros(1), y[np.newaxis], self._own, self._own + 1, self.drive,
                self.plan, self._loads, direct_v, np.empty(1),
            )  # fmt: skip
            y[self._smooth_at] = direct_v[0]
        return y

    def corners_s(self) -> Floats:
        """Return the times between which the drive is smooth, contact made and lost included."""
        rising = np.unique([*self.scene.corners_s(), *self._lifts_s])
        # Two that differ by round-off are one: no method can step from one to the other.
        return rising[np.diff(rising, prepend=-1.0) > SAME_S]

    def moving_s(self) -> float:
        """Return when plate or object begins to be moved; infinite where none is."""
        if self.with_object:
            load = LoadNumbers(*self.drive.load)
            pulled = np.flatnonzero(load.force_n)
            return float(load.corners_s[pulled[0] - 1]) if len(pulled) else math.inf
        # The piece that ends with the first velocity there is.
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
        _all_volts(
            time_s, states, self._own, self._own + smooth, self.drive, self.plan,
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
        mean, most = _stiffness(times_s, self.drive, self.plan, self._loads)
        return float(mean), float(most)
