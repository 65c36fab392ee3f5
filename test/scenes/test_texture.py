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

"""Texture: ridges as a sensor that passes over them reads them."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from slip_detector.scenes.surface import Texture, ridges_between

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


def ridge(x_m, ridges):
    """Return the height at a place: a way of no length."""
    return ridges_between(x_m, x_m, ridges)


@given(RIDGES, st.floats(-1.0, 1.0))
def test_ridges_are_those_of_the_fourier_series(ridges, x_periods):
    x_m = x_periods * 2.0 * np.pi / ridges.wavenumber_rad_m
    angle = ridges.wavenumber_rad_m * x_m + ridges.start_rad
    wanted = sum(a * np.sin((k + 1) * angle) for k, a in enumerate(ridges.amplitudes))
    assert ridge(x_m, ridges) == pytest.approx(wanted, abs=1e-12)


@given(RIDGES, st.floats(-2.0, 2.0), st.floats(-5.0, 5.0))
def test_the_mean_of_ridges_over_a_way_is_that_of_their_points(ridges, start, way):
    assume(abs(way) > 1e-3)
    period_m = 2.0 * np.pi / ridges.wavenumber_rad_m
    wanted, _ = quad(lambda x: ridge(x * period_m, ridges), start, start + way, limit=200)
    mean = ridges_between(start * period_m, (start + way) * period_m, ridges)
    assert mean == pytest.approx(wanted / way, abs=1e-9)
