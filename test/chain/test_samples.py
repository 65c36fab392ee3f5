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

"""Samples: what is taken apart and put together again is the same."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples


def some(n, truth):
    rng = np.random.default_rng(n)
    slip = rng.random(n) < 0.5
    position_m = np.cumsum(slip) * 1e-3
    known = (slip, position_m) if truth else ()
    return Samples(rng.normal(size=(n, 2)), np.arange(n) * 10, *known)


@given(st.integers(0, 30), st.integers(0, 30), st.booleans())
def test_parts_of_samples_joined_are_the_samples(n, cut, truth):
    samples = some(n, truth)
    again = samples.take(slice(cut)).then(samples.take(slice(cut, None)))
    for field, of_again in zip(samples, again, strict=True):
        np.testing.assert_array_equal(field, of_again)


def test_truth_and_position_that_one_part_lacks_are_not_known_of_both():
    for first, second in ((True, False), (False, True)):
        both = some(3, first).then(some(2, second))
        assert both.truth is None
        assert both.position_m is None
