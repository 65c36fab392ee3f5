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

"""The figures of the live page as text."""

from benchmarks.view.measure import WANTED
from benchmarks.view.table import view_table

CLOSED = {
    'seconds': 100.0, 'latency_median_ms': 0.5, 'latency_p99_ms': 2.0, 'latency_noise': 1.07,
    'cpu_percent': {'slip_view': 0.5, 'slip_detector': 12.0, 'slip_driver': 11.0},
    'slip_view_cpu_percent': 0.5,
}  # fmt: skip
ELSEWHERE = {
    **CLOSED, 'frames_a_second': 29.5, 'frames_in_the_worst_second': 28.0, 'latency_ratio': 1.04,
}  # fmt: skip
HERE = {
    **ELSEWHERE, 'browser_cpu_percent': 60.0, 'memory_mib': 230.0, 'memory_growth_percent': 0.25,
    'heap_mib': 2.5, 'heap_growth_percent': 7.5,
}  # fmt: skip


def test_the_table_says_of_each_who_looks_what_it_takes_and_what_is_wanted():
    claims = [*WANTED, 'elsewhere.latency_ratio']
    wanted = {
        name: {'value': 1.0, 'bound': '<= 30', 'met': name != 'here.heap_growth_percent'}
        for name in claims
    }
    text = view_table(
        {'fingers': 5, 'closed': CLOSED, 'elsewhere': ELSEWHERE, 'here': HERE, 'wanted': wanted}
    )
    assert 'closed       no page open, 100 s' in text
    assert 'between turns a factor of 1.07' in text
    assert '1.04 times  (wanted <= 30: met)' in text
    assert text.count('1.04 times') == 2
    assert 'slip_view 0.5 %  (wanted <= 30: met); detectors 12.0 %' in text
    assert 'the page 2.5 MiB, grew by 7.50 %  (wanted <= 30: NOT met)' in text
    assert text.count('wanted') == len(claims)
    assert max(len(line) for line in text.splitlines()) <= 110
