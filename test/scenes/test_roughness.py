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

"""Roughness: a profile with the height, the correlation and the mean that are asked for."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from slip_detector.scenes.surface import PROFILE_POINTS, Roughness, roughness_between

ROUGH = [
    Roughness(height_rms_m=1e-6, correlation_m=length_m, indentation_m=1e-3, surface_seed=seed)
    for length_m, seed in [(1e-5, 1), (1e-4, 2)]
]
ROUGH_NUMBERS = [rough.profile() for rough in ROUGH]


def height(x_m, rough):
    return roughness_between(x_m, x_m, rough)


@pytest.mark.parametrize('rough', ROUGH)
def test_roughness_has_the_rms_that_is_asked_for_and_no_mean(rough):
    heights = rough.profile().heights * rough.indentation_m
    assert heights.std() == pytest.approx(rough.height_rms_m)
    assert heights.mean() == pytest.approx(0.0, abs=1e-12 * rough.height_rms_m)


@pytest.mark.parametrize('rough', ROUGH)
def test_roughness_correlates_as_a_gaussian_of_its_length(rough):
    numbers = rough.profile()
    x_m = np.arange(0.0, PROFILE_POINTS / numbers.per_m, rough.correlation_m / 4.0)
    heights = np.array([height(x, numbers) for x in x_m])
    heights = (heights - heights.mean()) / heights.std()
    for lag in (2, 4, 8):  # Halves of a correlation length, a whole, and two.
        correlation = np.mean(heights * np.roll(heights, lag))
        assert correlation == pytest.approx(np.exp(-((lag / 4.0) ** 2)), abs=0.1)


@given(st.sampled_from(ROUGH_NUMBERS), st.floats(-20.0, 20.0), st.floats(-30.0, 30.0))
def test_the_mean_of_roughness_over_a_way_is_that_of_its_points(rough, start, way):
    assume(abs(way) > 1e-3)
    kinks = np.arange(np.ceil(min(start, start + way)), max(start, start + way))
    edges = np.concatenate([[start], np.sort(kinks) if way > 0 else -np.sort(-kinks)])
    edges = np.append(edges, start + way)
    area = sum(
        quad(lambda x: height(x / rough.per_m, rough), a, b)[0]
        for a, b in itertools.pairwise(edges)
    )
    mean = roughness_between(start / rough.per_m, (start + way) / rough.per_m, rough)
    assert mean == pytest.approx(area / way, abs=1e-12)
