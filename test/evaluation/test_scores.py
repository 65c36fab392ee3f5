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

"""Scores are counted by kind, and the area under the ROC curve is its definition's."""

import numpy as np
import pytest
from evaluation.reference_scores import area
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.evaluation.scores import MOTION, REST, SLIP, ScoreCounts, ScoreTally

TALLY = ScoreTally()


def counted(score, kind):
    TALLY.add(score, kind)
    return TALLY.collect()


KINDS = st.sampled_from([REST, MOTION, SLIP])
SCORED = st.lists(
    st.tuples(st.integers(0, 6).map(float) | st.floats(1e-30, 1e30), KINDS), max_size=30
)


@given(SCORED)
def test_auc_is_the_share_of_pairs_in_order_and_ties_count_half(rows):
    score, kind = np.array([s for s, _ in rows]), np.array([k for _, k in rows])
    counts = counted(score, kind)
    for against in ([REST, MOTION], [MOTION]):
        expected, error = area(score, kind == SLIP, np.isin(kind, against))
        wanted = None if expected is None else pytest.approx(expected, abs=error)
        assert counts.auc(against) == wanted


def test_scores_beyond_all_bounds_are_still_ordered():
    # 0 is below all, and what does not fit into 32 bit is above all.
    assert counted([1e60, 0.0, 1e-30, 1e30], [SLIP, REST, REST, REST]).auc() == 1.0
    assert counted([0.0, 1e60, 1e-30], [SLIP, REST, REST]).auc() == 0.0


@given(st.lists(SCORED, max_size=4))
def test_pooled_counts_are_those_of_all_rows(parts):
    pooled = ScoreCounts.pooled([counted([s for s, _ in p], [k for _, k in p]) for p in parts])
    rows = [row for part in parts for row in part]
    whole = counted([s for s, _ in rows], [k for _, k in rows])
    np.testing.assert_array_equal(pooled.bins, whole.bins)
    np.testing.assert_array_equal(pooled.counts, whole.counts)
