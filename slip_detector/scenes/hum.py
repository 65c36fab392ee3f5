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

"""Mains hum."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet
from slip_detector.scenes.sines import Sines, sines_at

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Hum(ParameterSet):
    """Mains hum, the same on all channels.

    Examples
    --------
    >>> Hum(frequency_hz=60, harmonics=[0.0, 0.3]).harmonics
    (0.0, 0.3)
    """

    frequency_hz: float = parameter(50.0, 'Frequency of the mains.', unit='Hz', low=1.0, high=1e3)
    amplitude_v: float = parameter(
        5e-3, 'Amplitude (peak) of the fundamental.', unit='V', low=0.0, high=100.0
    )
    harmonics: tuple[float, ...] = parameter(
        (),
        'Amplitudes of the 2nd, 3rd, ... harmonic, relative to the fundamental.',
        low=0.0,
        high=10.0,
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
    >>> from slip_detector.scenes.hum import Hum, HumVoltage
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
