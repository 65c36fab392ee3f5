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

import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from slip_detector.scenes.texture import Texture, ridges_between

RIDGES = st.builds(
    lambda period_m, share, harmonics, seed: Texture(
        spatial_period_m=period_m,
        ridge_height_m=0.999 * share * 100e-6 / (1.0 + sum(map(abs, harmonics))),
        harmonics=tuple(harmonics),
        indentation_m=100e-6,
    ).numbers(np.random.default_rng(seed)),
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


@given(RIDGES, st.floats(-1.0, 1.0), st.integers(-5, 5))
def test_ridges_repeat_at_the_spatial_period(ridges, x_periods, turns):
    period_m = 2.0 * np.pi / ridges.wavenumber_rad_m
    one, other = (ridge((x_periods + by) * period_m, ridges) for by in (0, turns))
    assert one == pytest.approx(other, abs=1e-11)


@given(RIDGES, st.floats(-2.0, 2.0), st.floats(-5.0, 5.0))
def test_the_mean_of_ridges_over_a_way_is_that_of_their_points(ridges, start, way):
    assume(abs(way) > 1e-3)
    period_m = 2.0 * np.pi / ridges.wavenumber_rad_m
    wanted, _ = quad(lambda x: ridge(x * period_m, ridges), start, start + way, limit=200)
    mean = ridges_between(start * period_m, (start + way) * period_m, ridges)
    assert mean == pytest.approx(wanted / way, abs=1e-9)


@given(RIDGES, st.floats(-1.0, 1.0))
def test_over_a_whole_period_ridges_have_no_mean(ridges, start):
    period_m = 2.0 * np.pi / ridges.wavenumber_rad_m
    mean = ridges_between(start * period_m, (start + 1.0) * period_m, ridges)
    assert mean == pytest.approx(0.0, abs=1e-12)


@given(RIDGES, st.floats(-1.0, 1.0))
def test_the_mean_of_ridges_goes_over_into_the_height_as_the_way_shrinks(ridges, start):
    x_m = start * 2.0 * np.pi / ridges.wavenumber_rad_m
    for part in 10.0 ** -np.arange(3.0, 13.0):
        by_m = 0.5 * part / ridges.wavenumber_rad_m
        assert ridges_between(x_m - by_m, x_m + by_m, ridges) == pytest.approx(
            ridge(x_m, ridges), abs=30.0 * part**2 + 1e-11
        )


@given(st.floats(1e-6, 1e-2), st.floats(1e-4, 0.1))
def test_ridges_pass_at_velocity_over_spatial_period(period_m, velocity_m_s):
    texture = Texture(
        spatial_period_m=period_m, ridge_height_m=1e-6, harmonics=(0.0, 0.0), indentation_m=1e-3
    )
    ridges = texture.numbers(np.random.default_rng(0))
    # One turn of this time, from wherever it starts, and the next are alike.
    turn_s = period_m / velocity_m_s
    time_s = np.linspace(0.0, turn_s, 64, endpoint=False)
    heights = np.array([ridge(velocity_m_s * t, ridges) for t in time_s])
    spectrum = np.abs(np.fft.rfft(heights))
    assert np.argmax(spectrum) == 1
    assert spectrum[1] == pytest.approx(32 * 1e-3)


def test_the_highest_wavenumber_is_that_of_the_last_harmonic():
    texture = Texture(
        spatial_period_m=1e-3, ridge_height_m=1e-6, harmonics=(0.0, 0.5), indentation_m=1e-3
    )
    assert texture.highest_wavenumber_1_m == pytest.approx(3e3)


def test_each_trial_puts_the_plate_down_elsewhere_on_its_ridges():
    texture = Texture()
    starts = [texture.numbers(np.random.default_rng(seed)).start_rad for seed in range(20)]
    assert len(set(starts)) == 20
    assert np.ptp(starts) > np.pi
    assert min(starts) >= 0.0
    assert max(starts) < 2.0 * np.pi
    assert texture.numbers(np.random.default_rng(3)).start_rad == starts[3]


@pytest.mark.parametrize(('height_m', 'harmonics'), [(2e-4, (0.0, 0.0)), (6e-5, (0.5, -0.5))])
def test_ridges_that_would_lift_a_taxel_off_are_refused(height_m, harmonics):
    said = f'parameter ridge_height_m is {height_m:g} m, allowed: with its harmonics at most'
    with pytest.raises(ValueError, match=re.escape(said)):
        Texture(ridge_height_m=height_m, harmonics=harmonics, indentation_m=1e-4)


@pytest.mark.parametrize('harmonics', [(), (0.5,), (0.1, 0.1, 0.1)])
def test_ridges_may_have_any_number_of_harmonics(harmonics):
    ridges = Texture(ridge_height_m=1e-6, harmonics=harmonics, indentation_m=1e-3).numbers(
        np.random.default_rng(0)
    )
    np.testing.assert_allclose(ridges.amplitudes, [1e-3, *(1e-3 * np.array(harmonics))])
