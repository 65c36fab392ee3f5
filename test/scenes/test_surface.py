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

"""Texture and roughness: what is asked for, and read as a sensor that passes over them does."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from slip_detector.scenes.surface import (
    PROFILE_POINTS,
    Roughness,
    Texture,
    ridges_between,
    roughness_between,
)

RIDGES = st.builds(
    lambda period_m, share, harmonics, seed: Texture(
        spatial_period_m=period_m,
        ridge_height_m=0.999 * share * 100e-6 / (1.0 + sum(map(abs, harmonics))),
        harmonics=tuple(harmonics),
        indentation_m=100e-6,
    ).ridges(np.random.default_rng(seed)),
    st.floats(1e-6, 1e-2),
    st.floats(0.1, 1.0),
    st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2),
    st.integers(0, 5),
)
ROUGH = [
    Roughness(height_rms_m=1e-6, correlation_m=length_m, indentation_m=1e-3, surface_seed=seed)
    for length_m, seed in [(1e-5, 1), (1e-4, 2)]
]

#: The function of a surface, its numbers, and the distance of ridges or of points of the profile.
SURFACES = st.one_of(
    RIDGES.map(lambda ridges: (ridges_between, ridges, 2.0 * np.pi / ridges.wavenumber_rad_m)),
    st.sampled_from(
        [(roughness_between, rough, 1.0 / rough.per_m) for rough in map(Roughness.profile, ROUGH)]
    ),
)


@given(SURFACES, st.floats(-20.0, 20.0), st.floats(-30.0, 30.0))
def test_the_mean_over_a_way_is_that_of_its_points(surface, start, way):
    between, numbers, distance_m = surface
    assume(abs(way) > 1e-3)
    edges = sorted([start, start + way])
    kinks = np.arange(np.ceil(edges[0]), edges[1])
    area, _ = quad(
        lambda x: between(x * distance_m, x * distance_m, numbers), *edges,
        limit=200, points=kinks if kinks.size else None,
    )  # fmt: skip
    mean = between(start * distance_m, (start + way) * distance_m, numbers)
    assert mean == pytest.approx(area / abs(way), abs=1e-9)


@given(RIDGES, st.floats(-1.0, 1.0))
def test_ridges_are_those_of_the_fourier_series(ridges, x_periods):
    x_m = x_periods * 2.0 * np.pi / ridges.wavenumber_rad_m
    angle = ridges.wavenumber_rad_m * x_m + ridges.start_rad
    wanted = sum(a * np.sin((k + 1) * angle) for k, a in enumerate(ridges.amplitudes))
    assert ridges_between(x_m, x_m, ridges) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize('rough', ROUGH)
def test_roughness_has_the_rms_that_is_asked_for_no_mean_and_a_gaussian_correlation(rough):
    numbers = rough.profile()
    heights = numbers.heights * rough.indentation_m
    assert heights.std() == pytest.approx(rough.height_rms_m)
    assert heights.mean() == pytest.approx(0.0, abs=1e-12 * rough.height_rms_m)
    x_m = np.arange(0.0, PROFILE_POINTS / numbers.per_m, rough.correlation_m / 4.0)
    heights = np.array([roughness_between(x, x, numbers) for x in x_m])
    heights = (heights - heights.mean()) / heights.std()
    for lag in (2, 4, 8):  # Halves of a correlation length, a whole, and two.
        correlation = np.mean(heights * np.roll(heights, lag))
        assert correlation == pytest.approx(np.exp(-((lag / 4.0) ** 2)), abs=0.1)
