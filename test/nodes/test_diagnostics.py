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

"""Statuses as messages on ``/diagnostics``."""

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from slip_detector.nodes.diagnostics import Diagnostics
from slip_detector.nodes.health import Level, Status


def test_statuses_are_published_under_the_node_with_level_words_and_values(bench):
    heard = bench.listen(DiagnosticArray, '/diagnostics', 10)
    diagnostics = Diagnostics(bench.node)
    bad = Status('input', values={'samples': '7', 'lost': '2'})
    bad.complain(Level.WARN, 'two are lost')
    bad.complain(Level.ERROR, 'too slow')
    good = Status('channels', all_well='all are valid')

    def published():
        diagnostics.publish([bad, good], 'tip')
        return heard

    bench.wait_for(published, 'the diagnostics')
    first, second = heard[0].status
    assert (first.name, first.level) == ('bench: input', DiagnosticStatus.ERROR)
    assert first.message == 'too slow; two are lost'
    assert {pair.key: pair.value for pair in first.values} == {'samples': '7', 'lost': '2'}
    assert (second.level, second.message) == (DiagnosticStatus.OK, 'all are valid')
    assert {status.hardware_id for status in heard[0].status} == {'tip'}
    assert heard[0].header.stamp.sec > 0
    diagnostics.destroy()
    assert bench.node.count_publishers('/diagnostics') == 0
