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

"""A short soak of the real nodes."""

import json

import pytest

from benchmarks.soak import measure
from benchmarks.soak.table import soak_table
from support.benchmarks import run

pytest.importorskip('rclpy', reason='needs rclpy')

pytestmark = pytest.mark.nodes


@pytest.mark.parametrize(
    ('part', 'fingers', 'samples_a_second'), [('finger', 1, 380), ('fast_hand', 5, 5 * 1000)]
)
def test_nothing_is_lost_unseen_and_all_figures_are_there(part, fingers, samples_a_second):
    code, output, errors = run('soak', '--part', part, '--seconds', '20', '--json')
    assert code == 0, errors
    result = json.loads(output)
    figures = result[part]
    for name in figures:
        assert f'``{name}``' in measure.__doc__
    assert f'{figures["samples"]:,} samples' in soak_table(result)
    assert figures['fingers'] == fingers
    # Of the 20 s there are samples all the time, or they are counted as lost. Where the machine is
    # busy, the drivers of a hand fall behind, at the end more than at the median of a half.
    late_s = 0.0 if part == 'finger' else 2e-3 * max(figures['latency_p99_ms'])
    least_s = max(10.0, 19.0 - late_s)
    assert figures['samples'] + figures['lost_total'] > least_s * samples_a_second
    # The middleware's queue between two processes holds 512 messages: 1.3 s of one finger at
    # 380 Hz, but 0.1 s of five at 1 kHz, and a machine busy with other tests stops a process for
    # longer. What a hand loses on an idle machine is the benchmark's to say.
    if part == 'finger':
        assert figures['lost_total'] == 0
    assert 0 < figures['latency_median_ms'] <= max(figures['latency_p99_ms'])
    assert set(result['wanted']) == set(measure.WANTED)
