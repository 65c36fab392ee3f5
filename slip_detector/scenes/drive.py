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

"""The integrator's inputs: what acts on the fingertip over time, and what does not change."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.parameters.fields import refuse
from slip_detector.scenes import disturbances, electronics, motion, surface
from slip_detector.scenes.disturbances import NO_SINES, TREMOR_PEAK, sines_at
from slip_detector.scenes.friction import Friction, Skin
from slip_detector.scenes.mechanics import SceneConstants

Floats = NDArray[np.float64]

NO_LOAD = np.zeros((2, 0))
NO_RIDGES = surface.RidgeNumbers(0.0, 0.0, np.zeros(0))
NO_ROUGHNESS = surface.RoughNumbers(0.0, np.zeros(0), np.zeros(0))

#: Longest step of the integrator, as a phase angle of the skin's own oscillation.
RINGING_RAD = 0.4

#: Largest number of integrator steps per second of a scene; more would take too long.
MOST_STEPS_HZ = 2e6


class DriveNumbers(NamedTuple):
    """What acts on the fingertip, for compiled code; the defaults stand for absent parts.

    ``load_sines`` are the inertial force on the object in a trembling hand; the tremor's force
    acts in full from the normal force ``force_sines_from_n`` on.
    """

    force: motion.ForceNumbers
    plate: Floats
    centre_x_m: float
    centre_y_m: float
    load: Floats = NO_LOAD
    taps: Any = disturbances.NO_TAPS
    rolling: Any = disturbances.NO_ROLLING
    force_sines: Floats = NO_SINES
    force_sines_from_n: float = 1.0
    motion_sines: Floats = NO_SINES
    load_sines: Floats = NO_SINES


def drive_numbers(
    parts: Mapping[str, Any], steps: Sequence[motion.Step], of_tremor: np.random.Generator
) -> DriveNumbers:
    """Collect what acts on the fingertip; an error names a step too short for its velocity."""
    given: dict[str, Any] = {
        name: parts[name].numbers() for name in ('taps', 'rolling') if name in parts
    }
    body: surface.FreeObject | None = parts.get('object')
    if body:
        given['load'] = motion.load_corners(body.mass_kg * surface.STANDARD_GRAVITY_M_S2, steps)
    if 'tremor' in parts:
        tremor: disturbances.Tremor = parts['tremor']
        of_force, of_motion = of_tremor.spawn(2)
        sines = tremor.sines(tremor.motion_rms_m, of_motion)
        given['force_sines'] = tremor.sines(tremor.force_rms_n, of_force)
        given['force_sines_from_n'] = TREMOR_PEAK * tremor.force_rms_n
        given['motion_sines'] = sines
        if body:
            # In the frame of the trembling hand an inertial force acts on the object.
            inertia_n = body.mass_kg * sines[0] * sines[1] ** 2
            given['load_sines'] = np.array([inertia_n, *sines[1:]])
    force, plate = (
        motion.force_numbers(parts['motion'], steps),
        motion.plate_pieces(parts['motion'], steps),
    )
    return DriveNumbers(force, plate, *parts['contact'].centre_m, **given)


class Drive(NamedTuple):
    """What acts on the fingertip at one instant or at many, in SI units.

    The velocity and position of the plate are 0 in a scene with an object, which moves by itself.
    """

    force_n: Any
    centre_x_m: Any
    centre_y_m: Any
    velocity_m_s: Any
    position_m: Any
    load_n: Any


@compiled
def normal_force_at(t, numbers):
    """Return the normal force in newtons with taps and tremor; never negative."""
    force = motion.force_at(t, numbers.force)
    if numbers.taps.times_s.size:
        force = force + disturbances.tap_force_at(t, numbers.taps)
    if numbers.force_sines.size:
        # Without contact there is no force: the tremor grows with the contact force.
        share = np.minimum(force / numbers.force_sines_from_n, 1.0)
        force = force + share * sines_at(t, numbers.force_sines)
    return np.maximum(force, 0.0)


@compiled
def drive_at(t, numbers):
    """Return what acts on the fingertip at one instant or at many."""
    none = 0.0 * t
    force = normal_force_at(t, numbers)
    x, y = none + numbers.centre_x_m, none + numbers.centre_y_m
    if numbers.rolling.repeats:
        rolled_x, rolled_y = disturbances.rolled_at(t, numbers.rolling)
        x, y = x + rolled_x, y + rolled_y
    if numbers.load.size:
        load = motion.load_at(t, numbers.load) + sines_at(t, numbers.load_sines)
        return Drive(force, x, y, none, none, load)
    velocity, position = motion.plate_at(t, numbers.plate)
    if numbers.motion_sines.size:
        velocity = velocity + disturbances.sines_rate_at(t, numbers.motion_sines)
        position = position + sines_at(t, numbers.motion_sines)
    return Drive(force, x, y, velocity, position, none)


def scene_constants(
    parts: Mapping[str, Any],
    true_rate_hz: float,
    longest_step_s: float,
    frontend: electronics.Frontend,
    of_texture: np.random.Generator,
) -> SceneConstants:
    """Build the constants of a scene; an error says that the skin oscillates too fast."""
    friction: Friction | None = parts.get('friction')
    body: surface.FreeObject | None = parts.get('object')
    bandwidth_hz = parts['electronics'].bandwidth_hz
    steps_per_sample = 1
    # Without friction and low-pass filter nothing changes between two samples.
    if friction or bandwidth_hz:
        step_s = min(longest_step_s, _ringing_step_s(parts['skin']) if friction else math.inf)
        steps_per_sample = math.ceil(1.0 / (true_rate_hz * step_s) - 1e-9)
    if steps_per_sample * true_rate_hz > MOST_STEPS_HZ:
        what = f'the scene needs {steps_per_sample * true_rate_hz:.3g} steps for a second'
        refuse(what, f'{MOST_STEPS_HZ:g}; a longer step_s, more damping_n_s_m or mass_kg 0 help')
    step_s = 1.0 / (true_rate_hz * steps_per_sample)
    patches = np.ones(PAPER_CHANNELS if friction else 0)
    cutoff_rad_s = 2.0 * np.pi * bandwidth_hz
    return SceneConstants(
        step_s=step_s,
        steps_per_sample=steps_per_sample,
        decay=math.exp(-cutoff_rad_s * step_s) if cutoff_rad_s else -1.0,
        positions_m=electronics.taxel_positions(),
        patches=np.append(patches, body.rest_patches) if body else patches,
        normal_v_n=frontend.normal_v_n,
        shear_v_n=frontend.shear_v_n,
        contact=parts['contact'].numbers(),
        skin=parts['skin'].numbers(),
        friction=(friction or Friction()).numbers(),
        ridges=parts['texture'].ridges(of_texture) if 'texture' in parts else NO_RIDGES,
        rough=parts['roughness'].profile() if 'roughness' in parts else NO_ROUGHNESS,
        body=(body or surface.FreeObject()).numbers(),
    )


def _ringing_step_s(skin: Skin) -> float:
    """Return the longest step that resolves the skin's own oscillation; infinite without one."""
    if skin.damping_n_s_m**2 >= 4.0 * skin.shear_stiffness_n_m * skin.mass_kg:
        return math.inf
    return RINGING_RAD * math.sqrt(skin.mass_kg / skin.shear_stiffness_n_m)
