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

"""Stamps of samples: the sender's own spacing, on the receiver's clock."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.sources.live import SLEW, STEP_NS, WINDOW_NS, DeviceClock

PERIOD_NS = 1_000_000

#: What the receiver's clock shows when the sender's shows zero.
OFFSET_NS = 1_700_000_000_000_000_000


def stamps_ns(clock, delays_ns, batch=1, drift=0.0, offset_ns=OFFSET_NS):
    """Send a sample each period, in batches, each delayed; returns stamps and true times."""
    stamps, true = [], []
    for k, delay_ns in enumerate(delays_ns):
        at = [(k * batch + i) * PERIOD_NS for i in range(batch)]
        true += [offset_ns + round(t * (1 + drift)) for t in at]
        stamps += clock.stamps_ns(at, true[-1] + delay_ns).tolist()
    return np.array(stamps), np.array(true)


@given(st.lists(st.integers(0, 100_000_000), min_size=2, max_size=300), st.integers(1, 10))
def test_the_spacing_is_the_senders_whatever_the_delays(delays_ns, batch):
    stamps, _ = stamps_ns(DeviceClock(), delays_ns, batch)
    assert np.all(np.abs(np.diff(stamps) - PERIOD_NS) <= SLEW * PERIOD_NS + 2)


@pytest.mark.parametrize('drift', [-1e-2, -1e-4, 1e-4, 1e-2])
def test_a_clock_at_another_rate_is_followed(drift):
    rng = np.random.default_rng(2)
    delays_ns = rng.integers(0, 5_000_000, 20_000).tolist()
    stamps, true = stamps_ns(DeviceClock(), delays_ns, drift=drift)
    # The estimate is at most two windows old, in which the clocks drift apart.
    off_ns = np.abs(stamps - true)[5000:]
    assert off_ns.max() < 2 * WINDOW_NS * abs(drift) + 100_000
    assert np.all(np.diff(stamps) > 0)


@pytest.mark.parametrize('step_ns', [-3600 * 10**9, -2 * STEP_NS, 2 * STEP_NS, 3600 * 10**9])
def test_stamps_follow_a_clock_that_is_set(step_ns):
    clock = DeviceClock()
    samples = 2 * (2 * WINDOW_NS // PERIOD_NS) + 10
    stamps, true = [], []
    for k in range(2 * samples):
        at_ns = k * PERIOD_NS
        true.append(OFFSET_NS + at_ns + (step_ns if k >= samples else 0))
        stamps += clock.stamps_ns([at_ns], true[-1]).tolist()
    np.testing.assert_array_equal(stamps[:samples], true[:samples])
    assert stamps[-1] == true[-1]
    steps = np.diff(stamps)
    assert np.count_nonzero(steps != PERIOD_NS) == 1
    assert steps[steps != PERIOD_NS] == step_ns + PERIOD_NS


def test_samples_without_times_are_stamped_when_they_arrive():
    clock, one = DeviceClock(), Samples(np.zeros((1, 2)), np.empty(0, np.int64))
    assert clock.stamp([one] * 3, 2, arrival_ns=700).stamps_ns.tolist() == [700, 701, 702]
    assert clock.stamp([one], 2, arrival_ns=900).stamps_ns.tolist() == [900]


def test_a_receivers_clock_that_was_set_back_begins_stamps_again():
    clock = DeviceClock()
    first = clock.stamps_ns([0], OFFSET_NS)
    assert clock.stamps_ns([PERIOD_NS], OFFSET_NS - STEP_NS)[0] > first[0]
    assert clock.stamps_ns([2 * PERIOD_NS], OFFSET_NS - 4 * STEP_NS)[0] < first[0]
