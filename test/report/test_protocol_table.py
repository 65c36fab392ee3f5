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

"""The figures of the paper's protocol as text."""

from slip_detector.evaluation.protocol import WANTED
from slip_detector.report.protocol_table import MEANINGS, protocol_table


def figures(mean_ms):
    return {
        'mean_delay_ms': mean_ms, 'sd_delay_ms': None, 'trial_delays_ms': [mean_ms, None],
        'detected': 1, 'trials': 2, 'success_percent': 50.0,
        'false_positive_percent': 0.5, 'channels_without_on': 3,
    }  # fmt: skip


def test_each_claim_has_words():
    assert set(MEANINGS) == set(WANTED)


def test_the_paper_stands_beside_ours_and_what_is_not_defined_is_a_dash():
    ours = {'plates': {'400': figures(30.0)}, 'all': figures(30.0)}
    result = {
        'seeds': [4, 5],
        'paper': {
            'plates': {'400': {'mean_delay_ms': 36.02, 'sd_delay_ms': 3.91}},
            'false_positive_percent': 1.01,
        },
        **ours,
        'windows': {'20': ours},
        'bands': {'10-100': {'plates': {'400': figures(28.0)}, 'all': figures(28.0)}},
        'wanted': {
            'detected_percent': {'value': 50.0, 'bound': '>= 100', 'met': False},
            'least_rise_ms': {'value': None, 'bound': '> 0', 'met': False},
        },
        'plots': ['a.png'],
    }
    lines = [line.split() for line in protocol_table(result).splitlines()]
    for line in (
        ['400', 'um', 'all'],
        ['seed', '4', '30.00'],
        ['seed', '5', '-'],
        ['mean', '30.00', '30.00'],
        ['mean,', 'paper', '36.02'],
        ['sd', '-', '-'],
        ['detected', '1', 'of', '2', '1', 'of', '2'],
        ['success', '[%]', '50.0', '50.0'],
        ['false', 'positives,', 'paper', '[%]', '1.01'],
        ['20', 'ms', '30.00', '1', 'of', '2', '0.50'],
        ['trials', 'detected', '[%]', '50.00', 'wanted', '>=', '100', 'NOT', 'met'],
        ['Written:', 'a.png'],
    ):
        assert line in lines
