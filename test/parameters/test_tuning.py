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

import pytest

from slip_detector.parameters.tuning import TuneConfig
from support.config_cases import message_of


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        (
            {'missed_costs_ms': 0.5},
            'parameter missed_costs_ms is 0.5 ms, allowed: 1 to 1e+06 ms',
        ),
        (
            {'false_alarm_costs_ms': -1.0},
            'parameter false_alarm_costs_ms is -1 ms, allowed: 0 to 1e+06 ms',
        ),
        (
            {'auc_costs_ms': 2e6},
            'parameter auc_costs_ms is 2e+06 ms, allowed: 0 to 1e+06 ms',
        ),
        ({'trade': 1}, 'parameter trade is 1, allowed: true, false'),
    ],
)
def test_a_bad_value_is_an_error_that_says_what_is_allowed(values, message):
    assert message_of(TuneConfig, **values) == message


def test_what_costs_nothing_is_allowed_but_a_missed_slip_always_costs():
    free = TuneConfig(missed_costs_ms=1, false_alarm_costs_ms=0, auc_costs_ms=0)
    assert (free.missed_costs_ms, free.false_alarm_costs_ms, free.auc_costs_ms) == (1.0, 0.0, 0.0)
    assert not free.trade


def test_they_are_read_from_the_section_of_the_command(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('slip_tune:\n  ros__parameters: {trade: true}\n')
    assert TuneConfig.from_yaml(path) == TuneConfig(trade=True)
    path.write_text('slip_tune:\n  ros__parameters: {missed_cost_ms: 3.0}\n')
    message = message_of(TuneConfig.from_yaml, path)
    assert message == (
        f'{path}: unknown parameter missed_cost_ms = 3.0; did you mean missed_costs_ms?'
    )
