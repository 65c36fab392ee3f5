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

"""Rows with their labels: which kind each is, and what time a gap takes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.evaluation.labelled_rows import MOTION, REST, SLIP, LabelledRows, rows_in_gap


@given(hnp.arrays(bool, st.tuples(st.integers(0, 20), st.just(2))), st.booleans())
def test_slip_comes_before_motion_and_motion_before_rest(labels, is_known):
    truth, moving = labels.T
    rows = LabelledRows(np.zeros((len(truth), 1)), truth, moving=moving if is_known else None)
    expected = [
        SLIP if slips else MOTION if moves and is_known else REST
        for slips, moves in labels.tolist()
    ]
    assert rows.kinds.tolist() == expected


@given(st.integers(0, 10_000), st.sampled_from([100.0, 312.5, 380.0, 2000.0]))
def test_a_gap_takes_the_time_of_the_rows_that_are_missing_in_it(missing, rate_hz):
    before = np.array([0, 7_000_000_000])
    after = np.array([7_000_000_000 + round((missing + 1) * 1e9 / rate_hz)])
    assert rows_in_gap(before, after, rate_hz) == missing


@pytest.mark.parametrize('after_ns', [-5_000_000_000, 0, 1])
def test_a_clock_that_was_set_back_does_not_turn_time_back(after_ns):
    assert rows_in_gap(np.array([0]), np.array([after_ns]), 380.0) == 0


def test_without_stamps_nothing_is_known_to_be_missing():
    stamps_ns = np.array([5])
    assert rows_in_gap(None, stamps_ns, 380.0) == rows_in_gap(stamps_ns, None, 380.0) == 0
