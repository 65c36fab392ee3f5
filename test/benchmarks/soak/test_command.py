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

"""The subcommand ``soak``."""

import pytest

from benchmarks.soak import command, measure
from benchmarks.soak.measure import PARTS


@pytest.mark.parametrize(
    ('words', 'asked'),
    [
        ([], (list(PARTS), False, None)),
        (['--quick'], (list(PARTS), True, None)),
        (['--part', 'hand', '--seconds', '7'], (['hand'], False, 7.0)),
    ],
)
def test_parts_and_times_are_asked_for(words, asked, monkeypatch):
    asked_for = []

    def measured(*what):
        asked_for.append(what)
        return {}

    monkeypatch.setattr(command, 'measure_soak', measured)
    monkeypatch.setattr(command, 'soak_table', lambda figures: 'the table')
    assert command.run(command.options().parse_args(words)).text.endswith('\n\nthe table')
    assert asked_for == [asked]


def test_where_no_node_can_run_the_soak_says_why(monkeypatch):
    monkeypatch.setattr(measure, 'why_not_ros', lambda: 'rclpy cannot be imported (so)')
    with pytest.raises(RuntimeError, match=r'the soak needs the nodes: rclpy cannot .* \(so\)'):
        measure.measure_soak(['hand'], quick=True)


@pytest.mark.parametrize(
    ('quick', 'seconds', 'lasts_s'), [(False, None, 25.0), (True, None, 4.0), (True, 9.0, 9.0)]
)
def test_each_part_runs_as_a_process_for_its_time_and_is_judged_unless_in_short(
    quick, seconds, lasts_s, monkeypatch
):
    ran = []

    def figures_of_process(module, words, timeout_s):
        ran.append((module, words))
        assert timeout_s > lasts_s
        return {'latency_ratio': 1.1, 'cpu_ratio': 0.7}

    monkeypatch.setattr(measure, 'why_not_ros', lambda: '')
    monkeypatch.setattr(measure, 'figures_of_process', figures_of_process)
    figures = measure.measure_soak(['relay'], quick, seconds)
    assert ran == [('benchmarks.soak.end_to_end', ['--seconds', str(lasts_s)])]
    wanted = figures['wanted']
    assert wanted['relay.latency_ratio']['met'] is (None if quick else True)
    assert wanted['relay.cpu_ratio']['met'] is (None if quick else False)
    assert wanted['hand.lost_total']['value'] is wanted['hand.lost_total']['met'] is None


def test_each_claim_is_of_a_part():
    assert {claim.split('.')[0] for claim in measure.WANTED} == set(PARTS)
