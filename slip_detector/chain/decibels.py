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

"""Logarithms and powers whose bits are the same on every machine."""

import numpy as np

from slip_detector.compiled import compiled_in_place
from slip_detector.vectors import floats_of, spread, words_of

# Layout of a float64: mask and number of the fraction's bits, the bits of 1.0, and the bias of the
# exponent.
FRACTION, FRACTION_BITS, ONE = np.uint64(2**52 - 1), np.uint64(52), np.uint64(0x3FF << 52)
BIAS = 1023.0

# In the sum of 2^52 and a smaller integer, the bits of the fraction are that integer.
LARGE, LARGE_BITS = 2.0**52, np.uint64(0x433 << 52)

#: Decibels of the square root of 2: :func:`root_decibels` takes squares.
OCTAVE_DB = 10.0 * float(np.log10(2.0))

#: Coefficients of q in log2(1 + t) = t + t (1 - t) q(t), highest power first: the polynomial of
#: its degree with the least error for t within [0, 1]. The logarithm is exact at both ends, hence
#: continuous, and it rises everywhere.
BETWEEN_OCTAVES = (
    0.025841442564341566,
    -0.09595644602069042,
    0.18194887353480288,
    -0.2756003104344289,
    0.44254494337489514,
)

#: Coefficients of q in log2(1 + t) = t q(t), of a lower degree, for activity: 3.5e-4 dB of error.
NEARLY_LOG2 = (-0.0821307307268031, 0.3211890041214286, -0.6777840230453743, 1.4387257496507488)


@compiled_in_place
def exponents(values):
    """Return the exponents of float64, as float64."""
    return floats_of((words_of(values) >> FRACTION_BITS) | LARGE_BITS) - (LARGE + BIAS)


@compiled_in_place
def fractions(values):
    """Return the fractions of float64, from 1 to below 2."""
    return floats_of((words_of(values) & FRACTION) | ONE)


@compiled_in_place
def powers_of_2(exponent):
    """Return 2 to the power of integers from -1023 (which gives 0) to 1024 (infinity)."""
    return floats_of(words_of(exponent + (LARGE + BIAS)) << FRACTION_BITS)


@compiled_in_place
def polynomial(coefficients, x):
    """Return the value of a polynomial whose highest power comes first."""
    value = spread(coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value


@compiled_in_place
def root_decibels(squares):
    """Return the square roots of non-negative numbers in decibels, with an error up to 7e-6 dB.

    A library's logarithms differ in their last bits from machine to machine; these do not, and
    take a fraction of the time. Below the least normal number the result falls linearly, at 0 to
    -3080 dB; it is never infinite or NaN.
    """
    t = fractions(squares) - 1.0
    return (exponents(squares) + (t + t * (1.0 - t) * polynomial(BETWEEN_OCTAVES, t))) * OCTAVE_DB
