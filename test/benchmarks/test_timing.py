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

"""Times of things that take turns."""

from benchmarks.timing import least_times_s


def test_the_sides_take_turns():
    order = []
    times_s = least_times_s([lambda: order.append('a'), lambda: order.append('b')], 3)
    assert order == ['a', 'b'] * 4
    assert len(times_s) == 2
    assert all(0 <= time_s < 1 for time_s in times_s)


def test_the_time_is_that_of_the_clock():
    ticks = iter(range(100))
    times_s = least_times_s([lambda: None, lambda: next(ticks)], 2, clock=lambda: next(ticks))
    assert times_s == [1, 2]
