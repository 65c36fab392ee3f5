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

"""The mechanics of a scene as a differential equation: its rates and its volts.

The laws of contact, texture and drive are those of the scene's parts, and the numbers are the
constants of the scene; the friction is written again. The functions are compiled, so that methods
are compared and not languages.
"""

import numpy as np

from slip_detector.compiled import compiled
from slip_detector.scenes.friction import LIGHTEST_LOAD_N
from slip_detector.scenes.motion import drive_at
from slip_detector.scenes.surface import FINGERS, ridges_between, roughness_between, spread_load

#: Most iterations for the velocity of the skin; about six are needed.
MOST_ITERATIONS = 100

#: The iteration ends when velocity or force are exact to this share of themselves.
ROUNDING = 1e-15


@compiled
def bristle_force(w, z, load, law):
    """Return the friction force and dz/dt for the velocity and the deflection."""
    sigma0, sigma1 = law.bristle_stiffness_n_m, law.bristle_damping_n_s_m
    load = max(load, LIGHTEST_LOAD_N)
    ratio = w / law.stribeck_velocity_m_s
    drop = (law.static_coefficient - law.kinetic_coefficient) * np.exp(-ratio * ratio)
    level = load * (law.kinetic_coefficient + drop)
    sliding = w - sigma0 * abs(w) / level * z
    damping = sigma1 / (1.0 + sigma1 * abs(w) / level)
    force = sigma0 * z + damping * sliding
    most = law.static_coefficient * load / sigma0
    beyond = z - min(max(z, -most), most)
    return force, sliding - beyond / law.unloading_s


@compiled
def _passing_velocity(v, x, z, load, skin, law):
    """Return the velocity w at which the surface passes over the skin.

    It is the root of c (v - w) + k x = F(w, z), which exists if skin or friction have damping.
    """
    c = skin.damping_n_s_m
    pull = c * v + skin.shear_stiffness_n_m * x
    at_rest, _ = bristle_force(0.0, z, load, law)
    balance = pull - at_rest
    if balance == 0.0:
        return 0.0
    # From here on w is counted in its own direction: it is positive.
    sign = 1.0 if balance > 0.0 else -1.0
    low, high = 0.0, np.inf
    w = abs(balance) / (c + law.bristle_damping_n_s_m)
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
def _patch_rates(v, load, x, z, constants):
    """Return dx/dt, dz/dt and the friction force of one patch."""
    if load == 0.0 and x == 0.0 and z == 0.0:
        return 0.0, 0.0, 0.0  # Without contact nothing moves, as in the live stepper.
    w = _passing_velocity(v, x, z, load, constants.skin, constants.friction)
    force, dz = bristle_force(w, z, load, constants.friction)
    return v - w, dz, force


@compiled
def _spread(drive, constants, loads):
    """Write the normal loads of the patches."""
    spread_load(
        drive.force_n, drive.centre_x_m, drive.centre_y_m, constants.positions_m,
        constants.contact, constants.body.rest_patches, loads,
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
    shear = constants.skin.shear_stiffness_n_m * x
    return constants.normal_v_n[c] * load * (1.0 + texture) + constants.shear_v_n[c] * shear


@compiled
def rates(t, y, numbers, constants, cutoff_rad_s, loads, out):
    """Write dy/dt to ``out``.

    The states of each patch are its displacement x, the deflection z of its bristles and the
    voltage V (with a low-pass); then come position and velocity of an object. ``numbers`` are
    those of the drive.
    """
    drive = drive_at(t, numbers)
    n_channels, n_patches = constants.positions_m.shape[0], constants.patches.size
    with_object = n_patches > n_channels
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
            out[i], out[i + 1], friction = _patch_rates(v, loads[p], x, y[i + 1], constants)
            total += constants.patches[p] * friction
            i += 2
        if cutoff_rad_s > 0.0 and p < n_channels:
            out[i] = cutoff_rad_s * (_channel_volts(p, loads[p], x, position, constants) - y[i])
            i += 1
    if with_object:
        out[-2] = v
        out[-1] = (drive.load_n - FINGERS * total) / constants.body.mass_kg


@compiled
def volts_at(t, y, own, stride, numbers, constants, loads, clean_v):
    """Write the volts before the low-pass; return the position of the surface.

    ``own`` is the number of mechanical states of a patch, ``stride`` the distance in ``y`` from
    one patch to the next.
    """
    drive = drive_at(t, numbers)
    n_channels = constants.positions_m.shape[0]
    position = y[-2] if constants.patches.size > n_channels else drive.position_m
    _spread(drive, constants, loads)
    for c in range(n_channels):
        x = y[c * stride] if own else 0.0
        clean_v[c] = _channel_volts(c, loads[c], x, position, constants)
    return position
