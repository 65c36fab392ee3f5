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

"""The skin over one taxel: a spring, a damper and a mass that shear along x."""

import dataclasses
from typing import NamedTuple

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


class SkinNumbers(NamedTuple):
    """The numbers of a :class:`Skin` for compiled code."""

    stiffness_n_m: float
    damping_n_s_m: float
    mass_kg: float


@dataclasses.dataclass(frozen=True)
class Skin(ParameterSet):
    """Skin over one taxel, between the finger and the surface that it touches.

    Examples
    --------
    >>> from slip_detector.scenes.skin import Skin
    >>> Skin(mass_kg=1e-6).numbers()
    SkinNumbers(stiffness_n_m=800.0, damping_n_s_m=0.3, mass_kg=1e-06)
    """

    shear_stiffness_n_m: float = parameter(
        800.0, 'Shear stiffness.', unit='N/m', low=1e-3, high=1e9
    )
    damping_n_s_m: float = parameter(
        0.3, 'Damping against the finger; 0: none.', unit='N s/m', low=0.0, high=1e6
    )
    mass_kg: float = parameter(
        0.0,
        'Mass that moves with the surface of the skin; 0: the skin has no inertia.',
        unit='kg',
        low=0.0,
        high=1.0,
    )

    def numbers(self) -> SkinNumbers:
        """Return the numbers for compiled code."""
        return SkinNumbers(self.shear_stiffness_n_m, self.damping_n_s_m, self.mass_kg)
