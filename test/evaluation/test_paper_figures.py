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

"""The paper's figures against their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.evaluation.figures import (
    TrueSlip,
    first_on_delay_s,
    mean_and_sd,
    paper_figures,
    percent,
)


def test_the_delay_runs_from_the_start_of_slip_to_the_first_on_after_it():
    on = [True, False, False, True, True]
    time_s = [0.0, 0.5, 1.0, 1.5, 2.0]
    assert first_on_delay_s(on, time_s, 0.25) == 1.25
    assert first_on_delay_s(on, time_s, 1.5) == 0.0  # At the start counts.
    assert first_on_delay_s(on, time_s, 0.0) == 0.0
    assert first_on_delay_s(on, time_s, 2.1) is None
    assert first_on_delay_s([False] * 5, time_s, 0.0) is None
    assert first_on_delay_s([], [], 0.0) is None


@given(
    st.lists(st.booleans(), min_size=1, max_size=30),
    st.floats(-1, 31).map(lambda x: round(x, 2)),
)
def test_nothing_is_on_between_the_start_of_slip_and_its_delay(on, start_s):
    time_s = np.arange(len(on), dtype=float)
    delay_s = first_on_delay_s(on, time_s, start_s)
    after = np.array(on) & (time_s >= start_s)
    assert (delay_s is None) == (not after.any())
    if delay_s is not None:
        assert delay_s >= 0.0
        at = round(start_s + delay_s)
        assert start_s + delay_s == pytest.approx(at)
        assert after[at]
        assert not after[:at].any()


def test_the_mean_delay_is_over_the_channels_that_have_one():
    mean, sd = mean_and_sd([0.03, None, 0.05, 0.04, None])
    assert mean == pytest.approx(0.04)
    assert sd == pytest.approx(0.01)


def test_mean_and_deviation_of_too_few_delays_are_not_defined():
    assert mean_and_sd([]) == (None, None)
    assert mean_and_sd([None, None]) == (None, None)
    assert mean_and_sd([None, 0.02]) == (0.02, None)


@given(st.integers(0, 50), st.integers(0, 50))
def test_a_share_is_a_percentage_of_something(part, more):
    share = percent(part, part + more)
    if part + more:
        assert 0.0 <= share <= 100.0
        assert share == pytest.approx(100.0 - percent(more, part + more))
    else:
        assert share is None


def slip(delay_s, on_while):
    return TrueSlip(
        start_s=1.0, end_s=2.0, alarm=None, latency_s=None, settling=False, lead_s=0.0,
        window_s=1.1, late=False, stages_s=None, lost_at=None, on_at_start=False,
        on_while=on_while, channel_delays_s=(delay_s,), delay_s=delay_s,
    )  # fmt: skip


def test_the_papers_figures_by_hand():
    slips = [slip(0.03, True), slip(0.05, False), slip(None, True), slip(0.04, True)]
    assert paper_figures(slips, on_rows=3, rest_rows=60) == pytest.approx(
        {
            'mean_delay_ms': 40.0,
            'sd_delay_ms': 10.0,  # n - 1
            'success_percent': 75.0,
            'false_positive_percent': 5.0,
        }
    )


def test_figures_of_nothing_are_none_and_never_zero():
    assert set(paper_figures([], 0, 0).values()) == {None}
    one = paper_figures([slip(0.03, False)], 0, 10)
    assert (one['mean_delay_ms'], one['sd_delay_ms']) == (pytest.approx(30.0), None)
    assert (one['success_percent'], one['false_positive_percent']) == (0.0, 0.0)
