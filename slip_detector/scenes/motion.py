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

"""The steps of a scene, and the forces and motions that follow from them.

The normal force, the motion of the plate and the load on an object have a closed form in pieces.
Disturbances are added.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Floats
from slip_detector.compiled import compiled
from slip_detector.parameters import ParameterSet, parameter, quote, refuse
from slip_detector.scenes import disturbances, surface
from slip_detector.scenes.disturbances import NO_SINES, TREMOR_PEAK, sines_at


class Step(ParameterSet):
    """One step of a scene; forces and shares change linearly to reach their values at its end."""

    duration_s: float = parameter(1.0, 'Duration of the step.', (1e-3, 36000.0, 's'))
    force_n: float = parameter(
        -1.0, 'Normal force at the end of the step; negative: as before.', (-1.0, 1000.0, 'N')
    )
    velocity_m_s: float = parameter(0.0, 'Velocity of the plate along x.', (-10.0, 10.0, 'm/s'))
    carried: float = parameter(
        -1.0, "Share of the object's weight carried at its end; negative: as before.", (-1.0, 1.0)
    )
    pull_n: float = parameter(
        0.0, 'Further force on the object along x at the end of the step.', (-1e3, 1e3, 'N')
    )


def read_steps(entries: Any) -> list[Step]:
    """Return the steps in the list under ``steps`` of a scene file."""
    if not (isinstance(entries, list) and entries and all(isinstance(e, dict) for e in entries)):
        refuse(f'steps is {quote(entries)}', 'a list of at least one step, each names and values')
    return [Step.from_parameters(entry, f'steps: step {k}') for k, entry in enumerate(entries, 1)]


#: Smallest distance of a damping ratio from 1, where the closed form of the ringing divides by 0.
#: A closer ratio is replaced by 1 plus this distance.
LEAST_FROM_CRITICAL = 1e-6


class Orders(ParameterSet):
    """What the fingertip does when an order comes, in place of the steps."""

    force_n: float = parameter(0.4, 'Normal force, but when it is pressed.', (0.0, 1000.0, 'N'))
    velocity_m_s: float = parameter(
        8e-3, 'Velocity of the plate as it slips.', (-10.0, 10.0, 'm/s')
    )
    tapped_every_s: float = parameter(1.5, 'Time from tap to tap.', (0.01, 3600.0, 's'))
    pressed_n: tuple[float, ...] = parameter(
        (1.0, 2.5, 0.6, 0.0),
        'Normal forces as it is pressed, in turn: each is reached in 0.3 s and held for 1 s.',
        (0.0, 1000.0, 'N'),
    )

    def steps(self, what: str) -> Iterator[Step]:
        """Return the steps of an order; those of ``press`` have no end."""
        if what != 'press':
            return iter([Step(duration_s=0.3, force_n=self.force_n)])
        turns = [(Step(duration_s=0.3, force_n=n), Step(duration_s=1.0)) for n in self.pressed_n]
        return itertools.cycle(itertools.chain.from_iterable(turns))


#: The orders that a fingertip with the part ``orders`` takes, and how long one lasts at most. That
#: is longer than the longest recording of the live page.
ORDERS, ORDER_S = ('rest', 'slip', 'taps', 'press'), 660.0


class Motion(ParameterSet):
    """The platform: its acceleration, and the ringing of the contact after a change of load."""

    acceleration_m_s2: float = parameter(
        0.46, 'Acceleration between two velocities.', (1e-3, 1e6, 'm/s2')
    )
    ringing_hz: float = parameter(
        18.0, 'Natural frequency of the fingertip against the platform.', (0.1, 1e6, 'Hz')
    )
    ringing_damping: float = parameter(0.3, 'Damping ratio of that oscillation.', (0.01, 10.0))


@compiled
def _piece_at(t, starts_s):
    """Return the index of the piece at one instant or at many; before the first piece it is 0."""
    return np.maximum(np.searchsorted(starts_s, t, side='right') - 1, 0)


class ForceNumbers(NamedTuple):
    """The normal force in k pieces, for compiled code.

    For each piece: when it begins, the command and its slope there, and the amplitudes of the two
    modes of ringing, shape (k, 2). ``roots_1_s`` are the roots of the modes. The force is
    ``lag_s`` behind a ramp.
    """

    starts_s: Floats
    command_n: Floats
    slope_n_s: Floats
    ringing: NDArray[np.complex128]
    roots_1_s: NDArray[np.complex128]
    lag_s: float


@compiled
def force_at(t, numbers):
    """Return the force in newtons, negative where the plate would have to pull the fingertip."""
    k = _piece_at(t, numbers.starts_s)
    since = t - numbers.starts_s[k]
    force = numbers.command_n[k] + numbers.slope_n_s[k] * (since - numbers.lag_s)
    for mode in range(2):
        force = force + (numbers.ringing[k, mode] * np.exp(since * numbers.roots_1_s[mode])).real
    return force


def force_numbers(motion: Motion, steps: Sequence[Step]) -> ForceNumbers:
    """Return the normal force, which follows the command like a mass on a damped spring."""
    omega = 2 * np.pi * motion.ringing_hz
    ratio = motion.ringing_damping
    if abs(ratio - 1.0) < LEAST_FROM_CRITICAL:
        ratio = 1.0 + LEAST_FROM_CRITICAL
    spread = np.sqrt(complex(ratio**2 - 1.0))
    none = np.zeros(1)
    roots_1_s = np.array([-omega * (ratio - spread), -omega * (ratio + spread)], complex)
    lag_s = 2 * motion.ringing_damping / omega
    numbers = ForceNumbers(none, none, none, np.zeros((1, 2), complex), roots_1_s, lag_s)
    return with_steps(numbers, 0.0, 0.0, steps)


def with_steps(
    numbers: ForceNumbers, time_s: float, force_n: float, steps: Sequence[Step]
) -> ForceNumbers:
    """Return the force with the command ``force_n`` at ``time_s`` and then that of steps."""
    for step in steps:
        target_n = force_n if step.force_n < 0.0 else step.force_n
        numbers = _with_piece(numbers, time_s, force_n, (target_n - force_n) / step.duration_s)
        time_s, force_n = time_s + step.duration_s, target_n
    return _with_piece(numbers, time_s, force_n, 0.0)


def held_force(numbers: ForceNumbers, time_s: float, force_n: float) -> ForceNumbers:
    """Return the force with the command ``force_n`` from ``time_s`` on."""
    held = _with_piece(numbers, time_s, force_n, 0.0)
    return ForceNumbers._make([*(column[-2:] for column in held[:4]), *held[4:]])


def _with_piece(
    numbers: ForceNumbers, start_s: float, command_n: float, slope_n_s: float
) -> ForceNumbers:
    """Return the force with one more piece, which continues the one before its start."""
    p, q = roots = numbers.roots_1_s
    k = _piece_at(start_s, numbers.starts_s)
    modes = numbers.ringing[k] * np.exp((start_s - numbers.starts_s[k]) * roots)
    rate_n_s = numbers.slope_n_s[k] + float((modes * roots).sum().real)
    force_n = float(force_at(start_s, numbers))
    a = force_n - (command_n - slope_n_s * numbers.lag_s)
    first = (rate_n_s - slope_n_s - q * a) / (p - q)
    # No two pieces begin at the same time: a step shorter than the resolution of time is lost.
    kept = slice(k + (start_s > numbers.starts_s[k]))
    new = (start_s, command_n, slope_n_s, [first, a - first])
    pieces = (np.append(b[kept], [n], axis=0) for b, n in zip(numbers[:4], new, strict=True))
    return ForceNumbers._make([*pieces, *numbers[4:]])


@compiled
def plate_at(t, plate):
    """Return velocity and position of the plate along x, at one instant or at many."""
    starts_s, acceleration, velocity, position = plate[0], plate[1], plate[2], plate[3]
    k = _piece_at(t, starts_s)
    since = t - starts_s[k]
    gained = acceleration[k] * since
    return velocity[k] + gained, position[k] + (velocity[k] + 0.5 * gained) * since


def plate_pieces(motion: Motion, steps: Sequence[Step]) -> Floats:
    """Return the motion of the plate in k pieces of constant acceleration, shape (4, k).

    The rows are when each piece begins, and acceleration, velocity and position there.
    """
    plate, time_s, last_m_s = np.zeros((4, 1)), 0.0, 0.0
    for number, step in enumerate(steps, start=1):
        if step.velocity_m_s != last_m_s:
            change_s = abs(step.velocity_m_s - last_m_s) / motion.acceleration_m_s2
            if change_s > step.duration_s:
                too_short = f'duration_s {step.duration_s:g} s is too short to reach the velocity'
                refuse(f'steps: step {number}: {too_short}', f'at least {change_s:g} s')
            plate = with_velocity(plate, time_s, step.velocity_m_s, motion)
            last_m_s = step.velocity_m_s
        time_s += step.duration_s
    return plate


def with_velocity(plate: Floats, time_s: float, velocity_m_s: float, motion: Motion) -> Floats:
    """Return the motion of the plate with another velocity, from a time on, for ever."""
    before_m_s, position_m = plate_at(time_s, plate)
    change_s = abs(velocity_m_s - before_m_s) / motion.acceleration_m_s2
    # An instantaneous change takes the resolution of time, as no two pieces begin at one time.
    reached_s = max(time_s + change_s, np.nextafter(time_s, np.inf))
    way_m = (reached_s - time_s) * (before_m_s + velocity_m_s) / 2
    acceleration = (velocity_m_s - before_m_s) / (reached_s - time_s)
    begins = [time_s, acceleration, before_m_s, position_m]
    after = [reached_s, 0.0, velocity_m_s, position_m + way_m]
    # In C order, as all plates: for another order of memory the scene would be compiled again.
    return np.ascontiguousarray(np.column_stack([plate[:, plate[0] < time_s], begins, after]))


def load_corners(weight_n: float, steps: Sequence[Step]) -> Floats:
    """Return times and values of the load on the object, which is linear between them; (2, k).

    The load is the carried share of the object's weight plus the pull of the steps.
    """
    carried, corners = 0.0, [(0.0, 0.0)]
    for step in steps:
        carried = carried if step.carried < 0.0 else step.carried
        corners.append((corners[-1][0] + step.duration_s, carried * weight_n + step.pull_n))
    return np.array([*zip(*corners, strict=True)])


class DriveNumbers(NamedTuple):
    """What acts on the fingertip, for compiled code; the defaults stand for absent parts.

    ``load_sines`` are the inertial force on the object in a trembling hand. The force of the
    tremor acts in full from the normal force ``force_sines_from_n`` on.
    """

    force: ForceNumbers
    plate: Floats
    load: Floats = np.zeros((2, 0))
    taps: Any = disturbances.Taps().numbers()
    rolling: Any = disturbances.Rolling().numbers()._replace(repeats=0)
    force_sines: Floats = NO_SINES
    force_sines_from_n: float = 1.0
    motion_sines: Floats = NO_SINES
    load_sines: Floats = NO_SINES


def drive_numbers(
    parts: Mapping[str, Any], steps: Sequence[Step], tremor_trial: np.random.Generator
) -> DriveNumbers:
    """Return what acts on the fingertip."""
    numbers: dict[str, Any] = {
        name: parts[name].numbers() for name in ('taps', 'rolling') if name in parts
    }
    body: surface.FreeObject | None = parts.get('object')
    if body:
        numbers['load'] = load_corners(body.mass_kg * surface.STANDARD_GRAVITY_M_S2, steps)
    if 'tremor' in parts:
        tremor: disturbances.Tremor = parts['tremor']
        force_trial, motion_trial = tremor_trial.spawn(2)
        sines = tremor.sines(tremor.motion_rms_m, motion_trial)
        numbers['force_sines'] = tremor.sines(tremor.force_rms_n, force_trial)
        numbers['force_sines_from_n'] = TREMOR_PEAK * tremor.force_rms_n
        numbers['motion_sines'] = sines
        if body:
            # In the frame of the trembling hand an inertial force acts on the object.
            inertia_n = body.mass_kg * sines[0] * sines[1] ** 2
            numbers['load_sines'] = np.array([inertia_n, *sines[1:]])
    platform = parts['motion']
    force, plate = force_numbers(platform, steps), plate_pieces(platform, steps)
    return DriveNumbers(force, plate, **numbers)


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
    # The plate cannot pull the fingertip.
    force = np.maximum(force_at(t, numbers.force), 0.0)
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
    velocity, position = plate_at(t, numbers.plate)
    if numbers.motion_sines.size:
        velocity = velocity + disturbances.sines_rate_at(t, numbers.motion_sines)
        position = position + sines_at(t, numbers.motion_sines)
    return Drive(force, x, y, velocity, position, none)
