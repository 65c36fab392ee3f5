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

"""Disturbances of a grip: hum, tremor, taps and rolling."""

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.compiled import CompiledSet, compiled
from slip_detector.parameters import ParameterSet, parameter

#: A sum of no sines. A sum of k sines has the shape (3, k), with rows of amplitudes in the unit of
#: the sum, angular rates in rad/s and phases in rad.
NO_SINES = np.zeros((3, 0))


@compiled
def sines_at(t, sines):
    """Return the sum of the sines at one instant or at many."""
    amplitude, rate_rad_s, phase_rad = sines[0], sines[1], sines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        total = total + amplitude[k] * np.sin(rate_rad_s[k] * t + phase_rad[k])
    return total


@compiled
def sines_rate_at(t, sines):
    """Return the exact derivative of :func:`sines_at`, per second."""
    amplitude, rate_rad_s, phase_rad = sines[0], sines[1], sines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        rate = rate_rad_s[k]
        total = total + amplitude[k] * rate * np.cos(rate * t + phase_rad[k])
    return total


class Hum(ParameterSet):
    """Mains hum, the same on all channels."""

    frequency_hz: float = parameter(50.0, 'Frequency of the mains.', (1.0, 1e3, 'Hz'))
    amplitude_v: float = parameter(5e-3, 'Amplitude (peak) of the fundamental.', (0.0, 100.0, 'V'))
    harmonics: tuple[float, ...] = parameter(
        (), 'Amplitudes of the 2nd, 3rd, ... harmonic, relative to the fundamental.', (0.0, 10.0)
    )

    def sines(self, trial: np.random.Generator) -> Floats:
        """Return the fundamental and the harmonics that are not zero, in volts."""
        amplitude_v = self.amplitude_v * np.array([1.0, *self.harmonics])
        rate_rad_s = 2 * np.pi * self.frequency_hz * np.arange(1.0, len(amplitude_v) + 1)
        phase_rad = trial.uniform(0.0, 2 * np.pi, len(amplitude_v))
        not_zero = amplitude_v > 0.0
        return np.array([row[not_zero] for row in (amplitude_v, rate_rad_s, phase_rad)])


#: Number of parts, of equal frequency ratio, of the band of a tremor; each has a pair of sines.
TREMOR_PAIRS = 3

#: Amplitude ratio of the second sine of a pair to the first; their sum beats.
TREMOR_BEAT = 0.5

#: Upper bound of the ratio of a tremor's peak to its RMS.
TREMOR_PEAK = 4.0


class Tremor(ParameterSet):
    """Tremor of the hand and motion of the arm.

    The default force is about the tremor of healthy fingers in a pinch: the background power in
    Table 1 of https://www.hindawi.com/journals/cmmm/2012/975735/ is up to 50 mN^2, which is 7 mN.
    The default motion is so small that the skin follows it and nothing slides.
    """

    low_hz: float = parameter(2.0, 'Lowest frequency.', (0.01, 1e3, 'Hz'))
    high_hz: float = parameter(20.0, 'Highest frequency.', (0.01, 1e3, 'Hz'))
    force_rms_n: float = parameter(
        0.01, 'RMS of the force that is added to the normal force.', (0.0, 100.0, 'N')
    )
    motion_rms_m: float = parameter(
        5e-6, 'RMS of the motion of the surface along x.', (0.0, 0.1, 'm')
    )

    def __post_init__(self) -> None:
        """Check the frequencies against each other."""
        super().__post_init__()
        text = f'above low_hz, {self.low_hz:g} Hz'
        self.require(self.low_hz < self.high_hz, 'high_hz', text)

    def sines(self, rms: float, trial: np.random.Generator) -> Floats:
        """Return six sines within the band that have an RMS; nothing is drawn if it is zero.

        The band has three parts of equal frequency ratio; in each of them two neighbouring sines
        beat slowly.
        """
        if not rms:
            return NO_SINES
        # Places on the logarithmic scale from low_hz (0) to high_hz (1), not at the edges.
        first = np.arange(TREMOR_PAIRS) + trial.uniform(0.05, 0.85, TREMOR_PAIRS)
        second = first + trial.uniform(0.02, 0.1, TREMOR_PAIRS)
        places = np.concatenate([first, second]) / TREMOR_PAIRS
        frequency_hz = self.low_hz * (self.high_hz / self.low_hz) ** places
        relative = np.repeat([1.0, TREMOR_BEAT], TREMOR_PAIRS)
        amplitude = relative * rms / np.sqrt(np.sum(np.square(relative)) / 2)
        phase_rad = trial.uniform(0.0, 2 * np.pi, len(places))
        return np.array([amplitude, 2 * np.pi * frequency_hz, phase_rad])


class Taps(CompiledSet):
    """Taps: half sines on the normal force, each with the impulse 2 / pi x peak x duration."""

    times_s: tuple[float, ...] = parameter(
        (),
        'Times at which the taps begin; each ends the one before.',
        (0.0, 1e6, 's'),
        rising=True,
    )
    peak_force_n: float = parameter(
        0.5, 'Peak force; a negative one relieves the contact.', (-1000.0, 1000.0, 'N')
    )
    duration_s: float = parameter(0.01, 'Duration of a tap.', (1e-4, 10.0, 's'))


@compiled
def tap_force_at(t, taps):
    """Return the force in newtons of at least one tap, which is exactly zero between them."""
    # Before the first tap the index is -1, and the time since the last tap is negative.
    begin = taps.times_s[np.searchsorted(taps.times_s, t, side='right') - 1]
    during = (t >= begin) & (t - begin < taps.duration_s)
    force = taps.peak_force_n * np.sin(np.pi / taps.duration_s * (t - begin))
    return np.where(during, force, 0.0)


class Rolling(CompiledSet):
    """The object rolls over the fingertip and back: the contact moves, and nothing slides."""

    start_s: float = parameter(1.0, 'When rolling begins.', (0.0, 1e6, 's'))
    duration_s: float = parameter(0.5, 'Time to roll one way.', (1e-3, 3600.0, 's'))
    hold_s: float = parameter(0.0, 'Rest at either end.', (0.0, 3600.0, 's'))
    distance_m: tuple[float, float] = parameter(
        (1.5e-3, 0.0), 'How far the centre of contact moves: x, y.', (-0.1, 0.1, 'm')
    )
    repeats: int = parameter(1, 'Number of times it rolls there and back.', (1, 10**6))


@compiled
def _smooth_step(u):
    """Return ``3 u^2 - 2 u^3`` of ``u`` limited to 0 to 1; its slope is zero at both ends."""
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@compiled
def rolled_at(t, rolling):
    """Return the displacement x, y in metres of the centre of contact from its place at rest.

    The centre moves along a smooth step, with a continuous velocity that is zero at both ends. The
    displacement is exactly zero before the start and after the last way back.
    """
    one_way = rolling.duration_s + rolling.hold_s
    cycle_s = 2.0 * one_way
    since = np.minimum(np.maximum(t - rolling.start_s, 0.0), rolling.repeats * cycle_s)
    within = since - cycle_s * np.floor(since / cycle_s)
    there = _smooth_step(within / rolling.duration_s)
    share = there - _smooth_step((within - one_way) / rolling.duration_s)
    return share * rolling.distance_m[0], share * rolling.distance_m[1]
