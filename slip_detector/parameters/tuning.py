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
    """Parameters of the search: the cost, in ms, of each kind of error of a chain.

    These costs are added to the mean latency of the chain over the true slips. Added is also the
    latency that its false alarms would save by chance.

    Examples
    --------
    >>> TuneConfig(false_alarm_costs_ms=20).false_alarm_costs_ms
    20.0
    """

    NODE = 'slip_tune'

    missed_costs_ms: float = parameter(
        500.0, 'Latency that a missed slip counts as.', unit='ms', low=1.0, high=1e6
    )
    false_alarm_costs_ms: float = parameter(
        10.0, 'Cost of each false alarm per minute.', unit='ms', low=0.0, high=1e6
    )
    false_time_costs_ms: float = parameter(
        10.0,
        'Cost of each per cent of the rest during which slip is ON.',
        unit='ms',
        low=0.0,
        high=1e6,
    )
    auc_costs_ms: float = parameter(
        100.0,
        'Cost of an area under the ROC curve of 0; an area of 1 costs nothing. The area uses all '
        'rows, which tell more than a few slips.',
        unit='ms',
        low=0.0,
        high=1e6,
    )
    trade: bool = parameter(
        False,
        'Whether latency, recall, false alarms, false time or area may get worse than with the '
        'given parameters if the total cost falls.',
    )
