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

"""The clock of the sensor."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class Clock(ParameterSet):
    """A sensor that does not take samples at its nominal rate.

    Examples
    --------
    >>> from slip_detector.scenes.clock import Clock
    >>> 380.0 * Clock(rate_ratio=1.01).rate_ratio  # samples per second, nominally 380
    383.8
    """

    rate_ratio: float = parameter(
        1.01, 'True rate of the samples over the nominal rate.', low=0.1, high=10.0
    )
