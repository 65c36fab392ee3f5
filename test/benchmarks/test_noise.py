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

"""The noise that the benchmarks let the chain decide on."""

import numpy as np
import pytest

from benchmarks.noise import BASELINE_V, NOISE_V, swelling_noise_v


def test_it_swells_once_in_a_period_around_the_baseline():
    volts = swelling_noise_v(400, 2000, period_rows=200) - BASELINE_V
    assert volts.shape == (400, 2000)
    size_v = volts.std(axis=1)
    for period in np.split(size_v, 2):
        # It is largest after a quarter of the period, and fades away after three.
        assert period[50] == pytest.approx(2 * NOISE_V, rel=0.1)
        assert period[150] < 1e-9
    assert abs(volts.mean(axis=1)).max() < 6 * 2 * NOISE_V / np.sqrt(2000)


def test_a_seed_makes_the_same_noise_again_and_another_one_other_noise():
    first, again, other = (swelling_noise_v(10, 3, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()
