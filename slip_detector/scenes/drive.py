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

"""What acts on the fingertip over time."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.compiled import compiled
from slip_detector.scenes import disturbances, motion, surface
from slip_detector.scenes.disturbances import NO_SINES, TREMOR_PEAK, sines_at


class DriveNumbers(NamedTuple):
    """What acts on the fingertip, for compiled code; the defaults stand for absent parts.

    ``load_sines`` are the inertial force on the object in a trembling hand; the tremor's force
    acts in full from the normal force ``force_sines_from_n`` on.
    """

    force: motion.ForceNumbers
    plate: Floats
    load: Floats = np.zeros((2, 0))
    taps: Any = disturbances.Taps().numbers()
    rolling: Any = disturbances.Rolling().numbers()._replace(repeats=0)
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
    platform = parts['motion']
    force, plate = motion.force_numbers(platform, steps), motion.plate_pieces(platform, steps)
    return DriveNumbers(force, plate, **given)


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
    # A fingertip does not stick to the plate.
    force = np.maximum(motion.force_at(t, numbers.force), 0.0)
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
    x = y = none
    if numbers.rolling.repeats:
        x, y = disturbances.rolled_at(t, numbers.rolling)
    if numbers.load.size:
        load = np.interp(t, numbers.load[0], numbers.load[1])
        return Drive(force, x, y, none, none, load + sines_at(t, numbers.load_sines))
    velocity, position = motion.plate_at(t, numbers.plate)
    if numbers.motion_sines.size:
        velocity = velocity + disturbances.sines_rate_at(t, numbers.motion_sines)
        position = position + sines_at(t, numbers.motion_sines)
    return Drive(force, x, y, velocity, position, none)
