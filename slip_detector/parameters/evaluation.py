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

"""The parameters of the evaluation and of the search."""

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


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

    early_s: float = parameter(0.0, 'An alarm this long before a slip counts.', (0.0, 10.0, 's'))
    tail_s: float = parameter(0.1, 'An alarm so long after a slip still counts.', (0.0, 10.0, 's'))
    off_before_s: float = parameter(
        0.1, 'OFF for a shorter time than this does not end an alarm.', (0.0, 10.0, 's')
    )
    late_after_s: float = parameter(0.1, 'A detection after this time is late.', (0.0, 10.0, 's'))

    motion_key: str = parameter('', 'Array of velocities in a recording; empty: none.')
    motion_columns: tuple[str, ...] = parameter(
        (), 'Columns of motion_key to use, as the array <motion_key>_names has them; empty: all.'
    )
    moving_above: float = parameter(0.01, 'Speed above which a row is motion.', (0.0, 1e6, 'm/s'))

    def __post_init__(self) -> None:
        """Check the fields against each other."""
        super().__post_init__()
        text = 'the name of an array, as motion_columns names columns of it'
        self.require(not self.motion_columns or self.motion_key != '', 'motion_key', text)


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

    missed_costs_ms: float = parameter(500.0, 'Latency of a missed slip.', (1.0, 1e6, 'ms'))
    false_alarm_costs_ms: float = parameter(
        10.0, 'Cost of each false alarm per minute.', (0.0, 1e6, 'ms')
    )
    false_time_costs_ms: float = parameter(
        10.0, 'Cost of each per cent of the rest during which slip is ON.', (0.0, 1e6, 'ms')
    )
    missed_time_costs_ms: float = parameter(
        10.0, 'Cost of each per cent of the time of slips while slip is OFF.', (0.0, 1e6, 'ms')
    )
    auc_costs_ms: float = parameter(
        100.0, 'Cost of an area of 0 under the ROC curve; 1 costs nothing.', (0.0, 1e6, 'ms')
    )
    trade: bool = parameter(False, 'Refused if true, as no figure of a result may be worse.')
