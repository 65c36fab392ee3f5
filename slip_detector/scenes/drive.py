"""What is done to the fingertip, all parts together, at one instant or at many.

One compiled function serves the live scene, which asks for all the instants of a read at once,
and SciPy's integrators, which ask for one after the other.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.scenes.disturbances import (
    TapNumbers,
    lines_at,
    lines_rate_at,
    rolled_at,
    tap_force_at,
)
from slip_detector.scenes.motion import (
    ForceNumbers,
    force_at,
    load_at,
    plate_at,
)

Floats = NDArray[np.float64]

NO_LINES = np.zeros((3, 0))
NO_TAPS = TapNumbers(np.zeros(0), 0.0, 1.0)
NO_ROLLING = np.zeros(0)
NO_LOAD = np.zeros((2, 0))


class DriveNumbers(NamedTuple):
    """What is done to the fingertip, for compiled code; the defaults are parts left out.

    Attributes
    ----------
    force : ForceNumbers
        The normal force that the steps ask for.
    plate : ndarray, shape (4, k)
        The plate's motion; rows as the fields of
        :class:`slip_detector.scenes.motion.PlateNumbers`.
    centre_x_m, centre_y_m : float
        Where the contact is at rest.
    load : ndarray, shape (2, k)
        Force on the object; rows as the fields of
        :class:`slip_detector.scenes.motion.LoadNumbers`.
    taps : TapNumbers
        Of this part.
    rolling : ndarray, shape (6,)
        The fields of :class:`slip_detector.scenes.disturbances.RollingNumbers`.
    force_lines, motion_lines : ndarray, shape (3, k)
        The tremor's lines, in newtons and, on a plate, metres; rows as the fields of
        :class:`slip_detector.scenes.disturbances.Lines`.
    force_lines_from_n : float
        The normal force from which on all of the tremor's force is there.
    load_lines : ndarray, shape (3, k)
        Inertia of the object in a hand that trembles, in newtons.
    """

    force: ForceNumbers
    plate: Floats
    centre_x_m: float
    centre_y_m: float
    load: Floats = NO_LOAD
    taps: TapNumbers = NO_TAPS
    rolling: Floats = NO_ROLLING
    force_lines: Floats = NO_LINES
    force_lines_from_n: float = 1.0
    motion_lines: Floats = NO_LINES
    load_lines: Floats = NO_LINES


class Drive(NamedTuple):
    """What is done to the fingertip at some instants.

    Each is a float, or an array of the shape of the instants.

    Attributes
    ----------
    force_n
        Normal force.
    centre_x_m, centre_y_m
        Centre of the contact.
    velocity_m_s, position_m
        Of the surface; 0 where an object finds its own way.
    load_n
        Force on the object; 0 where there is none.
    """

    force_n: Any
    centre_x_m: Any
    centre_y_m: Any
    velocity_m_s: Any
    position_m: Any
    load_n: Any


@compiled
def normal_force_at(t, side, numbers):
    """Return the normal force with what taps and tremor do to it; never negative."""
    force = force_at(t, side, numbers.force)
    if numbers.taps.begins_s.size:
        force = force + tap_force_at(t, side, numbers.taps)
    if numbers.force_lines.size:
        # A hand that does not touch does not press; its tremor comes in with the contact.
        share = np.minimum(force / numbers.force_lines_from_n, 1.0)
        force = force + share * lines_at(t, numbers.force_lines)
    return np.maximum(force, 0.0)


@compiled
def drive_at(t, side, numbers):
    """Return what is done to the fingertip at one instant or at many.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants.
    side : as ``t``
        Times within the same smooth piece: at a corner they say which side is meant.
    numbers : DriveNumbers
        Of the scene.

    Returns
    -------
    Drive
    """
    none = 0.0 * t
    force = normal_force_at(t, side, numbers)
    x, y = none + numbers.centre_x_m, none + numbers.centre_y_m
    if numbers.rolling.size:
        rolled_x, rolled_y = rolled_at(t, numbers.rolling)
        x, y = x + rolled_x, y + rolled_y
    if numbers.load.size:
        load = load_at(t, numbers.load) + lines_at(t, numbers.load_lines)
        return Drive(force, x, y, none, none, load)
    velocity, position = plate_at(t, side, numbers.plate)
    if numbers.motion_lines.size:
        velocity = velocity + lines_rate_at(t, numbers.motion_lines)
        position = position + lines_at(t, numbers.motion_lines)
    return Drive(force, x, y, velocity, position, none)
