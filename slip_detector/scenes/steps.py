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

"""The steps of a scene: what is done to the fingertip, one after another."""

import dataclasses
from typing import Any

from slip_detector.parameters.conversion import shown
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

#: Largest number of steps: a scene holds the motion of all steps in memory.
MOST_STEPS = 10_000


@dataclasses.dataclass(frozen=True)
class Step(ParameterSet):
    """One step of a scene; forces and shares change linearly to reach their values at its end.

    Examples
    --------
    >>> Step(duration_s=0.5, force_n=0.4).velocity_m_s
    0.0
    """

    duration_s: float = parameter(1.0, 'Duration of the step.', unit='s', low=1e-3, high=36000.0)
    force_n: float = parameter(
        -1.0,
        'Normal force at the end of the step; negative: as before.',
        unit='N',
        low=-1.0,
        high=1000.0,
    )
    velocity_m_s: float = parameter(
        0.0, 'Velocity of the plate along x.', unit='m/s', low=-10.0, high=10.0
    )
    carried: float = parameter(
        -1.0,
        "Share of the object's weight that the fingers carry at the end of the step; negative: as "
        'before.',
        low=-1.0,
        high=1.0,
    )
    pull_n: float = parameter(
        0.0,
        'Further force on the object along x at the end of the step.',
        unit='N',
        low=-1e3,
        high=1e3,
    )


def read_steps(entries: Any) -> list[Step]:
    """Read the steps of a scene file.

    Parameters
    ----------
    entries
        The list under ``steps``; each entry has the parameters of :class:`Step` by their names.

    Raises
    ------
    ValueError
        For an empty list or a step that is wrong; names the step.

    Examples
    --------
    >>> from slip_detector.scenes.steps import read_steps
    >>> press, slide = read_steps([{'force_n': 0.4}, {'velocity_m_s': 6.7e-3}])
    >>> press.force_n, slide.velocity_m_s, slide.duration_s
    (0.4, 0.0067, 1.0)
    >>> read_steps([{'force': 0.4}])
    Traceback (most recent call last):
    ...
    ValueError: steps: step 1: unknown parameter force = 0.4; did you mean force_n?
    """
    if not isinstance(entries, list) or not entries:
        raise ValueError(f'steps is {shown(entries)}, allowed: a list of at least one step')
    if len(entries) > MOST_STEPS:
        raise ValueError(f'steps has {len(entries)}, allowed: at most {MOST_STEPS}')
    steps = []
    for number, entry in enumerate(entries, start=1):
        if not isinstance(entry, dict):
            raise ValueError(f'steps: step {number} is {shown(entry)}, allowed: names and values')
        steps.append(Step.from_parameters(entry, f'steps: step {number}'))
    return steps
