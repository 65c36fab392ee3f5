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

"""The distribution of the normal force over the taxels."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


class HertzNumbers(NamedTuple):
    """The numbers of a :class:`Contact` for compiled code."""

    squared_radius_at_1n_m2: float
    taxel_area_m2: float


@dataclasses.dataclass(frozen=True)
class Contact(ParameterSet):
    """Hertz contact of a round fingertip with a plate.

    Examples
    --------
    >>> from slip_detector.scenes.contact import Contact
    >>> round(Contact().largest_load_n(force_n=1.0), 4)  # newtons, on a taxel at the centre
    0.0228
    """

    radius_at_1n_m: float = parameter(
        5.4e-3, 'Contact radius at 1 N; grows with the cube root of the force.', (1e-5, 1.0, 'm')
    )
    centre_m: tuple[float, float] = parameter(
        (0.0, 0.0), 'Centre of the contact: x, y.', (-1.0, 1.0, 'm')
    )
    taxel_area_m2: float = parameter(
        1.39e-6, 'Area over which a taxel senses pressure.', (1e-12, 1.0, 'm2')
    )

    def numbers(self) -> HertzNumbers:
        """Return the numbers for compiled code."""
        return HertzNumbers(self.radius_at_1n_m**2, self.taxel_area_m2)

    def largest_load_n(self, force_n: float) -> float:
        """Return the largest load of a taxel: that of one at the centre of the contact."""
        out = np.zeros(1)
        spread_load(force_n, 0.0, 0.0, np.zeros((1, 2)), self.numbers(), 0.0, out)
        return float(out[0])


@compiled
def spread_load(force_n, centre_x_m, centre_y_m, positions_m, hertz, rest_patches, loads_n):
    """Write the normal load of each taxel to ``loads_n``.

    Hertz: p(r) = 3 F / (2 pi a^2) sqrt(1 - r^2 / a^2), a^3 proportional to F.

    Parameters
    ----------
    force_n : float
        Normal force.
    centre_x_m, centre_y_m : float
        Centre of the contact.
    positions_m : ndarray, shape (channels, 2)
        Positions of the taxels.
    hertz : HertzNumbers
        The numbers of the contact.
    rest_patches : float
        Number of patches of skin between the taxels.
    loads_n : ndarray, shape (channels,) or (channels + 1,)
        Output. An extra element gets the load of one patch of skin between the taxels; all these
        patches together carry the rest of the force.
    """
    n = positions_m.shape[0]
    if not force_n > 0.0:
        loads_n[:] = 0.0
        return
    squared = hertz.squared_radius_at_1n_m2 * force_n ** (2.0 / 3.0)
    peak = 1.5 * force_n / (np.pi * squared) * hertz.taxel_area_m2
    carried = 0.0
    for i in range(n):
        x, y = positions_m[i, 0] - centre_x_m, positions_m[i, 1] - centre_y_m
        inside = 1.0 - (x * x + y * y) / squared
        loads_n[i] = peak * np.sqrt(inside) if inside > 0.0 else 0.0
        carried += loads_n[i]
    if loads_n.size > n:
        loads_n[n] = max(force_n - carried, 0.0) / rest_patches
