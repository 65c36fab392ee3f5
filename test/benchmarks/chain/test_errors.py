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

"""The inputs of the precision, and the errors."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.chain.errors import STEP_V, quantised, run_reference, tones_v, worst_error
from slip_detector.parameters.detector import ChainConfig


def test_samples_are_exact_in_float32_and_swell_and_fade():
    samples = tones_v(ChainConfig(), 2000, channels=3)
    assert samples.shape == (2000, 3)
    np.testing.assert_array_equal(samples.astype(np.float32).astype(np.float64), samples)
    thirds = np.array_split(samples, 6)
    assert np.ptp(thirds[1]) > 2.0 * np.ptp(samples[:60])


@given(st.floats(-10.0, 10.0))
def test_quantising_moves_a_value_by_half_a_step_at_most(value):
    quantum = quantised(np.array(value))
    assert abs(quantum - value) <= 0.5 * STEP_V
    assert float(quantum / STEP_V).is_integer()


def test_the_error_is_that_of_the_sum_of_both_parts():
    near, rest = np.array([1.0, 2.0]), np.array([0.0, 1e-20])
    assert worst_error(near, (near, rest)) == 0.5e-20
    assert worst_error(np.array([1.0, np.nan]), (near, rest)) is None
    assert worst_error(np.array([1.0, np.inf]), (near, rest)) is None


def test_the_reference_runs_its_own_design_unless_sections_are_given():
    config = ChainConfig(channels=1)
    samples = tones_v(config, 40)[:, 0]
    own = run_reference(config, samples)
    silent = run_reference(config, samples, [(0, 0, 0, 0, 0)])
    assert own.level[0].max() > 0.0
    assert silent.level[0].max() == 0.0
