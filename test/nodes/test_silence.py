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

"""When an input counts as silent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from slip_detector.nodes.silence import LOOKS, SilenceWatch

MS = 10**6


@given(st.integers(0, 10**18), st.integers(10, 10_000), st.data())
def test_lost_is_told_once_and_between_eight_and_nine_tenths_of_the_timeout(
    began_ns, timeout_ms, data
):
    look_ns = timeout_ms * MS // LOOKS
    heard_ns = data.draw(st.lists(st.integers(0, 60 * look_ns), min_size=1).map(sorted))
    watch, at = SilenceWatch(began_ns), 0
    told_ns = []
    for passed_ns in range(look_ns, 80 * look_ns, look_ns):
        while at < len(heard_ns) and heard_ns[at] <= passed_ns:
            watch.heard, at = True, at + 1
        if watch.is_lost(began_ns + passed_ns, timeout_ms * 1e-3):
            told_ns.append((passed_ns, at))
    # After the last sample, and in each pause that lasts so long.
    for now_ns, count in told_ns:
        silent_ns = now_ns - (heard_ns[count - 1] if count else 0)
        assert 0.75 * timeout_ms * MS <= silent_ns <= 0.9 * timeout_ms * MS
    assert told_ns[-1][1] == len(heard_ns)
    assert len({count for _, count in told_ns}) == len(told_ns)


def test_after_a_loss_samples_are_waited_for_again():
    watch = SilenceWatch(0)
    assert watch.is_lost(1000 * MS, 1.0)
    assert not watch.is_lost(5000 * MS, 1.0)
    watch.heard = True
    assert not watch.is_lost(5100 * MS, 1.0)
    assert not watch.is_lost(5800 * MS, 1.0)
    assert watch.is_lost(5900 * MS, 1.0)


def test_a_clock_that_is_set_back_begins_the_timeout_again():
    watch = SilenceWatch(9000 * MS)
    assert not watch.is_lost(9700 * MS, 1.0)
    assert not watch.is_lost(100 * MS, 1.0)
    assert not watch.is_lost(800 * MS, 1.0)
    assert watch.is_lost(900 * MS, 1.0)


def test_a_clock_that_stands_still_loses_nothing():
    watch = SilenceWatch(5 * MS)
    assert not any(watch.is_lost(5 * MS, 1.0) for _ in range(100))
