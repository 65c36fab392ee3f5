"""Prescribed motion: the platform that presses a plate to the fingertip and moves it along."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import PPoly

from slip_detector.config import ParameterSet, parameter

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Step(ParameterSet):
    """One step of the protocol; the normal force ramps to ``force_n`` in the course of it."""

    duration_s: float = parameter(1.0, 'How long it takes.', unit='s', low=1e-3, high=3600.0)
    force_n: float = parameter(
        -1.0, 'Normal force at its end; negative: as before.', unit='N', low=-1.0, high=1000.0
    )
    velocity_m_s: float = parameter(
        0.0, 'Velocity of the plate along x.', unit='m/s', low=-10.0, high=10.0
    )


@dataclasses.dataclass(frozen=True)
class Motion(ParameterSet):
    """The platform: its steps, how it speeds up, how the contact rings when it is loaded."""

    acceleration_m_s2: float = parameter(
        0.5, 'Acceleration between two velocities.', unit='m/s2', low=1e-3, high=1e6
    )
    ringing_hz: float = parameter(
        18.0,
        'Natural frequency of the fingertip against the platform.',
        unit='Hz',
        low=0.1,
        high=1e6,
    )
    ringing_damping: float = parameter(0.3, 'Its damping ratio.', low=0.01, high=10.0)


class Platform:
    """Normal force and position of the plate over time.

    Parameters
    ----------
    motion
        The platform's properties.
    steps
        What it does, one after the other.
    sample_rate_hz
        Rate of :meth:`force_n`.
    """

    def __init__(self, motion: Motion, steps: list[Step], sample_rate_hz: float) -> None:
        times, forces = [0.0], [0.0]
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
                if times[-1] > corner_times[-1]:
                    corner_times.append(times[-1])
                    velocities.append(velocities[-1])
                # A change too small for the clock's last digit is one at once.
                corner_times.append(max(times[-1] + change, np.nextafter(times[-1], np.inf)))
                velocities.append(step.velocity_m_s)
            times.append(times[-1] + step.duration_s)
            forces.append(forces[-1] if step.force_n < 0.0 else step.force_n)
        self.duration_s = times[-1]
        # What it does last it goes on doing, for samples that round to just after the end.
        corner_times.append(max(self.duration_s, corner_times[-1]) + 1.0)
        velocities.append(velocities[-1])
        self._times, self._forces = np.array(times), np.array(forces)
        slopes = np.diff(velocities) / np.diff(corner_times)
        self._velocity = PPoly(np.array([slopes, velocities[:-1]]), np.array(corner_times))
        self._position = self._velocity.antiderivative()
        # The load follows the command like a mass on a damped spring: it rings at each corner.
        omega = 2 * np.pi * motion.ringing_hz
        self._ringing = signal.bilinear(
            [omega**2], [1.0, 2 * motion.ringing_damping * omega, omega**2], sample_rate_hz
        )
        self._ringing_state = np.zeros(2)

    def force_n(self, time_s: Floats) -> Floats:
        """Return the normal force; call it with consecutive samples, it carries the ringing on.

        Never negative: a fingertip does not stick to the plate.
        """
        if not len(time_s):  # of which lfilter makes an undefined state
            return np.empty(0)
        command = np.interp(time_s, self._times, self._forces)
        force, self._ringing_state = signal.lfilter(
            *self._ringing, command, zi=self._ringing_state
        )
        return np.asarray(np.maximum(force, 0.0), dtype=np.float64)

    def position_m(self, time_s: Floats) -> Floats:
        """Return how far the plate has moved along x."""
        return np.asarray(self._position(time_s), dtype=np.float64)

    def velocity_m_s(self, time_s: Floats) -> Floats:
        """Return the velocity of the plate along x."""
        return np.asarray(self._velocity(time_s), dtype=np.float64)


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
