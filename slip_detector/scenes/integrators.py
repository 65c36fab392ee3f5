"""The mechanics of a scene as a differential equation, for SciPy's integrators.

The benchmark measures the live stepper (:mod:`slip_detector.scenes.mechanics`) against them;
nothing that runs live needs this module. The laws of contact, friction and texture are those of
the scene's own parts, and the numbers those of its own plan. All that a step of SciPy's calls is
compiled, Jacobian included, so that the methods are compared and not the languages.
"""

# Numba finds the types of what is compiled:
# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, allow-incomplete-defs

import dataclasses
import math
import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, optimize

from slip_detector.compiled import compiled
from slip_detector.scenes.contact import spread_load
from slip_detector.scenes.friction import COULOMB, LIGHTEST_LOAD_N, bristle_force
from slip_detector.scenes.mechanics import FINGERS, Plan
from slip_detector.scenes.scene import TREMOR_PEAK, Scene
from slip_detector.scenes.texture import ridges_between, roughness_between

Floats = NDArray[np.float64]

EXPLICIT = ('RK45', 'DOP853')
IMPLICIT = ('LSODA', 'BDF', 'Radau')
METHODS = (*EXPLICIT, *IMPLICIT)

#: An explicit method takes at most so long a step, in shares of the fastest thing's time: the
#: ends of the stability regions of both on the real axis are near 3.3 and 6.
EXPLICIT_REACH = {'RK45': 3.3, 'DOP853': 6.0}

#: More steps than this are not to be waited for: ten minutes and more.
MOST_EXPLICIT_STEPS = 5e6

#: A taxel has begun to slip when the surface has passed so much further over it than at the
#: start of the motion.
ONSET_M = 10e-6

#: Change of a state for the differences that make the Jacobian, relative to its scale.
DIFFERENCE = 1e-7

#: Contact is looked for at so many points of the fastest thing that the force does, and at most
#: so many in all.
LIFT_POINTS, MOST_LIFT_POINTS = 40, 200_000

#: Corners no further apart are one.
SAME_S = 1e-12

#: Iterations for the velocity of skin without mass; about six are needed.
MOST_ITERATIONS = 100


class DriveNumbers(NamedTuple):
    """What is done to the fingertip, for compiled code to ask at one instant.

    Attributes
    ----------
    starts, lines, ringing, roots, lag_s
        The normal force, see :class:`slip_detector.scenes.motion.NormalForce`.
    corners_s, velocity, position
        The plate's piecewise polynomials; their coefficients as SciPy's PPoly has them.
    load_at_s, load_n
        Force on the object, linear in between; without length where there is none.
    centre_m : ndarray, shape (2,)
        Where the contact is at rest.
    rolling : ndarray, shape (6,) or (0,)
        Start, duration, hold, repeats and both distances.
    taps_s, tap
        When taps begin; peak and duration of each.
    force_lines, motion_lines : ndarray, shape (3, k)
        The tremor's amplitudes, angular rates and phases.
    tremor_peak_n : float
        The force under which all of the tremor's force is there.
    """

    starts: Floats
    lines: Floats
    ringing: NDArray[np.complex128]
    roots: NDArray[np.complex128]
    lag_s: float
    corners_s: Floats
    velocity: Floats
    position: Floats
    load_at_s: Floats
    load_n: Floats
    centre_m: Floats
    rolling: Floats
    taps_s: Floats
    tap: Floats
    force_lines: Floats
    motion_lines: Floats
    tremor_peak_n: float


def drive_numbers(scene: Scene) -> DriveNumbers:
    """Return what is done to a scene's fingertip, from the scene itself."""
    force, platform = scene._force, scene._platform
    none = np.zeros(0)
    rolling, taps, tremor = scene._rolling, scene._taps, scene._tremor
    no_lines = np.zeros((3, 0))
    return DriveNumbers(
        starts=force._starts,
        lines=np.ascontiguousarray(force._lines),
        ringing=np.ascontiguousarray(force._ringing),
        roots=np.asarray(force._roots, dtype=np.complex128),
        lag_s=float(force._lag_s),
        corners_s=np.ascontiguousarray(platform._velocity.x),
        velocity=np.ascontiguousarray(platform._velocity.c),
        position=np.ascontiguousarray(platform._position.c),
        load_at_s=scene._load._times if scene._load else none,
        load_n=scene._load._forces if scene._load else none,
        centre_m=np.array(scene._contact.centre_m),
        rolling=np.array(
            [
                rolling.start_s,
                rolling.duration_s,
                rolling.hold_s,
                float(rolling.repeats),
                *rolling.distance_m,
            ]
        )
        if rolling
        else none,
        taps_s=np.array(taps.times_s) if taps else none,
        tap=np.array([taps.peak_force_n, taps.duration_s]) if taps else none,
        force_lines=np.array(tremor.force_lines) if tremor else no_lines,
        motion_lines=np.array(tremor.motion_lines) if tremor else no_lines,
        tremor_peak_n=TREMOR_PEAK * scene.parts['tremor'].force_rms_n if tremor else 1.0,
    )


@compiled
def _segment(t, starts):
    """Return the number of the segment that a time lies in."""
    return max(np.searchsorted(starts, t, side='right') - 1, 0)


@compiled
def _lines_value(t, lines, order):
    """Return a sum of sines or one of its derivatives."""
    total = 0.0
    for k in range(lines.shape[1]):
        rate = lines[1, k]
        angle = rate * t + lines[2, k]
        if order == 0:
            total += lines[0, k] * np.sin(angle)
        elif order == 1:
            total += lines[0, k] * rate * np.cos(angle)
        else:
            total -= lines[0, k] * rate * rate * np.sin(angle)
    return total


@compiled
def _smooth_step(u):
    """Return the share of the way rolled."""
    u = min(max(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@compiled
def drive_at(t, side, numbers, mass_kg):
    """Return what is done to the fingertip at one instant.

    Parameters
    ----------
    t : float
        The instant.
    side : float
        A time within the same smooth piece: at a corner it says which side is meant.
    numbers : DriveNumbers
        Of the scene.
    mass_kg : float
        Of the object.

    Returns
    -------
    force_n, centre_x_m, centre_y_m, velocity_m_s, position_m, load_n
    """
    k = _segment(side, numbers.starts)
    since = t - numbers.starts[k]
    force = numbers.lines[k, 0] + numbers.lines[k, 1] * (since - numbers.lag_s)
    for mode in range(2):
        force += (numbers.ringing[k, mode] * np.exp(since * numbers.roots[mode])).real
    force = max(force, 0.0)
    if numbers.taps_s.size:
        tap = np.searchsorted(numbers.taps_s, side, side='right') - 1
        if tap >= 0 and side - numbers.taps_s[tap] < numbers.tap[1]:
            force += numbers.tap[0] * np.sin(np.pi / numbers.tap[1] * (t - numbers.taps_s[tap]))
    if numbers.force_lines.size:
        share = min(force / numbers.tremor_peak_n, 1.0)
        force += share * _lines_value(t, numbers.force_lines, 0)
    force = max(force, 0.0)
    x, y = numbers.centre_m[0], numbers.centre_m[1]
    if numbers.rolling.size:
        start, duration, hold = numbers.rolling[0], numbers.rolling[1], numbers.rolling[2]
        cycle = 2.0 * (duration + hold)
        since = min(max(t - start, 0.0), numbers.rolling[3] * cycle)
        within = since - cycle * np.floor(since / cycle)
        share = _smooth_step(within / duration) - _smooth_step(
            (within - duration - hold) / duration
        )
        x += share * numbers.rolling[4]
        y += share * numbers.rolling[5]
    if numbers.load_n.size:
        load = np.interp(t, numbers.load_at_s, numbers.load_n)
        load -= mass_kg * _lines_value(t, numbers.motion_lines, 2)
        return force, x, y, 0.0, 0.0, load
    k = min(_segment(side, numbers.corners_s), numbers.velocity.shape[1] - 1)
    since = t - numbers.corners_s[k]
    velocity = numbers.velocity[0, k] * since + numbers.velocity[1, k]
    position = (numbers.position[0, k] * since + numbers.position[1, k]) * since
    position += numbers.position[2, k]
    if numbers.motion_lines.size:
        velocity += _lines_value(t, numbers.motion_lines, 1)
        position += _lines_value(t, numbers.motion_lines, 0)
    return force, x, y, velocity, position, 0.0


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
    force, cx, cy, v, position, pull = drive_at(t, side, numbers, plan.body.mass_kg)
    n_channels, n_patches = plan.positions_m.shape[0], plan.patches.size
    with_object = numbers.load_n.size > 0
    with_mass, smooth = plan.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    if with_object:
        position, v = y[-2], y[-1]
    spread_load(force, cx, cy, plan.positions_m, plan.hertz, plan.body.rest_patches, loads)
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
        out[-1] = (pull - FINGERS * total) / plan.body.mass_kg


@compiled
def _jacobian(t, side, y, scales, numbers, plan, cutoff_rad_s, loads, out):
    """Write the Jacobian of :func:`_rates`: one patch's states do not show in another's."""
    force, cx, cy, v, position, _ = drive_at(t, side, numbers, plan.body.mass_kg)
    n_channels, n_patches = plan.positions_m.shape[0], plan.patches.size
    with_object = numbers.load_n.size > 0
    with_mass, smooth = plan.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    own = 2 + with_mass if n_patches else 0
    n = y.size
    if with_object:
        position, v = y[-2], y[-1]
        out[n - 2, n - 1] = 1.0
    spread_load(force, cx, cy, plan.positions_m, plan.hertz, plan.body.rest_patches, loads)
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
    with_object = numbers.load_n.size > 0
    for k in range(times_s.size):
        force, cx, cy, _, position, _ = drive_at(
            times_s[k], times_s[k], numbers, plan.body.mass_kg
        )
        if with_object:
            position = states[k, -2]
        position_m[k] = position
        if not clean_v.shape[0]:
            continue
        spread_load(force, cx, cy, plan.positions_m, plan.hertz, plan.body.rest_patches, loads)
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
        force, cx, cy, v, _, _ = drive_at(t, t, numbers, plan.body.mass_kg)
        spread_load(force, cx, cy, plan.positions_m, plan.hertz, plan.body.rest_patches, loads)
        fastest = 0.0
        if skin.mass_kg > 0.0:
            fastest = max(np.sqrt(law.bristle_n_m / skin.mass_kg), give / skin.mass_kg)
        elif give > 0.0:
            fastest = law.bristle_n_m / give
        fastest = max(fastest, 1.0 / law.unloading_s)
        for p in range(plan.patches.size):
            level = law.kinetic * max(loads[p], LIGHTEST_LOAD_N)
            fastest = max(fastest, law.bristle_n_m * abs(v) / level)
        total += fastest
        most = max(most, fastest)
    return total / times_s.size, most


class Solution(NamedTuple):
    """What an integrator gives.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    clean_v : ndarray, shape (n, 16)
    position_m : ndarray, shape (n,)
    onset_s : ndarray, shape (16,)
        When each taxel has begun to slip; NaN where it has not.
    lost_s : float
        When the object was lost, with which the solution ends; infinite where it was not.
    states : ndarray, shape (n, states)
    run_time_s : float
        Time of the processor.
    steps, calls : int
        Steps of the method, and how often it asked for the rates.
    """

    time_s: Floats
    clean_v: Floats
    position_m: Floats
    onset_s: Floats
    lost_s: float
    states: Floats
    run_time_s: float
    steps: int
    calls: int


class GivenUpError(RuntimeError):
    """A method has used up the time it was given."""


def _lifts_s(scene: Scene) -> list[float]:
    """Return when the fingertip is put on and lifts off.

    A method with long steps could step over a short contact.
    """
    motion = scene.parts.get('motion')
    ringing_hz = motion.ringing_hz if motion else 18.0
    fastest_s = 1.0 / ringing_hz
    if scene._taps:
        fastest_s = min(fastest_s, scene._taps.duration_s)
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
        self.drive = drive_numbers(scene)
        self.with_object = scene._object is not None
        self.with_mass = plan.skin.mass_kg > 0.0
        electronics = scene._frontend._electronics
        self.cutoff_rad_s = 2.0 * np.pi * electronics.bandwidth_hz
        self._loads = np.zeros(max(plan.patches.size, plan.positions_m.shape[0]))
        n_channels = plan.positions_m.shape[0]
        self._own = (2 + self.with_mass) if plan.patches.size else 0
        times = np.linspace(0.0, scene.duration_s, 2001)
        load_n = scene._contact.largest_load_n(float(scene.force_n(times).max()))
        load_n = max(load_n, LIGHTEST_LOAD_N)
        law = plan.friction
        shear_n = law.static * load_n if plan.patches.size else 0.0
        x_m, z_m = shear_n / max(skin.stiffness_n_m, 1e-9), shear_n / law.bristle_n_m
        self.speed_m_s = max(scene._platform.largest_velocity_m_s, 1e-3)
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
        # Where a smooth piece of the drive is under way, a time within it.
        self._side = 0.0
        self._smooth_at = self.own_at + self._own if self.cutoff_rad_s else None

    def rates(self, t: float, y: Floats) -> Floats:
        """Return dy/dt."""
        out = np.empty(self.size)
        _rates(
            t, self._side, y, self.drive, self.plan, self.cutoff_rad_s, self._loads,
            out,
        )  # fmt: skip
        return out

    def jacobian(self, t: float, y: Floats) -> Floats:
        """Return the derivatives of the rates by the states, shape (size, size)."""
        out = np.zeros((self.size, self.size))
        _jacobian(
            t, self._side, y, self.scales, self.drive, self.plan, self.cutoff_rad_s,
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
        scene = self.scene
        times = [*scene.corners_s(), *self.drive.load_at_s]
        if scene._taps:
            for begin in scene._taps.times_s:
                times += [begin, begin + scene._taps.duration_s]
        if scene._rolling:
            rolling = scene._rolling
            for k in range(min(rolling.repeats, 1000)):
                begin = rolling.start_s + 2 * k * (rolling.duration_s + rolling.hold_s)
                back = begin + rolling.duration_s + rolling.hold_s
                times += [begin, begin + rolling.duration_s, back, back + rolling.duration_s]
        times += self._lifts_s
        rising = np.unique([t for t in times if 0.0 < t < scene.duration_s])
        # Two that differ by round-off are one: no method can step from one to the other.
        return rising[np.diff(rising, prepend=-1.0) > SAME_S]

    def moving_s(self) -> float:
        """Return when plate or object begins to be moved; infinite where none is."""
        if self.with_object:
            pulled = np.flatnonzero(self.drive.load_n)
            return float(self.drive.load_at_s[pulled[0] - 1]) if len(pulled) else math.inf
        first = np.flatnonzero(np.any(self.drive.velocity != 0.0, axis=0))
        return float(self.drive.corners_s[first[0]]) if len(first) else math.inf

    def position_m(self, t: float, y: Floats) -> float:
        """Return where the surface is."""
        if self.with_object:
            return float(y[-2])
        return float(drive_at(t, t, self.drive, self.plan.body.mass_kg)[4])

    def _volts(self, time_s: Floats, states: Floats) -> tuple[Floats, Floats]:
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

    def check(self, method: str, span_s: tuple[float, float]) -> None:
        """Refuse a method that cannot do it before it starts.

        Raises
        ------
        ValueError
            For an unknown method, and for an explicit one that would need too many steps.
        """
        if method not in METHODS:
            raise ValueError(f'unknown method {method}, allowed: {", ".join(METHODS)}')
        if not self.size:
            raise ValueError(
                'the scene has no friction and no low-pass: its volts are a closed form of the '
                'time; allowed: scenes with one of them'
            )
        if method in EXPLICIT and self.plan.patches.size:
            times = np.linspace(*span_s, 2001)
            mean, most = _stiffness(times, self.drive, self.plan, self._loads)
            steps = mean * (span_s[1] - span_s[0]) / EXPLICIT_REACH[method]
            if steps > MOST_EXPLICIT_STEPS:
                raise ValueError(
                    f'{method}: would need about {steps:.1e} steps, as bristles settle in down to '
                    f'{1.0 / most:.1e} s; allowed: up to {MOST_EXPLICIT_STEPS:g} steps, or LSODA, '
                    'BDF, Radau and the live stepper'
                )

    def solve(
        self,
        method: str,
        rtol: float,
        span: tuple[int, int] | None = None,
        start: Floats | None = None,
        budget_s: float = math.inf,
    ) -> Solution:
        """Integrate from corner to corner.

        The absolute tolerance of each state is ``rtol`` times its scale.

        Parameters
        ----------
        method
            One of :data:`METHODS`.
        rtol
            Relative tolerance.
        span
            First and last sample, all without.
        start : ndarray, shape (size,), optional
            State at the first sample.
        budget_s
            Time of the processor after which to give up.

        Raises
        ------
        ValueError
            When the method cannot do it; before anything is computed.
        GivenUpError
            When the time is over.
        RuntimeError
            When the method fails or its states are not finite.
        """
        scene = self.scene
        rate_hz = scene._true_rate_hz
        first, last = span or (0, scene.length - 1)
        time_s = np.arange(first, last + 1) / rate_hz
        self.check(method, (time_s[0], time_s[-1]))
        begin_s = time.thread_time()
        y = self.start() if start is None else start.copy()
        states = np.empty((len(time_s), self.size))
        states[0] = y
        inside = self.corners_s()
        inside = inside[(inside > time_s[0]) & (inside < time_s[-1])]
        pieces = np.concatenate([time_s[:1], inside, time_s[-1:]])
        moving_s = self.moving_s()
        x_at = self.own_at if self._own else None
        onset_s = np.full(len(self.own_at), np.nan)
        at_start_m: Floats | None = None
        lost_s, steps, calls, done = math.inf, 0, 0, 1
        pairs = zip(pieces[:-1].tolist(), pieces[1:].tolist(), strict=True)
        for begin, end in pairs:
            if lost_s < math.inf:
                break
            self._side = 0.5 * (begin + end)
            if x_at is not None and at_start_m is None and begin >= moving_s:
                at_start_m = self.position_m(begin, y) - y[x_at]
            solver = self._solver(method, rtol, begin, y, end)
            while solver.status == 'running' and lost_s == math.inf:
                with warnings.catch_warnings():
                    warnings.simplefilter('ignore')
                    message = solver.step()
                steps += 1
                if solver.status == 'failed' or not np.isfinite(solver.y).all():
                    raise RuntimeError(f'{method}: failed at {solver.t:g} s: {message}')
                if not steps % 50 and time.thread_time() - begin_s > budget_s:
                    raise GivenUpError(f'{method}: given up after {budget_s:g} s')
                dense, stop = None, solver.t
                if self.with_object and solver.y[-2] > self.plan.body.length_m:
                    dense = solver.dense_output()
                    stop = lost_s = self._crossing(
                        dense, solver, lambda t, y: float(y[-2]) - self.plan.body.length_m
                    )
                if done < len(time_s) and time_s[done] <= stop:
                    dense = dense or solver.dense_output()
                    until = int(np.searchsorted(time_s, stop, side='right'))
                    states[done:until] = dense(time_s[done:until]).T
                    done = until
                if x_at is not None and at_start_m is not None and np.isnan(onset_s).any():
                    passed_m = self.position_m(solver.t, solver.y) - solver.y[x_at] - at_start_m
                    for c in np.flatnonzero((np.abs(passed_m) >= ONSET_M) & np.isnan(onset_s)):
                        dense = dense or solver.dense_output()
                        onset_s[c] = self._crossing(
                            dense,
                            solver,
                            lambda t, y, i=x_at[c], start_m=at_start_m[c]: (
                                abs(self.position_m(t, y) - y[i] - start_m) - ONSET_M
                            ),
                        )
            calls += solver.nfev
            y = solver.y
        time_s, states = time_s[:done], states[:done]
        clean_v, position_m = self._volts(time_s, states)
        run_time_s = time.thread_time() - begin_s
        return Solution(
            time_s, clean_v, position_m, onset_s, lost_s, states, run_time_s, steps, calls
        )

    @staticmethod
    def _crossing(dense: Any, solver: Any, far: Callable[..., float]) -> float:
        """Return when within the last step something has gone from below to above zero."""
        first, last = float(solver.t_old), float(solver.t)
        if far(first, dense(first)) >= 0.0:
            return first
        if far(last, dense(last)) <= 0.0:
            return last
        return float(
            optimize.brentq(lambda t: far(t, dense(t)), first, last, xtol=1e-13, rtol=1e-15)
        )

    def _solver(self, method: str, rtol: float, t: float, y: Floats, end: float) -> Any:
        """Make SciPy's solver, as well equipped as can be."""
        options: dict[str, Any] = {'rtol': rtol, 'atol': rtol * self.scales}
        if method in ('BDF', 'Radau') or (method == 'LSODA' and self.with_object):
            options['jac'] = self.jacobian
        elif method == 'LSODA':
            options |= self.bands()
        return getattr(integrate, method)(self.rates, t, y, end, **options)

    def bands(self) -> dict[str, int]:
        """Return how far from the diagonal the Jacobian reaches, without an object."""
        smooth = self._smooth_at is not None
        if not self._own:
            return {'lband': 0, 'uband': 0}
        return {'lband': self._own if smooth else self._own - 1, 'uband': self._own - 1}


def live_onset_s(scene: Scene, ode: Ode, chunk: int = 20_000) -> Floats:
    """Return when each taxel of a fresh scene begins to slip, by the live stepper.

    The scene is to be one that shows shears, see :func:`shows_shears`: its samples are steps.
    """
    onset_s = np.full(len(ode.own_at), np.nan)
    moving_s = ode.moving_s()
    at_start: Floats | None = None
    before: tuple[float, Floats] | None = None
    stiffness_n_m = scene.plan.skin.stiffness_n_m
    while math.isfinite(moving_s):
        time_s, shear_n, position_m, _ = scene.clean(chunk)
        if not len(time_s):
            break
        passed_m = position_m[:, np.newaxis] - shear_n / stiffness_n_m
        if at_start is None and time_s[-1] >= moving_s:
            at_start = passed_m[np.searchsorted(time_s, moving_s - 1e-12)]
        if at_start is not None:
            gone_m = np.abs(passed_m - at_start)
            gone_m[time_s < moving_s - 1e-12] = 0.0
            for c in np.flatnonzero(np.isnan(onset_s)):
                i = int(np.argmax(gone_m[:, c] >= ONSET_M))
                if gone_m[i, c] < ONSET_M:
                    continue
                t0, g0 = 0.0, 0.0
                if i:
                    t0, g0 = time_s[i - 1], gone_m[i - 1, c]
                elif before:
                    t0, g0 = before[0], before[1][c]
                share = (ONSET_M - g0) / (gone_m[i, c] - g0)
                onset_s[c] = t0 + share * (time_s[i] - t0)
            before = (float(time_s[-1]), gone_m[-1])
            if not np.isnan(onset_s).any():
                break
    return onset_s


def shows_shears(description: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Return a scene of the same mechanics whose volts are shears, one sample for each step."""
    steps_hz = scene.plan.steps_per_sample * scene.sample_rate_hz
    kept = {
        name: part for name, part in description.items() if name not in ('texture', 'roughness')
    }
    shears = {'normal_v_n': 0.0, 'shear_v_n': 1.0, 'shear_along_share': 1.0, 'spread': 0.0}
    return kept | {
        'electronics': shears,
        'sample_rate_hz': steps_hz,
        'step_s': min(1.0, 1.5 / steps_hz),
    }
