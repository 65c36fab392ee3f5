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

"""The parameters of the search."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class TuneConfig(ParameterSet):
    """Parameters of the search: what misses, false alarms and time, and a small area cost, in ms.

    These costs are added to the mean latency of a chain over the true slips, as is what its false
    alarms would save of it by chance.

    Examples
    --------
    >>> TuneConfig(false_alarm_costs_ms=20).false_alarm_costs_ms
    20.0
    """

    NODE = 'slip_tune'

    missed_costs_ms: float = parameter(
        500.0, 'A missed slip counts as one detected so late.', unit='ms', low=1.0, high=1e6
    )
    false_alarm_costs_ms: float = parameter(
        10.0, 'What each false alarm per minute costs.', unit='ms', low=0.0, high=1e6
    )
    false_time_costs_ms: float = parameter(
        10.0,
        'What each per cent of the rest in which slip is ON costs.',
        unit='ms',
        low=0.0,
        high=1e6,
    )
    auc_costs_ms: float = parameter(
        100.0,
        'What an area under the ROC curve of 0 would cost, 1 being free: few slips say little, '
        'all their rows say more.',
        unit='ms',
        low=0.0,
        high=1e6,
    )
    trade: bool = parameter(
        False,
        'Whether latency, recall, false alarms, false time or area may get worse than with the '
        'given parameters where the cost falls.',
    )
