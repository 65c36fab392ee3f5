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

"""The parameters of the evaluation."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class EvaluationConfig(ParameterSet):
    """Parameters of the evaluation: what counts as detected, and which rows are rows of motion.

    Examples
    --------
    >>> EvaluationConfig(tail_s=0.2).tail_s
    0.2
    >>> EvaluationConfig(tail_s=20)
    Traceback (most recent call last):
    ValueError: parameter tail_s is 20 s, allowed: 0 to 10 s
    """

    NODE = 'slip_evaluate'

    early_s: float = parameter(
        0.0,
        'An alarm that rises this long before the label of a slip still counts for it.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    tail_s: float = parameter(
        0.1,
        'An alarm that rises this long after the end of a slip, while the windows still hold it, '
        'still counts for it.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    off_before_s: float = parameter(
        0.1,
        'A new alarm begins only after slip was OFF for this long; a shorter OFF does not end an '
        'alarm.',
        unit='s',
        low=0.0,
        high=10.0,
    )
    late_after_s: float = parameter(
        0.1, 'A detection with a longer latency is late.', unit='s', low=0.0, high=10.0
    )

    motion_key: str = parameter(
        '', 'Name of the array of velocities in a recording; empty: there is none.'
    )
    motion_columns: tuple[str, ...] = parameter(
        (),
        'Columns of that array to use, as named in the array <motion_key>_names; empty: all.',
    )
    moving_above: float = parameter(
        0.01,
        'A row counts as motion when the norm of its velocities exceeds this.',
        unit='m/s',
        low=0.0,
        high=1e6,
    )

    def __post_init__(self) -> None:
        """Check the fields against each other."""
        super().__post_init__()
        if self.motion_columns and not self.motion_key:
            raise ValueError(
                "parameter motion_key is '', allowed: the name of an array, as motion_columns "
                'names columns of it'
            )
