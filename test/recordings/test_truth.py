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

"""Truth: what labels, states and positions say of each row."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.truth import PlatformMotion, as_truth, states_at


@given(st.lists(st.booleans(), max_size=8), st.data())
def test_a_state_holds_until_the_next(states, data):
    steps = data.draw(st.lists(st.integers(1, 5), min_size=len(states), max_size=len(states)))
    changes = np.cumsum(np.array(steps, dtype=np.int64))
    at = np.arange(-1, int(changes[-1]) + 3 if len(states) else 3)
    wanted = [
        bool(
            [state for when, state in zip(changes, states, strict=True) if when <= t][-1:]
            == [True]
        )
        for t in at
    ]
    np.testing.assert_array_equal(states_at(changes, np.array(states, bool), at), wanted)


@given(st.lists(st.sampled_from([0.0, 1.0]), min_size=1, max_size=25), st.data())
def test_motion_lies_between_positions_that_differ_in_any_cut(positions, data):
    n = len(positions)
    position_m = np.array(positions)[:, np.newaxis]
    stamps_ns = np.arange(n) * 10
    motion = PlatformMotion(0.0)
    cuts = sorted(data.draw(st.lists(st.integers(0, n), max_size=4)))
    for begin, end in zip([0, *cuts], [*cuts, n], strict=True):
        if begin < end:
            motion.add(stamps_ns[begin:end], position_m[begin:end])
    moved = np.diff(positions) != 0
    at = np.arange(-5, 10 * n + 5)
    wanted = np.zeros(len(at), bool)
    for k in np.flatnonzero(moved):
        wanted |= (at >= 10 * k) & (at <= 10 * (k + 1))
    np.testing.assert_array_equal(motion.at(at), wanted)


@pytest.mark.parametrize('dtype', [bool, int, float, np.uint8])
@pytest.mark.parametrize('shape', [(4,), (4, 1)])
def test_labels_of_0_and_1_are_taken_whatever_their_type(dtype, shape, tmp_path):
    label = np.array([0, 1, 1, 0]).astype(dtype).reshape(shape)
    assert as_truth(label, 'slip', tmp_path).tolist() == [False, True, True, False]


@pytest.mark.parametrize('wrong', [np.nan, 2.0, -1.0, 'True'])
def test_a_label_that_is_neither_is_named(wrong, tmp_path):
    label = np.array([0.0, wrong]) if isinstance(wrong, float) else np.array([wrong, wrong])
    with pytest.raises(ValueError, match=rf"slip has '?{wrong}'?, allowed: 0 and 1"):
        as_truth(label, 'slip', tmp_path / 'a.npz')
