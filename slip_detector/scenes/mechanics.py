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

"""The mechanics of the simulated fingertip, fast enough for a live driver.

The integrator is the L-stable, two-stage, singly diagonally implicit Runge-Kutta method of second
order (Alexander 1977), so that stiff bristles do not shorten its steps. The patches of skin act on
each other only through the surface that moves over them. Therefore each stage of each patch is one
equation for one velocity. An object in the grip adds an equation for its own velocity. An absent
part of a scene has empty arrays or neutral numbers in :class:`SceneConstants`.
"""

import functools
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.compiled import compiled
from slip_detector.scenes import surface
from slip_detector.scenes.friction import LIGHTEST_LOAD_N, MOST_ITERATIONS, skin_stage

#: The times of the two stages as shares of a step. The first share is also the coefficient on the
#: diagonal of the method.
STAGE_TIMES = (1.0 - np.sqrt(0.5), 1.0)
DIAGONAL = STAGE_TIMES[0]

#: Weight of the first stage's rate in the second stage, relative to the diagonal.
CARRY = (1.0 - DIAGONAL) / DIAGONAL

#: Newton's method on the object ends when an iteration changes its velocity by less than this
#: share.
OBJECT_TOLERANCE = 1e-9

#: Below this velocity of the surface against the skin a patch creeps and does not slide.
SLIDING_M_S = 1e-4

# Columns of a patch's state, and of the solution of a stage for a patch.
DISPLACEMENT, VELOCITY, DEFLECTION, RELATIVE_VELOCITY = range(4)
RELATIVE, DEFLECTED = range(2)

# The object's state.
POSITION, SPEED, LOST = range(3)


class SceneConstants(NamedTuple):
    """The integrator's inputs that do not change while a scene runs.

    ``decay`` is the factor on the low-pass filter's state in a step, negative without a filter.
    ``patches`` has an element for each channel, with friction, and with an object one more for the
    skin between the taxels. An element is the number of equal patches that it stands for.
    ``contact``, ``skin``, ``friction`` and ``body`` are the numbers of these parts.
    """

    step_s: float
    steps_per_sample: int
    decay: float
    positions_m: Floats
    patches: Floats
    normal_v_n: Floats
    shear_v_n: Floats
    contact: Any
    skin: Any
    friction: Any
    ridges: surface.RidgeNumbers
    rough: surface.RoughNumbers
    body: Any


class State(NamedTuple):
    """The state of a scene between two steps.

    ``patches`` has the displacement and velocity of the skin, the deflection of the bristles and
    the velocity of the surface against the skin; ``body`` the position and velocity of the object,
    and whether it is lost; ``before`` the load, the displacement of the skin and the position of
    the surface relative to it at the end of the last step, for each channel.
    """

    patches: Floats
    body: Floats
    smoothed_v: Floats
    before: Floats


# Inlined, as a call that passes its many inputs one by one takes a fifth more time.
@functools.partial(compiled, forceinline=True)
def _find_stage(v, step, loads, base, patches, found, constants):
    """Advance all patches by one implicit step under a surface of velocity v.

    Returns the sum of the forces of all patches on the surface, and its slope in v.
    """
    total, slope = 0.0, 0.0
    for p in range(loads.size):
        found[p, RELATIVE], force, stiffness, found[p, DEFLECTED] = skin_stage(
            v, base[p, DISPLACEMENT], base[p, VELOCITY], base[p, DEFLECTION],
            patches[p, RELATIVE_VELOCITY], loads[p], step, constants.skin, constants.friction,
        )  # fmt: skip
        total += constants.patches[p] * force
        slope += constants.patches[p] * stiffness
    return total, slope


@compiled
def _find_object(v_last, v_base, load_n, step, loads, base, patches, found, constants):
    """Return the velocity v of the object at the end of an implicit step.

    M (v - v_base) / step + friction of both fingers (v) = load, whose left side rises with v.
    """
    inertia = constants.body.mass_kg / step
    low, high = -np.inf, np.inf
    v = v_last
    for _ in range(MOST_ITERATIONS):
        force, slope = _find_stage(v, step, loads, base, patches, found, constants)
        balance = load_n - surface.FINGERS * force - inertia * (v - v_base)
        if balance > 0.0:
            low = v
        elif balance < 0.0:
            high = v
        else:
            break
        change = balance / (inertia + surface.FINGERS * slope)
        following = v + change
        if not low < following < high:
            following = 0.5 * (low + high) if high - low < np.inf else v + 2.0 * change
        done = abs(following - v) <= OBJECT_TOLERANCE * abs(v) + 1e-18
        v = following
        if done:
            break
    return v


@compiled
def _step(i, drive, state, constants, loads, base, found):
    """Take one step of skin and object; ``loads`` are set to those at its end."""
    patches, body = state.patches, state.body
    diagonal_s = DIAGONAL * constants.step_s
    with_object = constants.patches.size > constants.positions_m.shape[0]
    surface_v = 0.0
    for stage in range(2):
        force = 0.0 if body[LOST] else drive.force_n[i, stage]
        surface.spread_load(
            force, drive.centre_x_m[i, stage], drive.centre_y_m[i, stage], constants.positions_m,
            constants.contact, constants.body.rest_patches, loads,
        )  # fmt: skip
        if stage == 0:
            base[:, :] = patches[:, :3]
            v_base, s_base = body[SPEED], body[POSITION]
        else:
            for p in range(patches.shape[0]):
                base[p, DISPLACEMENT] += CARRY * diagonal_s * patches[p, VELOCITY]
                base[p, VELOCITY] += CARRY * (patches[p, VELOCITY] - base[p, VELOCITY])
                base[p, DEFLECTION] += CARRY * (patches[p, DEFLECTION] - base[p, DEFLECTION])
            v_base += CARRY * (surface_v - v_base)
            s_base += CARRY * diagonal_s * surface_v
        if with_object and not body[LOST]:
            surface_v = _find_object(
                body[SPEED], v_base, drive.load_n[i, stage], diagonal_s, loads, base, patches,
                found, constants,
            )  # fmt: skip
            body[SPEED] = surface_v
            body[POSITION] = s_base + diagonal_s * surface_v
        else:
            surface_v = drive.velocity_m_s[i, stage]
            _find_stage(surface_v, diagonal_s, loads, base, patches, found, constants)
        for p in range(patches.shape[0]):
            patches[p, VELOCITY] = surface_v - found[p, RELATIVE]
            patches[p, DISPLACEMENT] = base[p, DISPLACEMENT] + diagonal_s * patches[p, VELOCITY]
            patches[p, DEFLECTION] = found[p, DEFLECTED]
            patches[p, RELATIVE_VELOCITY] = found[p, RELATIVE]
    if with_object and body[POSITION] > constants.body.length_m:
        body[LOST] = 1.0
        body[SPEED] = 0.0


@compiled
def _sense(state, loads, position, constants, smooth, out):
    """Read all channels at the end of a step, without their baselines.

    With a low-pass filter a channel reads the filtered mean voltage of the step, else the present
    voltage.
    """
    with_skin = state.patches.shape[0] > 0
    for c in range(constants.positions_m.shape[0]):
        displacement = state.patches[c, DISPLACEMENT] if with_skin else 0.0
        place = position - displacement + constants.positions_m[c, 0]
        before = state.before[c]
        if not smooth:
            before[0], before[1], before[2] = loads[c], displacement, place
        load = 0.5 * (before[0] + loads[c])
        texture = 0.0
        if load > 0.0 and constants.ridges.amplitudes.size:
            texture += surface.ridges_between(before[2], place, constants.ridges)
        if load > 0.0 and constants.rough.heights.size:
            texture += surface.roughness_between(before[2], place, constants.rough)
        shear = constants.skin.shear_stiffness_n_m * 0.5 * (before[1] + displacement)
        value = constants.normal_v_n[c] * load * (1.0 + texture) + constants.shear_v_n[c] * shear
        if smooth:
            value += constants.decay * (state.smoothed_v[c] - value)
        state.smoothed_v[c] = value
        before[0], before[1], before[2] = loads[c], displacement, place
        out[c] = value


@compiled
def _sliding_share(state, loads, constants):
    """Return the share of the normal load under which the surface slides over the skin."""
    total, sliding = 0.0, 0.0
    for p in range(constants.patches.size):
        load = constants.patches[p] * loads[p]
        total += load
        sliding += load if abs(state.patches[p, RELATIVE_VELOCITY]) > SLIDING_M_S else 0.0
    return sliding / total if total > LIGHTEST_LOAD_N else 0.0


@compiled
def advance(drive, state, constants, begin, clean_v, position_m, sliding):
    """Advance a scene by some samples, and change its state in place.

    The fields of the drive have the shape (m, 2), with the values at the two stages
    (:data:`STAGE_TIMES`) of each step. Each sample has ``steps_per_sample`` steps. With ``begin``
    the first sample is the first of the scene, which is taken before any step; the first row of
    the drive is for this sample.

    Outputs are ``clean_v``, shape (n, channels), the volts without baselines and noise, and
    ``position_m`` and ``sliding``, shape (n,), the position of plate or object and the share of
    the load under which the surface slides.
    """
    n_patches = constants.patches.size
    loads = np.zeros(max(n_patches, constants.positions_m.shape[0]))
    base, found = np.zeros((n_patches, 3)), np.zeros((n_patches, 2))
    with_object = constants.patches.size > constants.positions_m.shape[0]
    smooth = constants.decay >= 0.0
    i = 0
    for k in range(clean_v.shape[0]):
        start = begin and k == 0
        steps = 1 if start else constants.steps_per_sample
        for j in range(steps):
            if n_patches and not start:
                _step(i, drive, state, constants, loads, base, found)
            last = j == steps - 1
            if smooth or last:
                if not n_patches or start:
                    surface.spread_load(
                        drive.force_n[i, 1], drive.centre_x_m[i, 1], drive.centre_y_m[i, 1],
                        constants.positions_m, constants.contact, constants.body.rest_patches,
                        loads,
                    )  # fmt: skip
                position = state.body[POSITION] if with_object else drive.position_m[i, 1]
                _sense(state, loads, position, constants, smooth and not start, clean_v[k])
                if last:
                    position_m[k] = position
                    sliding[k] = _sliding_share(state, loads, constants) if n_patches else 0.0
            i += 1
