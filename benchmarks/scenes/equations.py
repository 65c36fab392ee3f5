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

"""The mechanics of a scene as a differential equation: its rates, their Jacobian, its volts.

The laws of contact, friction, texture and drive are those of the scene's parts, and the numbers
are the constants of the scene. Everything that a step of SciPy's integrators calls is compiled,
including the Jacobian, so that methods are compared and not languages.
"""

import numpy as np

from slip_detector.chain.compiled import compiled
from slip_detector.scenes.contact import spread_load
from slip_detector.scenes.drive import drive_at
from slip_detector.scenes.free_object import FINGERS
from slip_detector.scenes.friction import LIGHTEST_LOAD_N, bristle_force
from slip_detector.scenes.texture import ridges_between, roughness_between

#: Change of a state in the difference quotients of the Jacobian, relative to its scale.
DIFFERENCE = 1e-7

#: Most iterations for the velocity of skin without mass; about six are needed.
MOST_ITERATIONS = 100

#: The iteration ends when velocity or force are exact to this share of themselves.
ROUNDING = 1e-15


@compiled
def _passing_velocity(v, x, z, load, skin, law):
    """Return the velocity w at which the surface passes over skin without mass.

    It is the root of c (v - w) + k x = F(w, z), which exists if skin or friction have damping.
    """
    c = skin.damping_n_s_m
    pull = c * v + skin.stiffness_n_m * x
    at_rest, _ = bristle_force(0.0, z, load, law)
    balance = pull - at_rest
    if balance == 0.0:
        return 0.0
    # From here on w is counted in its own direction: it is positive.
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
        if value == 0.0 or abs(value) <= ROUNDING * abs(force):
            break
        following = w - value * (w - last) / (value - last_value) if value != last_value else -1.0
        last, last_value = w, value
        if not low < following < high:
            following = 0.5 * (low + high) if high < np.inf else 2.0 * w
        if abs(following - w) <= ROUNDING * w:
            break
        w = following
    return sign * w


@compiled
def _patch_rates(v, load, x, u, z, constants):
    """Return dx/dt, du/dt, dz/dt and the friction force of one patch."""
    skin = constants.skin
    if load == 0.0 and x == 0.0 and u == 0.0 and z == 0.0:
        return 0.0, 0.0, 0.0, 0.0  # Without contact nothing moves, as in the live stepper.
    if skin.mass_kg > 0.0:
        force, dz = bristle_force(v - u, z, load, constants.friction)
        pull = force - skin.damping_n_s_m * u - skin.stiffness_n_m * x
        return u, pull / skin.mass_kg, dz, force
    w = _passing_velocity(v, x, z, load, skin, constants.friction)
    force, dz = bristle_force(w, z, load, constants.friction)
    return v - w, 0.0, dz, force


@compiled
def _spread(drive, constants, loads):
    """Write the normal loads of the patches."""
    spread_load(
        drive.force_n, drive.centre_x_m, drive.centre_y_m, constants.positions_m, constants.hertz,
        constants.body.rest_patches, loads,
    )  # fmt: skip


@compiled
def _channel_volts(c, load, x, position, constants):
    """Return the voltage of a channel at an instant, before the low-pass."""
    way = position - x + constants.positions_m[c, 0]
    texture = 0.0
    if constants.ridges.amplitudes.size:
        texture += ridges_between(way, way, constants.ridges)
    if constants.rough.heights.size:
        texture += roughness_between(way, way, constants.rough)
    shear = constants.skin.stiffness_n_m * x
    return constants.normal_v_n[c] * load * (1.0 + texture) + constants.shear_v_n[c] * shear


@compiled
def rates(t, side, y, numbers, constants, cutoff_rad_s, loads, out):
    """Write dy/dt to ``out``.

    The states of each patch are its displacement x, its velocity u (with mass), the deflection z
    of its bristles and the voltage V (with a low-pass); then come position and velocity of an
    object. ``numbers`` are those of the drive; ``side`` is a time in the smooth piece of the drive
    in which t is.
    """
    drive = drive_at(t, side, numbers)
    n_channels, n_patches = constants.positions_m.shape[0], constants.patches.size
    with_object = constants.body.mass_kg > 0.0
    with_mass, smooth = constants.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    position, v = drive.position_m, drive.velocity_m_s
    if with_object:
        position, v = y[-2], y[-1]
    _spread(drive, constants, loads)
    i = 0
    total = 0.0
    for p in range(max(n_patches, n_channels)):
        x = 0.0
        if n_patches:
            x = y[i]
            u = y[i + 1] if with_mass else 0.0
            z = y[i + 1 + with_mass]
            dx, du, dz, friction = _patch_rates(v, loads[p], x, u, z, constants)
            total += constants.patches[p] * friction
            out[i] = dx
            if with_mass:
                out[i + 1] = du
            out[i + 1 + with_mass] = dz
            i += 2 + with_mass
        if smooth and p < n_channels:
            out[i] = cutoff_rad_s * (_channel_volts(p, loads[p], x, position, constants) - y[i])
            i += 1
    if with_object:
        out[-2] = v
        out[-1] = (drive.load_n - FINGERS * total) / constants.body.mass_kg


@compiled
def jacobian(t, side, y, scales, numbers, constants, cutoff_rad_s, loads, out):
    """Write the Jacobian of :func:`rates`; a patch acts on another only through the object."""
    drive = drive_at(t, side, numbers)
    n_channels, n_patches = constants.positions_m.shape[0], constants.patches.size
    with_object = constants.body.mass_kg > 0.0
    with_mass, smooth = constants.skin.mass_kg > 0.0, cutoff_rad_s > 0.0
    own = 2 + with_mass if n_patches else 0
    n = y.size
    position, v = drive.position_m, drive.velocity_m_s
    if with_object:
        position, v = y[-2], y[-1]
        out[n - 2, n - 1] = 1.0
    _spread(drive, constants, loads)
    i = 0
    changed = np.zeros(4)
    for p in range(max(n_patches, n_channels)):
        x = 0.0
        if n_patches:
            at = i + np.arange(own)
            x = y[i]
            u = y[i + 1] if with_mass else 0.0
            z = y[i + own - 1]
            dx, du, dz, friction = _patch_rates(v, loads[p], x, u, z, constants)
            for j in range(own + with_object):
                which = j if j == 0 or with_mass or j == own else 2
                change = DIFFERENCE * (scales[i + j] if j < own else scales[n - 1])
                changed[0], changed[1], changed[2], changed[3] = x, u, z, v
                changed[3 if j == own else which] += change
                dx2, du2, dz2, friction2 = _patch_rates(
                    changed[3], loads[p], changed[0], changed[1], changed[2], constants
                )
                column = at[j] if j < own else n - 1
                out[i, column] = (dx2 - dx) / change
                if with_mass:
                    out[i + 1, column] = (du2 - du) / change
                out[i + own - 1, column] = (dz2 - dz) / change
                if with_object:
                    share = constants.patches[p] * (friction2 - friction) / change
                    out[n - 1, column] -= FINGERS * share / constants.body.mass_kg
            i += own
        if smooth and p < n_channels:
            value = _channel_volts(p, loads[p], x, position, constants)
            if n_patches:
                change = DIFFERENCE * scales[i - own]
                value2 = _channel_volts(p, loads[p], x + change, position, constants)
                out[i, i - own] = cutoff_rad_s * (value2 - value) / change
            if with_object:
                change = DIFFERENCE * scales[n - 2]
                value2 = _channel_volts(p, loads[p], x, position + change, constants)
                out[i, n - 2] = cutoff_rad_s * (value2 - value) / change
            out[i, i] = -cutoff_rad_s
            i += 1


@compiled
def volts_and_positions(
    times_s, states, own, stride, numbers, constants, loads, clean_v, position_m
):
    """Write volts before the low-pass and the position of the surface at given times.

    ``own`` is the number of mechanical states of a patch, ``stride`` the distance in ``states``
    from one patch to the next. If ``clean_v`` has no rows, no volts are computed.
    """
    with_object = constants.body.mass_kg > 0.0
    for k in range(times_s.size):
        drive = drive_at(times_s[k], times_s[k], numbers)
        position = states[k, -2] if with_object else drive.position_m
        position_m[k] = position
        if not clean_v.shape[0]:
            continue
        _spread(drive, constants, loads)
        for c in range(constants.positions_m.shape[0]):
            x = states[k, c * stride] if own else 0.0
            clean_v[k, c] = _channel_volts(c, loads[c], x, position, constants)


@compiled
def settling_rates(times_s, numbers, constants, loads):
    """Return the mean and the largest rate (1/s) at which bristles settle at the given times."""
    total, most = 0.0, 0.0
    law, skin = constants.friction, constants.skin
    give = skin.damping_n_s_m + law.bristle_n_s_m + law.viscous_n_s_m
    for t in times_s:
        drive = drive_at(t, t, numbers)
        _spread(drive, constants, loads)
        fastest = 0.0
        if skin.mass_kg > 0.0:
            fastest = max(np.sqrt(law.bristle_n_m / skin.mass_kg), give / skin.mass_kg)
        elif give > 0.0:
            fastest = law.bristle_n_m / give
        fastest = max(fastest, 1.0 / law.unloading_s)
        for p in range(constants.patches.size):
            level = law.kinetic * max(loads[p], LIGHTEST_LOAD_N)
            fastest = max(fastest, law.bristle_n_m * abs(drive.velocity_m_s) / level)
        total += fastest
        most = max(most, fastest)
    return total / times_s.size, most
