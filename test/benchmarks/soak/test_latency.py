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

"""Which received change belongs to which sample."""

import pytest

from benchmarks.soak.latency import latencies_of_changes_ns

STAMPS_NS = [0, 100, 200, 300]


STATES = [True, False, True, False]


@pytest.mark.parametrize(
    ('received', 'wanted'),
    [
        ([(5, True), (106, False), (207, True), (308, False)], [5, 6, 7, 8]),
        # A stall: all arrive, the first ones after the next ones were sent.
        ([(290, True), (291, False), (292, True), (308, False)], [290, 191, 92, 8]),
        # Lost changes go in pairs: the one back is no change to who missed the one there.
        ([(207, True), (308, False)], [None, None, 7, 8]),
        ([(5, True), (308, False)], [5, None, None, 8]),
        ([(5, True), (106, False)], [5, 6, None, None]),
        ([], [None, None, None, None]),
    ],
)
def test_each_receipt_is_matched_to_its_sample(received, wanted):
    assert latencies_of_changes_ns(STAMPS_NS, STATES, received) == wanted
