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

"""The figures of the soak as text."""

from benchmarks.soak.measure import WANTED
from benchmarks.soak.table import soak_table

HAND = {
    'seconds': 600.0, 'fingers': 2, 'sample_rate_hz': 5000.0, 'samples_per_message': 10,
    'samples': 456_000, 'lost': {'lost and bridged': 3},
    'lost_total': 3, 'latency_median_ms': 0.5, 'latency_p99_ms': [1.0, 1.1],
    'latency_p99_growth': 1.1, 'memory_growth_percent': 0.1,
    'memory_mib': {'slip_detector': 200.0, 'slip_driver': 180.0},
    'cpu_percent': {'slip_detector': 30.0, 'slip_driver': 20.0}, 'cpu_percent_total': 50.0,
}  # fmt: skip

NODE = {'median_ms': 0.5, 'p99_ms': 2.0, 'cpu_percent': 9.0, 'lost': 1}
RELAY = {
    'rate_hz': 380.0, 'samples': 5700, 'changes': 720, 'detector': NODE, 'relay': NODE,
    'latency_ratio': 1.07, 'cpu_ratio': 0.58,
}  # fmt: skip


def test_the_table_says_of_each_part_what_was_lost_and_what_is_wanted():
    wanted = {
        name: {'value': 1.0, 'bound': '<= 0', 'met': name != 'fast_hand.lost_total'}
        for name in WANTED
    }
    text = soak_table({'relay': RELAY, 'fast_hand': HAND, 'wanted': wanted})
    assert 'fast_hand    2 fingers at 5000 Hz in messages of 10, 456,000 samples' in text
    assert 'lost                 3  (wanted <= 0: NOT met)  (3 lost and bridged)' in text
    assert '50 %: detectors 30 %, drivers 20 %' in text
    assert 'ratio of the medians 1.07  (wanted <= 0: met)' in text
    assert 'of processor times   0.58  (wanted <= 0: met)' in text
    assert text.count('1 changes lost') == 2
    assert max(len(line) for line in text.splitlines()) <= 130
