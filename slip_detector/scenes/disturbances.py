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

"""What disturbs a grip: hum, tremor, taps; and the sums of sines of which they are made.

Sums of sines, for hum and tremor.

Mains hum.

Tremor of the hand: it changes the normal force and the position of the surface.

Taps: short pulses of the normal force.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


class Sines(NamedTuple):
    """A sum of ``k`` sines, each ``amplitude * sin(angular_rate_rad_s * t + phase_rad)``.

    Attributes
    ----------
    amplitude, angular_rate_rad_s, phase_rad : ndarray, shape (k,)
        The amplitudes have the unit of the sum.
    """

    amplitude: Floats
    angular_rate_rad_s: Floats
    phase_rad: Floats


NO_SINES = Sines(np.zeros(0), np.zeros(0), np.zeros(0))


@compiled
def sines_at(t, sines):
    """Return the sum of the sines at one instant or at many.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    sines : Sines or ndarray, shape (3, k)
        The rows of an array are the fields of :class:`Sines` in their order; a call with one
        array is faster.

    Returns
    -------
    float or ndarray, as ``t``
        In the unit of the amplitudes.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.disturbances import Sines, sines_at
    >>> hum = Sines(np.array([2.0]), np.array([2 * np.pi * 50]), np.array([0.0]))
    >>> sines_at(np.array([0.0, 0.005, 0.015]), hum).round(9)
    array([ 0.,  2., -2.])
    """
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


@dataclasses.dataclass(frozen=True)
class Hum(ParameterSet):
    """Mains hum, the same on all channels.

    Examples
    --------
    >>> Hum(frequency_hz=60, harmonics=[0.0, 0.3]).harmonics
    (0.0, 0.3)
    """

    frequency_hz: float = parameter(50.0, 'Frequency of the mains.', (1.0, 1e3, 'Hz'))
    amplitude_v: float = parameter(5e-3, 'Amplitude (peak) of the fundamental.', (0.0, 100.0, 'V'))
    harmonics: tuple[float, ...] = parameter(
        (), 'Amplitudes of the 2nd, 3rd, ... harmonic, relative to the fundamental.', (0.0, 10.0)
    )


class HumVoltage:
    """The hum of one trial.

    Parameters
    ----------
    hum
        The properties of the hum.
    trial
        Generator of the phases: of the fundamental first, then of each harmonic.

    Attributes
    ----------
    sines : Sines
        The fundamental and the harmonics that are not zero, in volts.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.disturbances import Hum, HumVoltage
    >>> hum = HumVoltage(Hum(amplitude_v=0.01), np.random.default_rng(0))
    >>> volts = hum.volts(np.arange(1000) / 1000)
    >>> round(float(volts.max()), 3)
    0.01
    """

    def __init__(self, hum: Hum, trial: np.random.Generator) -> None:
        amplitude_v: Floats = hum.amplitude_v * np.array([1.0, *hum.harmonics])
        multiple: Floats = np.arange(1.0, len(amplitude_v) + 1)
        rate_rad_s = 2 * np.pi * hum.frequency_hz * multiple
        phase_rad = trial.uniform(0.0, 2 * np.pi, len(amplitude_v))
        not_zero = amplitude_v > 0.0
        self.sines = Sines(amplitude_v[not_zero], rate_rad_s[not_zero], phase_rad[not_zero])

    def volts(self, time_s: Floats) -> Floats:
        """Return the hum of every channel at each time, shape (n,)."""
        return np.asarray(sines_at(time_s, self.sines), dtype=np.float64)


#: Number of parts, of equal frequency ratio, of the band of a tremor; each has a pair of sines.
TREMOR_PAIRS = 3

#: Amplitude ratio of the second sine of a pair to the first; their sum beats.
TREMOR_BEAT = 0.5

#: Upper bound of the ratio of a tremor's peak to its RMS.
TREMOR_PEAK = 4.0


@dataclasses.dataclass(frozen=True)
class Tremor(ParameterSet):
    """Tremor of the hand and motion of the arm.

    The default force is about the tremor of healthy fingers in a pinch: the background power in
    Table 1 of https://www.hindawi.com/journals/cmmm/2012/975735/ is up to 50 mN^2, which is 7 mN.
    The default motion is so small that the skin follows it and nothing slides.

    Examples
    --------
    >>> Tremor(force_rms_n=0.02).high_hz
    20.0
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
        """Check that the band is not empty."""
        super().__post_init__()
        if self.low_hz >= self.high_hz:
            raise ValueError(
                f'parameter high_hz is {self.high_hz:g} Hz, allowed: above low_hz, '
                f'{self.low_hz:g} Hz'
            )


class HandMotion:
    """The tremor of one trial: six sines for the normal force, six others for the position.

    The band has three parts of equal frequency ratio; in each of them two neighbouring sines beat
    slowly. All frequencies are within the band, and the long-term RMS is the configured one.

    Parameters
    ----------
    tremor
        The properties of the tremor.
    trial
        Generator of the trial. Force and motion always get a child of it each, in this order;
        nothing is drawn if the RMS is zero.

    Attributes
    ----------
    force_sines, motion_sines : Sines
        In newtons and metres; empty if the RMS is zero.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.disturbances import HandMotion, Tremor
    >>> hand = HandMotion(Tremor(force_rms_n=0.3, motion_rms_m=0.0), np.random.default_rng(0))
    >>> float(np.sqrt(np.sum(hand.force_sines.amplitude**2) / 2).round(6))
    0.3
    >>> len(hand.motion_sines.amplitude)
    0
    """

    def __init__(self, tremor: Tremor, trial: np.random.Generator) -> None:
        of_force, of_motion = trial.spawn(2)
        self.force_sines = _tremor_sines(tremor, tremor.force_rms_n, of_force)
        self.motion_sines = _tremor_sines(tremor, tremor.motion_rms_m, of_motion)


def _tremor_sines(tremor: Tremor, rms: float, trial: np.random.Generator) -> Sines:
    if not rms:
        return NO_SINES
    # Places on the logarithmic scale from low_hz (0) to high_hz (1), not at the edges.
    first = np.arange(TREMOR_PAIRS) + trial.uniform(0.05, 0.85, TREMOR_PAIRS)
    second = first + trial.uniform(0.02, 0.1, TREMOR_PAIRS)
    places = np.concatenate([first, second]) / TREMOR_PAIRS
    frequency_hz = tremor.low_hz * (tremor.high_hz / tremor.low_hz) ** places
    relative = np.repeat([1.0, TREMOR_BEAT], TREMOR_PAIRS)
    amplitude = relative * rms / np.sqrt(np.sum(np.square(relative)) / 2)
    phase_rad = trial.uniform(0.0, 2 * np.pi, len(places))
    return Sines(amplitude, 2 * np.pi * frequency_hz, phase_rad)


class TapNumbers(NamedTuple):
    """The numbers of :class:`Taps` for compiled code; ``begins_s`` is empty without taps."""

    begins_s: Floats
    peak_force_n: float
    duration_s: float


@dataclasses.dataclass(frozen=True)
class Taps(ParameterSet):
    """Taps: half sines on the normal force, each with the impulse 2 / pi x peak x duration.

    Examples
    --------
    >>> Taps(times_s=[1, 2.5], peak_force_n=0.3).times_s
    (1.0, 2.5)
    """

    times_s: tuple[float, ...] = parameter(
        (),
        'Times at which the taps begin.',
        (0.0, 1e6, 's'),
        allows='at least one, rising, at least duration_s apart, 0 to 1e+06 s',
    )
    peak_force_n: float = parameter(
        0.5, 'Peak force; a negative one relieves the contact.', (-1000.0, 1000.0, 'N')
    )
    duration_s: float = parameter(0.01, 'Duration of a tap.', (1e-4, 10.0, 's'))

    def __post_init__(self) -> None:
        """Check that there are taps, and that they do not overlap."""
        super().__post_init__()
        if not self.times_s:
            raise ValueError('parameter times_s is empty, allowed: at least one time')
        for before, after in zip(self.times_s[:-1], self.times_s[1:], strict=True):
            # Round-off may put a tap that begins at the end of another slightly before that end.
            if after - before < self.duration_s * (1 - 1e-9):
                raise ValueError(
                    f'parameter times_s has {after:g} s after {before:g} s, allowed: rising, at '
                    f'least duration_s, {self.duration_s:g} s, apart'
                )

    def numbers(self) -> TapNumbers:
        """Return the numbers for compiled code."""
        return TapNumbers(np.array(self.times_s), self.peak_force_n, self.duration_s)


@compiled
def tap_force_at(t, side, numbers):
    """Return the force of the taps, which is exactly zero between them.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    side : as ``t``
        Selects the value at the beginning or the end of a tap: a time on the wanted side of it.
        Elsewhere the instant itself.
    numbers : TapNumbers
        The numbers of at least one tap.

    Returns
    -------
    float or ndarray, as ``t``
        In newtons.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.disturbances import Taps, tap_force_at
    >>> taps = Taps(times_s=(1.0,), peak_force_n=0.5, duration_s=0.5).numbers()
    >>> t = np.array([0.9, 1.25, 1.6])
    >>> tap_force_at(t, t, taps)
    array([0. , 0.5, 0. ])
    """
    # Before the first tap the index is -1, and the time since the last tap is negative.
    begin = numbers.begins_s[np.searchsorted(numbers.begins_s, side, side='right') - 1]
    during = (side >= begin) & (side - begin < numbers.duration_s)
    force = numbers.peak_force_n * np.sin(np.pi / numbers.duration_s * (t - begin))
    return np.where(during, force, 0.0)
