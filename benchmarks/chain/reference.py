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

"""The slip chain in 50 digits, the design of its filters included.

It shares no line with :mod:`slip_detector.chain`, takes no coefficient from SciPy, and is slow:
some 0.03 ms for a row of one channel. Analogue prototypes are moved to their band on the axis
s = (z - 1) / (z + 1), on which a frequency f lies at tan(pi f / rate): the bilinear transform,
prewarped.

Sources: S. Butterworth, Wireless Engineer 7 (1930) 536, for the poles of the band-pass;
S. Orfanidis, Lecture Notes on Elliptic Filter Design (2006), sections 2, 5 and 6, for the poles
and zeros of the stop-bands.
"""

from collections.abc import Iterable
from typing import Any

import mpmath  # type: ignore[import-untyped]
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from slip_detector.chain.samples import Floats
from slip_detector.parameters import ChainConfig

#: Decimal digits of all numbers here.
DIGITS = 50

#: Binary digits after the point while filters run: some 120 decimal ones, of which a section with
#: low gain before one with high gain loses some.
FRACTION_BITS = 400

#: A number of 50 digits, real or complex: mpmath has no types.
Number = Any
#: b0, b1, b2, a1, a2 of a section; its a0 is 1.
Section = tuple[Number, Number, Number, Number, Number]

#: An imaginary part below this is a rounding error.
REAL_BELOW = 1e-35


@mpmath.workdps(DIGITS)
def design(config: ChainConfig) -> list[Section]:
    """Design the network of a configuration; the gain is in the first section."""
    low, high = (_warped(edge, config) for edge in config.passband_hz)
    if high == 0:
        order = config.passband_degree
        poles = [low / pole for pole in _butterworth(order)]
        # Zero frequency is stopped; the gain is that at half the sample rate.
        sections = _sections([mpf(0)] * order, poles, mpf('inf'), mpf(config.gain))
    else:
        order = config.passband_degree // 2
        width, product = high - low, low * high
        poles = [
            root for pole in _butterworth(order) for root in _quadratic(pole * width, product)
        ]
        zeros = [mpf(0)] * order + [mpf('inf')] * order
        sections = _sections(zeros, poles, 1j * mpmath.sqrt(product), mpf(config.gain))
    for pair in config.stopbands_hz:
        low, high = (_warped(edge, config) for edge in pair)
        width, product = high - low, low * high
        zeros, poles, gain = _elliptic(
            config.stopband_degree // 2,
            mpf(config.stopband_ripple_db),
            mpf(config.stopband_attenuation_db),
        )
        # The prototype's zero at infinity lies at the middle of the stop-band.
        zeros, poles = (
            [root for one in some for root in _quadratic(width / one, product)]
            for some in (zeros, poles)
        )
        sections += _sections(zeros, poles, mpf(0), gain)
    return sections


def _warped(edge_hz: float, config: ChainConfig) -> Number:
    return mpmath.tan(mpmath.pi * mpf(edge_hz) / mpf(config.sample_rate_hz))


def _butterworth(order: int) -> list[Number]:
    """Return the poles of the low-pass with its edge at 1: on the left half of the unit circle."""
    return [mpmath.expjpi(mpf(2 * k + order + 1) / (2 * order)) for k in range(order)]


def _elliptic(
    order: int, ripple_db: Number, attenuation_db: Number
) -> tuple[list[Number], list[Number], Number]:
    """Return zeros, poles and the gain at zero frequency of the low-pass with its edge at 1.

    The edge is where the ripple ends.
    """
    ripple = mpmath.sqrt(mpf(10) ** (ripple_db / 10) - 1)
    k1 = ripple / mpmath.sqrt(mpf(10) ** (attenuation_db / 10) - 1)
    # The degree equation, N K'(k) / K(k) = K'(k1) / K(k1), solved by way of the nomes.
    k = mpmath.kfrom(q=mpmath.qfrom(k=k1) ** (mpf(1) / order))
    quarter, quarter1 = mpmath.ellipk(k**2), mpmath.ellipk(k1**2)
    # sn(j x, k1) = j sc(x, k1'), and sc(x) = tan(am(x)).
    shift = mpmath.ellipf(mpmath.atan(1 / ripple), 1 - k1**2) / (order * quarter1)
    zeros, poles = [], []
    for i in range(order):
        u = mpf(2 * i + 1) / order
        poles.append(1j * mpmath.ellipfun('cd', (u - 1j * shift) * quarter, m=k**2))
        middle = 2 * i + 1 == order
        position = 0 if middle else mpmath.ellipfun('cd', u * quarter, m=k**2)
        zeros.append(mpf('inf') if middle else 1j / (k * position))
    gain = mpf(1) if order % 2 else 1 / mpmath.sqrt(1 + ripple**2)
    return zeros, poles, gain


def _quadratic(linear: Number, constant: Number) -> list[Number]:
    """Return the roots of s**2 - linear s + constant."""
    root = mpmath.sqrt(linear**2 - 4 * constant)
    return [(linear + root) / 2, (linear - root) / 2]


def _sections(
    zeros: list[Number], poles: list[Number], where: Number, gain: Number
) -> list[Section]:
    """Make digital sections of as many zeros as poles on the s axis.

    The magnitude of their product is ``gain`` at ``where`` on that axis.
    """
    above, below = (_factors([_to_z(root) for root in roots]) for roots in (zeros, poles))
    z = _to_z(where)
    for (_, b1, b2), (_, a1, a2) in zip(above, below, strict=True):
        gain *= abs((z * (z + a1) + a2) / (z * (z + b1) + b2))
    sections = [
        (b0, b1, b2, a1, a2) for (b0, b1, b2), (_, a1, a2) in zip(above, below, strict=True)
    ]
    b0, b1, b2, a1, a2 = sections[0]
    sections[0] = (gain * b0, gain * b1, gain * b2, a1, a2)
    return sections


def _to_z(s: Number) -> Number:
    return mpf(-1) if mpmath.isinf(s) else (1 + s) / (1 - s)


def _factors(roots: list[Number]) -> list[tuple[Number, Number, Number]]:
    """Return the real polynomials of at most degree 2 whose product has the roots."""
    real = sorted(mpmath.re(root) for root in roots if abs(mpmath.im(root)) < REAL_BELOW)
    upper = [root for root in roots if mpmath.im(root) >= REAL_BELOW]
    factors = [(mpf(1), -2 * mpmath.re(root), abs(root) ** 2) for root in upper]
    # The lowest root with the highest: so each section of a band-pass has a zero at 0 Hz and one
    # at half the sample rate.
    while len(real) > 1:
        one, other = real.pop(0), real.pop()
        factors.append((mpf(1), -(one + other), one * other))
    return factors + [(mpf(1), -root, mpf(0)) for root in real]


def exactly(sections: NDArray[Any]) -> list[Section]:
    """Return float64 coefficients unchanged: with them only the errors of the run remain."""
    return [
        tuple(mpf(float(value)) / mpf(float(row[3])) for value in (*row[:3], *row[4:]))
        for row in sections
    ]


@mpmath.workdps(DIGITS)
def run_filter(sections: Iterable[Section], volts: Floats) -> list[Number]:
    """Filter one channel's deviations from its first value, from rest.

    Parameters
    ----------
    sections
        Result of :func:`design` or :func:`exactly`.
    volts : ndarray, shape (n,)
        Taken as exact.

    Returns
    -------
    list of n numbers
    """
    first = mpf(float(volts[0]))
    deviations = [mpf(value) - first for value in volts.tolist()]
    # Whole numbers of a unit below the last digit of anything: many times faster than mpmath's.
    _, exponent = mpmath.frexp(max(map(abs, deviations)))
    signal = [int(mpmath.ldexp(value, FRACTION_BITS - exponent)) for value in deviations]
    for section in sections:
        b0, b1, b2, a1, a2 = (int(mpmath.ldexp(value, FRACTION_BITS)) for value in section)
        x1 = x2 = y1 = y2 = 0
        for i, x in enumerate(signal):
            y = (b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2) >> FRACTION_BITS
            x1, x2, y1, y2 = x, x1, y, y1
            signal[i] = y
    return [mpmath.ldexp(mpf(value), exponent - FRACTION_BITS) for value in signal]


@mpmath.workdps(DIGITS)
def envelope_and_level(
    filtered: list[Number], config: ChainConfig
) -> tuple[list[Number], list[Number]]:
    """Rectify, raise to the exponent and run both windows: the envelope and the level.

    Parameters
    ----------
    filtered
        Result of :func:`run_filter`, gain included.
    config
        Configuration with rectifier, exponent and windows.
    """
    if config.rectify == 'half':
        filtered = [max(value, mpf(0)) for value in filtered]
    # abs(value) ** exponent, squared
    power = [value ** (2 * config.exponent) for value in filtered]
    means = _means(power, config.samples(config.envelope_window_s))
    envelope = [mpmath.sqrt(mean) for mean in means]
    return envelope, _means(envelope, config.samples(config.decision_window_s))


@mpmath.workdps(DIGITS)
def evidence(
    filtered: list[Number], config: ChainConfig
) -> tuple[list[Number], list[Number], list[Number], list[bool]]:
    """Decide on one channel by evidence, from the output of the filters.

    Parameters
    ----------
    filtered
        Result of :func:`run_filter`, gain included. All rows are valid, without impacts.
    config
        Configuration with the parameters of the evidence.

    Returns
    -------
    floor, excess, evidence : list of n numbers
        In dB, dB and dB s.
    on : list of n bool
    """
    window, rate = config.samples(config.envelope_window_s), mpf(config.sample_rate_hz)
    squares = _means([value ** (2 * config.exponent) for value in filtered], window)
    least = 20 * mpmath.log10(mpf(config.noise_floor[0]))
    most = least + mpf(config.noise_floor_range_db)
    quantile = mpf(1) / 10
    step = mpf(config.noise_floor_rate_db_s) / (quantile * rate)
    offset, cap = mpf(config.evidence_offset_db), mpf(config.evidence_cap_db)
    limit, threshold = mpf(config.evidence_limit_db_s), mpf(config.threshold)
    floor, total, is_on, begun = least, mpf(0), False, config.noise_floor_learnt
    rows = []
    for row, square in enumerate(squares):
        excess = mpf(0)
        if row >= config.mains_rows + window:
            level = 10 * mpmath.log10(square) if square else -mpmath.inf
            if not begun:
                floor, begun = level, True
            elif level > floor:
                floor += step * quantile
            else:
                floor -= step * (1 - quantile)
            floor = min(max(floor, least), most)
            excess = min(max(level - floor, mpf('-8.7')), cap)
            total = min(max(total + (excess - offset) / rate, mpf(0)), limit)
        is_on = total > threshold or (is_on and total > threshold / 2)
        rows.append((floor, excess, total, bool(is_on)))
    floors, excesses, totals, on = (list(column) for column in zip(*rows, strict=True))
    return floors, excesses, totals, on


def _means(values: list[Number], window: int) -> list[Number]:
    """Return the means over the last ``window`` values; the sums are exact, so nothing drifts."""
    total = mpf(0)
    means = []
    for i, value in enumerate(values):
        total = mpmath.fadd(total, value, exact=True)
        if i >= window:
            total = mpmath.fsub(total, values[i - window], exact=True)
        means.append(total / window)
    return means


def as_two(values: list[Number]) -> tuple[Floats, Floats]:
    """Split numbers into the nearest float64 and the rest: together some 32 digits.

    Returns
    -------
    near, rest : ndarray, shape (n,)
    """
    near = np.array([float(value) for value in values])
    with mpmath.workdps(DIGITS):
        rest = [
            float(value - mpf(part)) for value, part in zip(values, near.tolist(), strict=True)
        ]
    return near, np.array(rest)
