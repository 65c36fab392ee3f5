"""What is done to the fingertip: the normal force, and the plate's motion or the object's load."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from slip_detector.parameter_sets import ParameterSet, parameter

Floats = NDArray[np.float64]

#: A damping ratio closer to 1 than this is taken for so far from it: the closed form of the
#: ringing divides by the difference of the two roots, which is 0 at 1.
CRITICAL = 1e-6


@dataclasses.dataclass(frozen=True)
class Step(ParameterSet):
    """One step of the protocol; forces and shares ramp to their values in the course of it."""

    duration_s: float = parameter(1.0, 'How long it takes.', unit='s', low=1e-3, high=36000.0)
    force_n: float = parameter(
        -1.0, 'Normal force at its end; negative: as before.', unit='N', low=-1.0, high=1000.0
    )
    velocity_m_s: float = parameter(
        0.0, 'Velocity of the plate along x.', unit='m/s', low=-10.0, high=10.0
    )
    carried: float = parameter(
        -1.0,
        "Share of the object's weight that the fingers carry at its end; negative: as before.",
        low=-1.0,
        high=1.0,
    )
    pull_n: float = parameter(
        0.0, 'Further force on the object along x at its end.', unit='N', low=-1e3, high=1e3
    )


@dataclasses.dataclass(frozen=True)
class Motion(ParameterSet):
    """The platform: how it speeds up, how the contact rings when it is loaded."""

    acceleration_m_s2: float = parameter(
        0.46, 'Acceleration between two velocities.', unit='m/s2', low=1e-3, high=1e6
    )
    ringing_hz: float = parameter(
        18.0,
        'Natural frequency of the fingertip against the platform.',
        unit='Hz',
        low=0.1,
        high=1e6,
    )
    ringing_damping: float = parameter(0.3, 'Its damping ratio.', low=0.01, high=10.0)


class NormalForce:
    """The normal force over time: it follows the command like a mass on a damped spring.

    The command is linear between corners, so the force is known in closed form at any instant,
    at any sample rate.

    Parameters
    ----------
    motion
        How the contact rings.
    steps
        The commands.
    """

    def __init__(self, motion: Motion, steps: list[Step]) -> None:
        omega = 2 * np.pi * motion.ringing_hz
        ratio = motion.ringing_damping
        if abs(ratio - 1.0) < CRITICAL:
            ratio = 1.0 + CRITICAL
        spread = np.sqrt(complex(ratio**2 - 1.0))
        self._roots = -omega * np.array([ratio - spread, ratio + spread])
        self._lag_s = 2 * motion.ringing_damping / omega
        # Segments: start, command and slope of it, and the ringing's two amplitudes.
        self._starts = np.array([0.0])
        self._lines = np.zeros((1, 2))
        self._ringing = np.zeros((1, 2), complex)
        time_s = force_n = 0.0
        for step in steps:
            target_n = force_n if step.force_n < 0.0 else step.force_n
            self._append(time_s, force_n, (target_n - force_n) / step.duration_s)
            time_s, force_n = time_s + step.duration_s, target_n
        self._append(time_s, force_n, 0.0)

    def hold(self, time_s: float, force_n: float) -> None:
        """Command a force from ``time_s`` on, in place of what the steps say from there."""
        first = int(np.searchsorted(self._starts, time_s, side='right'))
        self._starts = self._starts[:first]
        self._lines, self._ringing = self._lines[:first], self._ringing[:first]
        self._append(time_s, force_n, 0.0)
        if len(self._starts) > 1:  # Before the one that goes on there is nothing to ask for.
            self._starts = self._starts[-2:]
            self._lines, self._ringing = self._lines[-2:], self._ringing[-2:]

    def _append(self, start_s: float, command_n: float, slope_n_s: float) -> None:
        """Begin a segment where the last one leads."""
        at = np.array([start_s])
        k, _, modes = self._ring(at)
        rate_n_s = self._lines[k[0], 1] + float((modes * self._roots).sum().real)
        p, q = self._roots
        a = float(self._follow(at)[0]) - (command_n - slope_n_s * self._lag_s)
        b = rate_n_s - slope_n_s
        first = (b - q * a) / (p - q)
        # A step shorter than the clock's last digit takes the place of the one before.
        keep = len(self._starts) - (start_s <= self._starts[-1])
        self._starts = np.append(self._starts[:keep], start_s)
        self._lines = np.vstack([self._lines[:keep], [command_n, slope_n_s]])
        self._ringing = np.vstack([self._ringing[:keep], [first, a - first]])

    def _ring(self, time_s: Floats) -> tuple[NDArray[np.intp], Floats, NDArray[np.complex128]]:
        """Return the segment of each time, the time since its start, and its two modes."""
        k = np.maximum(np.searchsorted(self._starts, time_s, side='right') - 1, 0)
        since = time_s - self._starts[k]
        return k, since, self._ringing[k] * np.exp(np.multiply.outer(since, self._roots))

    def _follow(self, time_s: Floats) -> Floats:
        """Return the force as if the plate could pull."""
        k, since, modes = self._ring(time_s)
        command, slope = self._lines[k].T
        return np.asarray(command + slope * (since - self._lag_s) + modes.sum(axis=1).real)

    def at(self, time_s: Floats) -> Floats:
        """Return the force in newtons; never negative: a fingertip does not stick to the plate."""
        return np.asarray(np.maximum(self._follow(time_s), 0.0), dtype=np.float64)

    def corners_s(self) -> Floats:
        """Return the times at which the command has a corner."""
        return np.unique(self._starts)


class Platform:
    """Position of the plate over time.

    Parameters
    ----------
    motion
        The platform's properties.
    steps
        What it does, one after the other.
    """

    def __init__(self, motion: Motion, steps: list[Step]) -> None:
        time_s = 0.0
        corner_times, velocities = [0.0], [0.0]
        for number, step in enumerate(steps, start=1):
            if step.velocity_m_s != velocities[-1]:
                change = abs(step.velocity_m_s - velocities[-1]) / motion.acceleration_m_s2
                if change > step.duration_s:
                    raise ValueError(
                        f'steps: step {number}: duration_s {step.duration_s:g} s is too short to '
                        f'reach {step.velocity_m_s:g} m/s, allowed: at least {change:g} s at '
                        f'{motion.acceleration_m_s2:g} m/s2'
                    )
                if time_s > corner_times[-1]:
                    corner_times.append(time_s)
                    velocities.append(velocities[-1])
                # A change too small for the clock's last digit is one at once.
                corner_times.append(max(time_s + change, np.nextafter(time_s, np.inf)))
                velocities.append(step.velocity_m_s)
            time_s += step.duration_s
        # What it does last it goes on doing, for samples that round to just after the end.
        corner_times.append(max(time_s, corner_times[-1]) + 1.0)
        velocities.append(velocities[-1])
        slopes = np.diff(velocities) / np.diff(corner_times)
        self._velocity = PPoly(np.array([slopes, velocities[:-1]]), np.array(corner_times))
        self._position = self._velocity.antiderivative()
        self.largest_velocity_m_s = float(np.abs(velocities).max())
        self.moves = self.largest_velocity_m_s > 0.0

    def position_m(self, time_s: Floats) -> Floats:
        """Return how far the plate has moved along x."""
        return np.asarray(self._position(time_s), dtype=np.float64)

    def velocity_m_s(self, time_s: Floats) -> Floats:
        """Return the velocity of the plate along x."""
        return np.asarray(self._velocity(time_s), dtype=np.float64)

    def corners_s(self) -> Floats:
        """Return the times at which the velocity has a corner."""
        return np.asarray(self._velocity.x[1:-1], dtype=np.float64)


class Load:
    """What pulls on the object over time: the carried share of its weight and the further pull.

    Parameters
    ----------
    weight_n
        Of the object.
    steps
        What is done, one after the other.
    """

    def __init__(self, weight_n: float, steps: list[Step]) -> None:
        times, forces = [0.0], [0.0]
        carried = 0.0
        for step in steps:
            carried = carried if step.carried < 0.0 else step.carried
            times.append(times[-1] + step.duration_s)
            forces.append(carried * weight_n + step.pull_n)
        self._times, self._forces = np.array(times), np.array(forces)

    def at(self, time_s: Floats) -> Floats:
        """Return the force on the object along x, in newtons."""
        return np.asarray(np.interp(time_s, self._times, self._forces), dtype=np.float64)


def steps_from(entries: Any) -> list[Step]:
    """Read the steps of a scene file.

    Raises
    ------
    ValueError
        For an empty list or a step that is wrong; names the step.
    """
    if not isinstance(entries, list) or not entries:
        raise ValueError(f'steps is {entries!r}, allowed: a list of at least one step')
    steps = []
    for number, entry in enumerate(entries, start=1):
        if not isinstance(entry, dict):
            raise ValueError(f'steps: step {number} is {entry!r}, allowed: names and values')
        steps.append(Step.from_parameters(entry, f'steps: step {number}'))
    return steps
