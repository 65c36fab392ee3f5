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

"""Ridges with a spatial period, and the load that they add to a taxel sliding over them."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


class RidgeNumbers(NamedTuple):
    """The numbers of a :class:`Texture` for compiled code."""

    wavenumber_rad_m: float
    start_rad: float
    amplitudes: Floats


@dataclasses.dataclass(frozen=True)
class Texture(ParameterSet):
    """Ridges across the direction of motion.

    Examples
    --------
    >>> Texture(spatial_period_m=500e-6, harmonics=[]).highest_wavenumber_1_m
    2000.0
    """

    spatial_period_m: float = parameter(
        400e-6, 'Distance from ridge to ridge.', unit='m', low=1e-6, high=1.0
    )
    ridge_height_m: float = parameter(
        100e-6,
        'Amplitude of the ridges: height of the first harmonic above the mean.',
        unit='m',
        low=0.0,
        high=1e-2,
    )
    harmonics: tuple[float, ...] = parameter(
        (0.0, -0.22),
        'Heights of the second, third, ... harmonic as shares of the first; [] for a sine.',
        low=-10.0,
        high=10.0,
    )
    indentation_m: float = parameter(
        670e-6, 'Height that doubles the load of the taxel on it.', unit='m', low=1e-9, high=1.0
    )

    def __post_init__(self) -> None:
        """Check that the load of a taxel does not become negative in a groove."""
        super().__post_init__()
        highest_m = self.ridge_height_m * (1.0 + sum(map(abs, self.harmonics)))
        if highest_m > self.indentation_m:
            raise ValueError(
                f'parameter ridge_height_m is {self.ridge_height_m:g} m, allowed: with its '
                f'harmonics at most indentation_m, {self.indentation_m:g} m'
            )

    @property
    def highest_wavenumber_1_m(self) -> float:
        """Wavenumber of the highest harmonic, in ridges per metre."""
        return (1 + len(self.harmonics)) / self.spatial_period_m

    def numbers(self, trial: np.random.Generator) -> RidgeNumbers:
        """Return the numbers for compiled code; ``trial`` draws the phase of the ridges."""
        heights = self.ridge_height_m * np.array([1.0, *self.harmonics])
        return RidgeNumbers(
            2.0 * np.pi / self.spatial_period_m,
            2.0 * np.pi * trial.random(),
            heights / self.indentation_m,
        )


@compiled
def ridges_between(from_m, to_m, ridges):
    """Return the mean height of the ridges between two places, as a share of the indentation.

    If both places are equal, the result is the height there. A sensor of limited bandwidth reads
    the mean over the distance of one step, even if ridges pass too fast to be resolved.

    Parameters
    ----------
    from_m, to_m : float
        Places on the surface along x.
    ridges : RidgeNumbers
        The numbers of the surface.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.texture import RidgeNumbers, ridges_between
    >>> sine = RidgeNumbers(2 * np.pi / 400e-6, 0.0, np.array([0.15]))
    >>> round(float(ridges_between(100e-6, 100e-6, sine)), 6)  # a quarter of a period: a crest
    0.15
    >>> round(float(ridges_between(0.0, 400e-6, sine)), 6)  # the mean of a whole period is 0
    0.0
    """
    middle = ridges.start_rad + ridges.wavenumber_rad_m * 0.5 * (from_m + to_m)
    half = 0.5 * ridges.wavenumber_rad_m * (to_m - from_m)
    total = 0.0
    for k in range(ridges.amplitudes.size):
        if ridges.amplitudes[k] == 0.0:
            continue
        share = (k + 1) * half
        mean = np.sin(share) / share if abs(share) > 1e-8 else 1.0
        total += ridges.amplitudes[k] * mean * np.sin((k + 1) * middle)
    return total
