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

"""The drive of a scene: forces and motion of all parts together, at one instant or at many.

The same compiled function serves a scene, which calls it for all instants of a read at once, and
an integrator that calls it for one instant after another.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.disturbances import (
    NO_SINES,
    TREMOR_PEAK,
    HandMotion,
    TapNumbers,
    Taps,
    Tremor,
    sines_at,
    sines_rate_at,
    tap_force_at,
)
from slip_detector.scenes.free_object import STANDARD_GRAVITY_M_S2, FreeObject
from slip_detector.scenes.motion import (
    ForceNumbers,
    Motion,
    Step,
    force_at,
    force_numbers,
    load_at,
    load_numbers,
    plate_at,
    plate_numbers,
)
from slip_detector.scenes.rolling import Rolling, rolled_at

Floats = NDArray[np.float64]

NO_TAPS = TapNumbers(np.zeros(0), 0.0, 1.0)
NO_ROLLING = np.zeros(0)
NO_LOAD = np.zeros((2, 0))


class DriveNumbers(NamedTuple):
    """What acts on the fingertip, for compiled code; the defaults stand for absent parts.

    Attributes
    ----------
    force : ForceNumbers
        The normal force of the steps.
    plate : ndarray, shape (4, k)
        The plate's motion; its rows are the fields of
        :class:`slip_detector.scenes.motion.PlateNumbers`.
    centre_x_m, centre_y_m : float
        Centre of the contact at rest.
    load : ndarray, shape (2, k)
        Force on the object; its rows are the fields of
        :class:`slip_detector.scenes.motion.LoadNumbers`.
    taps : TapNumbers
        The numbers of the taps.
    rolling : ndarray, shape (6,)
        The fields of :class:`slip_detector.scenes.rolling.RollingNumbers`.
    force_sines, motion_sines : ndarray, shape (3, k)
        The tremor, in newtons and, on a plate, metres; the rows are the fields of
        :class:`slip_detector.scenes.disturbances.Sines`.
    force_sines_from_n : float
        Normal force from which on the tremor's force acts in full.
    load_sines : ndarray, shape (3, k)
        Inertial force on the object in a trembling hand, in newtons.
    """

    force: ForceNumbers
    plate: Floats
    centre_x_m: float
    centre_y_m: float
    load: Floats = NO_LOAD
    taps: TapNumbers = NO_TAPS
    rolling: Floats = NO_ROLLING
    force_sines: Floats = np.array(NO_SINES)
    force_sines_from_n: float = 1.0
    motion_sines: Floats = np.array(NO_SINES)
    load_sines: Floats = np.array(NO_SINES)


def drive_numbers(
    parts: Mapping[str, Any], steps: Sequence[Step], of_tremor: np.random.Generator
) -> DriveNumbers:
    """Collect what acts on the fingertip.

    Parameters
    ----------
    parts
        The parts of the scene by their names.
    steps
        The steps of the scene.
    of_tremor
        Generator of the tremor in this trial.

    Raises
    ------
    ValueError
        When a step is too short for its velocity; names the step.

    Examples
    --------
    >>> steps = [Step(1.0, force_n=0.4), Step(1.0, velocity_m_s=0.01)]
    >>> drive_numbers({}, steps, np.random.default_rng(0)).force.starts_s
    array([0., 1., 2.])
    """
    motion: Motion = parts.get('motion', Motion())
    contact: Contact = parts.get('contact', Contact())
    taps: Taps | None = parts.get('taps')
    rolling: Rolling | None = parts.get('rolling')
    free_object: FreeObject | None = parts.get('object')
    tremor: Tremor | None = parts.get('tremor')
    numbers = DriveNumbers(
        force_numbers(motion, steps), np.array(plate_numbers(motion, steps)), *contact.centre_m
    )
    if taps:
        numbers = numbers._replace(taps=taps.numbers())
    if rolling:
        numbers = numbers._replace(rolling=np.array(rolling.numbers()))
    if free_object:
        load = load_numbers(free_object.mass_kg * STANDARD_GRAVITY_M_S2, steps)
        numbers = numbers._replace(load=np.array(load))
    if tremor:
        hand = HandMotion(tremor, of_tremor)
        sines = hand.motion_sines
        numbers = numbers._replace(
            force_sines=np.array(hand.force_sines),
            force_sines_from_n=TREMOR_PEAK * tremor.force_rms_n,
            motion_sines=np.array(sines),
        )
        if free_object:
            # In the frame of the trembling hand an inertial force acts on the object.
            inertia_n = free_object.mass_kg * sines.amplitude * sines.angular_rate_rad_s**2
            numbers = numbers._replace(load_sines=np.array(sines._replace(amplitude=inertia_n)))
    return numbers


class Drive(NamedTuple):
    """What acts on the fingertip at some instants.

    Each field is a float, or an array with the shape of the instants.

    Attributes
    ----------
    force_n
        Normal force.
    centre_x_m, centre_y_m
        Centre of the contact.
    velocity_m_s, position_m
        Velocity and position of the plate; 0 in a scene with an object, which moves by itself.
    load_n
        Force on the object; 0 without an object.
    """

    force_n: Any
    centre_x_m: Any
    centre_y_m: Any
    velocity_m_s: Any
    position_m: Any
    load_n: Any


@compiled
def normal_force_at(t, side, numbers):
    """Return the normal force with taps and tremor; never negative.

    Parameters and return value as those of :func:`drive_at`; in newtons.
    """
    force = force_at(t, side, numbers.force)
    if numbers.taps.begins_s.size:
        force = force + tap_force_at(t, side, numbers.taps)
    if numbers.force_sines.size:
        # Without contact there is no force: the tremor grows with the contact force.
        share = np.minimum(force / numbers.force_sines_from_n, 1.0)
        force = force + share * sines_at(t, numbers.force_sines)
    return np.maximum(force, 0.0)


@compiled
def drive_at(t, side, numbers):
    """Return what acts on the fingertip at one instant or at many.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    side : as ``t``
        Selects the piece at a corner, where two smooth pieces meet: a time within the wanted
        piece. Elsewhere the instant itself.
    numbers : DriveNumbers
        The numbers of the scene.

    Returns
    -------
    Drive
        Its fields have the shape of ``t``.
    """
    none = 0.0 * t
    force = normal_force_at(t, side, numbers)
    x, y = none + numbers.centre_x_m, none + numbers.centre_y_m
    if numbers.rolling.size:
        rolled_x, rolled_y = rolled_at(t, numbers.rolling)
        x, y = x + rolled_x, y + rolled_y
    if numbers.load.size:
        load = load_at(t, numbers.load) + sines_at(t, numbers.load_sines)
        return Drive(force, x, y, none, none, load)
    velocity, position = plate_at(t, side, numbers.plate)
    if numbers.motion_sines.size:
        velocity = velocity + sines_rate_at(t, numbers.motion_sines)
        position = position + sines_at(t, numbers.motion_sines)
    return Drive(force, x, y, velocity, position, none)
