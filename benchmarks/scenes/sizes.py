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

"""How much is measured, in full and with ``--quick``."""

from typing import NamedTuple


class SceneSizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    tolerances : tuple of float
        Relative tolerances of the implicit methods.
    explicit_tolerances : tuple of float
        Those of the explicit methods.
    steps_per_sample : tuple of int
        Settings of the live stepper.
    rounds : int
        How often a fast run is repeated.
    budget_s, stretch_budget_s : float
        Processor time that a method is given for a scene, and for a stretch.
    cost_rounds : int
        How often the run times of a scene and its parts are measured.
    """

    tolerances: tuple[float, ...]
    explicit_tolerances: tuple[float, ...]
    steps_per_sample: tuple[int, ...]
    rounds: int
    budget_s: float
    stretch_budget_s: float
    cost_rounds: int


FULL = SceneSizes(
    (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8),
    (1e-3, 1e-5),
    (1, 2, 3, 4, 6, 8, 16, 32, 64),
    5,
    4.0,
    10.0,
    25,
)
QUICK = SceneSizes((1e-3, 1e-6), (1e-3,), (1, 8), 1, 1.0, 1.0, 2)
