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

"""Events on the log: all are counted, few are written."""

import itertools
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from slip_detector.nodes.event_log import LOG_PERIOD_NS, EventLog


@given(
    st.lists(
        st.tuples(
            st.sampled_from(('channels', 'bridged')), st.integers(1, 9), st.integers(0, 10**9)
        )
    )
)
def test_all_are_counted_and_a_kind_is_written_once_a_second(events):
    totals, written = Counter(rows=5), {'channels': [], 'bridged': []}
    log = EventLog(totals, lambda line: written[line.split()[0]].append((now_ns, line)))
    now_ns = 10**15
    first = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('time.monotonic_ns', lambda: now_ns)
        for kind, count, passed_ns in events:
            now_ns += passed_ns
            first.setdefault(kind, (now_ns, f'{kind} lost ({count} so far)'))
            log.note(kind, f'{kind} lost', count)
    assert totals['rows'] == 5
    for kind, lines in written.items():
        assert totals[kind] == sum(count for of, count, _ in events if of == kind)
        assert lines[:1] == [first[each] for each in (kind,) if each in first]
        assert all(b - a >= LOG_PERIOD_NS for (a, _), (b, _) in itertools.pairwise(lines))


def test_a_line_tells_how_many_there_were_meanwhile(monkeypatch):
    now_ns, lines = 0, []
    monkeypatch.setattr('time.monotonic_ns', lambda: now_ns)
    log = EventLog(Counter(), lines.append)
    for _ in range(5):
        log.note('names', 'other names')
    now_ns += LOG_PERIOD_NS
    log.note('names', 'other names')
    assert lines == ['other names (1 so far)', 'other names (6 so far)']
