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

"""Logarithms, exponents and fractions of float64 in vectors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.compiled import compiled
from slip_detector.chain.lanes import LANES, load, store
from slip_detector.chain.logarithms import (
    DECIBEL_ERROR,
    LEAST_DB,
    MOST_DB,
    exponents,
    fractions,
    polynomial,
    powers_of_2,
    root_decibels,
)


@compiled
def _decibels(values, out):
    for at in range(0, values.size, LANES):
        store(root_decibels(load(values, at)), out, at)


@compiled
def _split(values, exponent, fraction, back):
    of = exponents(load(values, 0))
    store(of, exponent, 0)
    store(fractions(load(values, 0)), fraction, 0)
    store(powers_of_2(of), back, 0)


@compiled
def _cubic(values, out):
    store(polynomial((2.0, 0.0, -1.0, 5.0), load(values, 0)), out, 0)


def decibels(values):
    values = np.asarray(values, np.float64)
    out = np.empty_like(values)
    _decibels(values, out)
    return out


def in_lanes(value):
    return np.full(LANES, value)


@given(st.floats(2.0**-1022, allow_infinity=False))
def test_decibels_are_ten_times_the_logarithm_to_their_error(square):
    assert decibels(in_lanes(square))[0] == pytest.approx(10 * math.log10(square), abs=8e-6)


def test_their_largest_error_is_what_is_said_and_far_below_a_hundredth():
    squares = 2.0 ** np.linspace(-3, 3, LANES * 4096)
    error = np.abs(decibels(squares) - 10 * np.log10(squares)).max()
    assert 0.9 * DECIBEL_ERROR < error <= DECIBEL_ERROR < 0.01


def test_decibels_rise_with_their_argument_through_all_octaves_and_denormals():
    octaves = np.repeat(np.arange(-1074.0, 1024.0), 16) + np.tile(np.arange(16) / 16, 2098)
    squares = np.ldexp(2.0 ** (octaves % 1), np.floor(octaves).astype(int))
    squares = np.unique(squares)
    squares = squares[: len(squares) // LANES * LANES]
    rises = np.diff(decibels(squares))
    # The smallest denormals differ by less than the last digit of their logarithm.
    assert (rises >= 0).all()
    assert (rises[squares[1:] >= 2.0**-1022] > 0).all()


def test_of_powers_of_two_they_are_exact_to_rounding():
    octaves = np.arange(-1008.0, 1008.0)
    np.testing.assert_allclose(
        decibels(2.0**octaves), 10 * np.log10(2.0) * octaves, rtol=1e-15, atol=0
    )


def test_zero_and_infinity_have_finite_decibels_at_the_ends_of_those_of_all_numbers():
    ends = [0.0, 5e-324, 2.0**-1022, np.finfo(np.float64).max, np.inf]
    found = decibels(ends + [np.nan] * (LANES - len(ends)))
    assert found[0] == LEAST_DB
    assert found[4] == MOST_DB
    assert (np.diff(found[:5]) >= 0).all()
    assert np.isfinite(found).all()


@given(st.floats(2.0**-1022, 1e308))
def test_exponents_and_fractions_are_those_of_frexp(value):
    exponent, fraction, back = np.empty((3, LANES))
    _split(in_lanes(value), exponent, fraction, back)
    half, power = math.frexp(value)
    assert (exponent[0], fraction[0]) == (power - 1, 2 * half)
    assert back[0] == 2.0 ** (power - 1)


@given(st.floats(-10, 10))
def test_a_polynomial_has_its_highest_power_first(x):
    out = np.empty(LANES)
    _cubic(in_lanes(x), out)
    assert out[0] == pytest.approx(2 * x**3 - x + 5, abs=1e-11)
