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

"""The processes of a soak, and what their diagnostics come to."""

from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from benchmarks.soak.hand import figures_of_watch
from slip_detector.nodes.health import AGE_KEYS, COUNT_KEYS

pytestmark = pytest.mark.nodes


def report(samples, median_ms, p99_ms, lost=0):
    values = dict.fromkeys(COUNT_KEYS.values(), '0') | {'samples': str(samples)}
    values[AGE_KEYS[0]], values[AGE_KEYS[1]] = str(median_ms), str(p99_ms)
    values[next(iter(COUNT_KEYS.values()))] = str(lost)
    return values


def watch_of(reports, memory_kib):
    return SimpleNamespace(reports={'finger_1/slip_detector': reports}, memory_kib=memory_kib)


def test_only_what_comes_after_the_warm_up_counts():
    reports = [(1.0, report(300, 9.0, '-'))]
    reports += [(float(at_s), report(380 * at_s, 0.5, 2.0)) for at_s in range(11, 15)]
    reports += [(float(at_s), report(380 * at_s, 0.7, 3.0, lost=2)) for at_s in range(16, 20)]
    memory_kib = {
        'slip_detector': [(1.0, 50), (11.0, 1024), (19.0, 2048)],
        'slip_driver': [(11.0, 512), (19.0, 512)],
    }
    used_s = {'slip_detector': 1.0, 'slip_driver': 0.5}
    figures = figures_of_watch(watch_of(reports, memory_kib), used_s, warm_s=10.0, end_s=20.0)
    assert figures['seconds'] == 10.0
    assert figures['samples'] == 380 * 19
    assert figures['lost_total'] == 2
    assert figures['latency_median_ms'] == pytest.approx(0.6)
    assert figures['latency_p99_ms'] == [2.0, 3.0]
    assert figures['latency_p99_growth'] == 1.5
    assert figures['memory_growth_percent'] == 100.0
    assert figures['memory_mib'] == {'slip_detector': 2.0, 'slip_driver': 0.5}
    assert figures['cpu_percent'] == {'slip_detector': 10.0, 'slip_driver': 5.0}
    assert figures['cpu_percent_total'] == 15.0


def test_detectors_that_fall_silent_are_an_error():
    reports = [(11.0, report(380, 0.5, 2.0))]
    memory_kib = {'slip_detector': [(11.0, 1)], 'slip_driver': [(11.0, 1)]}
    with pytest.raises(RuntimeError, match='no samples'):
        figures_of_watch(watch_of(reports, memory_kib), {}, warm_s=10.0, end_s=20.0)
