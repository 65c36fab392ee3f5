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

"""Pieces: each of their rows is one of the recording, in order, however the stamps jump."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings import open_recording
from support.recorded import RATE_HZ, save_rows

STEPS = st.lists(st.sampled_from([1, 1, 1, 2, 5, 9, 30, 0, -2]), min_size=1, max_size=40)


@given(STEPS)
def test_each_row_of_a_piece_is_that_row_of_the_recording(tmp_path_factory, steps):
    stamps_ns = np.cumsum([0, *steps]) * round(1e9 / RATE_HZ)
    volts = np.random.default_rng(0).normal(size=(len(stamps_ns), 2))
    truth = np.arange(len(stamps_ns)) % 3 == 0
    path = save_rows(tmp_path_factory.mktemp('any') / 'a.npz', volts, stamps_ns, slip=truth)
    pieces = list(open_recording(path).pieces(max_gap_s=0.1))
    rows = np.concatenate([piece.row_numbers for piece in pieces])
    assert rows[0] == 0
    assert (np.diff(rows) >= 0).all()
    np.testing.assert_array_equal(np.concatenate([piece.volts for piece in pieces]), volts[rows])
    np.testing.assert_array_equal(np.concatenate([piece.truth for piece in pieces]), truth[rows])
    assert pieces[0].new_stretch
    for before, piece in itertools.pairwise(pieces):
        gap_s = (piece.stamps_ns[0] - before.stamps_ns[-1]) * 1e-9
        # A gap of up to 0.1 s is bridged: from then on there is one period from row to row.
        assert piece.new_stretch == (gap_s > 0.1)
