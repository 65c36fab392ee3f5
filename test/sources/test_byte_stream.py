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

"""A stream of bytes, cut at a delimiter."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.byte_stream import ByteSplitter

LONGEST = 5


@given(st.lists(st.text('ab,', max_size=12).map(str.encode)))
def test_pieces_and_counts_are_those_of_the_whole_stream_however_it_is_cut(parts):
    stream = b''.join(parts)
    *complete, incomplete = stream.split(b',')
    counts = Counter()
    splitter = ByteSplitter(b',', LONGEST, counts)
    pieces = [piece for part in parts for piece in splitter.feed(part)]
    assert pieces == [piece for piece in complete if len(piece) <= LONGEST]
    overlong = [piece for piece in complete if len(piece) > LONGEST]
    assert counts['overlong'] == len(overlong)
    splitter.restart()
    assert counts['garbage_bytes'] == sum(map(len, overlong)) + len(incomplete)


def test_after_a_restart_the_incomplete_piece_is_not_continued():
    splitter = ByteSplitter(b',', LONGEST, Counter())
    assert list(splitter.feed(b'ab')) == []
    splitter.restart()
    assert list(splitter.feed(b'cd,')) == [b'cd']
