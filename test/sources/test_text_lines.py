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

"""Streams of bytes, and lines of text: what was sent is decoded, and nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.packets import LineDecoder

MIXED_TEXT = st.lists(
    st.sampled_from([b'1', b'.5', b',', b'\n', b'\r\n', b'-', b'e9', b' ', b'nan', b'\0', b'\xff'])
).map(b''.join)


def rows(decoded, channels=3):
    return np.concatenate([np.empty((0, channels)), *(samples.volts for samples in decoded)])


def test_lines_are_read_as_people_write_them():
    receiver = LineDecoder(3, 0.0)
    text = b'rest of a line\n1,2,3\r\n -1.5e-3 ,\t+.5, 4.\n\n\r\n0,0,1E2\n'
    received = receiver.feed(text)
    assert rows(received).tolist() == [[1, 2, 3], [-1.5e-3, 0.5, 4], [0, 0, 100]]
    assert not any(len(r.stamps_ns) for r in received)
    assert receiver.counts == {'samples': 3, 'partial': 1, 'garbage_bytes': 14}


@pytest.mark.parametrize(
    ('line', 'reason'),
    [
        (b'1,2', 'channels'),
        (b',1,2', 'numbers'),
        (b'1,2,3 4', 'numbers'),
        (b'1,2,1_0', 'numbers'),
        (b'1,2,nan', 'numbers'),
        (b'1,2,1e999', 'numbers'),
        (b'1,2,3\0', 'numbers'),
        (b'1.0,2.0,3.1.0,2.0,3.0', 'numbers'),
        (b'1,2,' + b'3' * 200, 'overlong'),
    ],
)
def test_a_line_that_is_no_sample_is_dropped_and_counted(line, reason):
    receiver = LineDecoder(3, 0.0)
    received = receiver.feed(b'\n' + line + b'\n7,8,9\n')
    assert rows(received).tolist() == [[7, 8, 9]]
    assert receiver.counts[reason] == 1
    assert receiver.counts['garbage_bytes'] == len(line)


def test_a_long_line_that_is_nearly_right_is_refused_at_once():
    receiver = LineDecoder(16, 0.0)
    # A pattern that can match a number in several ways would try them all: 25 ** 16.
    assert receiver.feed(b'\n' + b','.join([b'1' * 25] * 16) + b'x\n') == []
    assert receiver.feed(b' ' * 400 + b'x\n') == []
    assert receiver.counts['numbers'] == 2


@given(MIXED_TEXT, st.lists(st.integers(0, 30)))
def test_any_cut_of_the_text_gives_the_same_samples_and_counts(text, cuts):
    text += b'\n1,2,3\n' + b'9' * 150 + b'\n4,5,6\n'
    whole, piecewise = LineDecoder(3, 100.0), LineDecoder(3, 100.0)
    wanted = whole.feed(text)
    received, at = [], 0
    for cut in [*cuts, len(text)]:
        received += piecewise.feed(text[at : at + cut])
        at += cut
    np.testing.assert_array_equal(rows(received), rows(wanted))
    assert [r.stamps_ns.tolist() for r in received] == [r.stamps_ns.tolist() for r in wanted]
    assert piecewise.counts == whole.counts


def test_lines_at_a_rate_have_times_that_restart_after_an_interruption():
    receiver = LineDecoder(1, 400.0)
    received = receiver.feed(b'\n1\n2\n3')
    receiver.restart()
    received += receiver.feed(b'4\n5\n6\n')
    assert rows(received, 1)[:, 0].tolist() == [1, 2, 5, 6]
    assert [r.new_stretch for r in received] == [True, False, True, False]
    assert np.diff([r.stamps_ns[0] for r in received])[[0, 2]].tolist() == [2_500_000] * 2
