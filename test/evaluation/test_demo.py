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

"""What a program hears of a trial, and its figures."""

import numpy as np
import pytest

from slip_detector.evaluation.demo import Heard, demo_figures, demo_words
from slip_detector.parameters.detector import ChainConfig


def test_where_nothing_moves_delays_are_undefined_and_the_rest_is_told():
    config, times_s = ChainConfig(), np.arange(3.0)
    topics = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    topics += [f'slip/channel/{name}' for name in config.names]
    changes = dict.fromkeys(topics, (np.array([0.0, 1.0, 2.0]), np.array([False, True, False])))
    figures = demo_figures(
        Heard(times_s, np.zeros((3, 16)), times_s, np.zeros(3), np.full(3, 2e-3), changes), config
    )
    assert figures['motion'] is figures['mean_delay_ms'] is figures['global_delay_ms'] is None
    assert {*figures['channel_delay_ms'].values(), *figures['group_delay_ms'].values()} == {None}
    assert figures['false_positive_percent'] == pytest.approx(100 / 3)
    assert figures['latency_ms'] == {'median': 2.0, 'p99': 2.0}


def test_the_words_say_whether_slip_was_seen_and_that_nodes_were_held_up():
    result = {'motion': {'start_s': 3.0}, 'false_positive_percent': 0.86}
    latency_ms = {'median': 0.4, 'p99': 120.0}
    for slip_ms, said in ((None, 'The plate slid, and slip'), (37.4, 'Slip was seen 37 ms')):
        words = demo_words({**result, 'global_delay_ms': slip_ms, 'latency_ms': latency_ms})
        assert words.startswith(said)
        assert ', one in a hundred 120 ms: other work on this machine' in words
