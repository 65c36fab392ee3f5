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

"""The rate of rows: jitter is averaged, gaps do not count."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.rate import RATE_TOLERANCE, checked_rate, rate_of, rates_differ

RATES_HZ = st.floats(0.1, 1e4)


@given(RATES_HZ, st.integers(2, 200), st.floats(-1e6, 1e6))
def test_even_stamps_have_their_rate_wherever_they_begin(rate_hz, n, start_s):
    stamps_s = start_s + np.arange(n) / rate_hz
    assert rate_of(stamps_s) == pytest.approx(rate_hz, rel=1e-5)


@given(RATES_HZ, st.integers(0, 99), st.floats(0.0, 0.3))
def test_jitter_is_averaged(rate_hz, seed, jitter):
    moved = jitter * np.random.default_rng(seed).uniform(-0.5, 0.5, 500)
    assert rate_of((np.arange(500) + moved) / rate_hz) == pytest.approx(rate_hz, rel=2e-3)


@given(RATES_HZ, st.lists(st.integers(0, 98), max_size=5, unique=True), st.floats(3.0, 1e4))
def test_gaps_and_steps_back_do_not_count(rate_hz, places, periods):
    steps = np.ones(99)
    steps[places] = periods
    stamps_s = np.concatenate([[0.0], np.cumsum(steps)]) / rate_hz
    assert rate_of(stamps_s) == pytest.approx(rate_hz, rel=1e-9)
    assert rate_of(np.concatenate([stamps_s, stamps_s])) == pytest.approx(rate_hz, rel=1e-9)


@pytest.mark.parametrize('stamps_s', [[], [1.0], [1.0, 1.0, 1.0], [3.0, 2.0, 1.0]])
def test_without_two_stamps_that_rise_there_is_no_rate(stamps_s):
    assert rate_of(np.array(stamps_s)) is None


@given(st.floats(1.0, 1e6), st.floats(-0.9, 10.0))
def test_rates_differ_by_more_than_the_tolerance_of_the_chains(chain_rate_hz, off):
    if abs(abs(off) - RATE_TOLERANCE) > 1e-9:
        assert rates_differ((1.0 + off) * chain_rate_hz, chain_rate_hz) == (
            abs(off) > RATE_TOLERANCE
        )


def test_a_rate_is_one_that_a_chain_can_have():
    path = Path('trial.npz')
    for rate_hz in (1.0, 380.0, 1e6):
        assert checked_rate(rate_hz, path) == rate_hz
    for rate_hz in (5e-324, 1e-300, 0.999, 1.001e6, 3.8e8, 1e300, np.inf, np.nan, -380.0, 0.0):
        with pytest.raises(ValueError, match=r'^trial\.npz: has .* Hz, allowed: 1 to 1e\+06 Hz$'):
            checked_rate(rate_hz, path)


def test_steps_too_short_for_a_float_are_infinitely_fast():
    assert rate_of(np.array([0.0, 5e-324])) == np.inf
