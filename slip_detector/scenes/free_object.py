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

"""An object held between two fingertips against its weight."""

import dataclasses
from typing import NamedTuple

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

STANDARD_GRAVITY_M_S2 = 9.80665

#: Number of equal fingertips that hold an object.
FINGERS = 2.0


class ObjectNumbers(NamedTuple):
    """The numbers of a :class:`FreeObject` for compiled code.

    Examples
    --------
    >>> FreeObject(mass_kg=0.2).numbers().mass_kg
    0.2
    """

    mass_kg: float
    length_m: float
    rest_patches: float


@dataclasses.dataclass(frozen=True)
class FreeObject(ParameterSet):
    """An object between two equal fingertips, one of which has the sensor.

    Examples
    --------
    >>> from slip_detector.scenes.free_object import STANDARD_GRAVITY_M_S2, FreeObject
    >>> round(FreeObject(mass_kg=0.2).mass_kg * STANDARD_GRAVITY_M_S2, 3)  # its weight in newtons
    1.961
    """

    mass_kg: float = parameter(0.2, 'Mass of the object.', (1e-3, 10.0, 'kg'))
    length_m: float = parameter(
        0.1,
        'How far the object can slide through the fingers before it is lost.',
        (1e-4, 10.0, 'm'),
    )
    rest_patches: float = parameter(
        50.0,
        'Number of further skin patches, each as stiff as that over a taxel, between the taxels.',
        (1.0, 1e4),
    )

    def numbers(self) -> ObjectNumbers:
        """Return the numbers for compiled code."""
        return ObjectNumbers(self.mass_kg, self.length_m, self.rest_patches)
