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

"""Resampling of a recording, a whole stretch at a time."""

import fractions
from collections.abc import Iterator

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples

Floats = NDArray[np.float64]

#: Zero crossings of the sinc on either side of a row.
LOBES = 16

#: Edge of the low-pass as a share of half the lower rate. Above half the lower rate the gain is
#: below -70 dB.
EDGE = 0.8

#: Largest factor between the two rates, and largest denominator of the fraction that stands for
#: it: the length of the filter grows with it.
MOST_FACTOR = 1000


def stretches(pieces: Iterator[Samples]) -> Iterator[Samples]:
    """Join the pieces of each stretch."""
    parts: list[Samples] = []
    for piece in pieces:
        if parts and piece.new_stretch:
            yield parts[0].then(*parts[1:])
            parts = []
        parts.append(piece)
    if parts:
        yield parts[0].then(*parts[1:])


def rows_after(n: int, from_hz: float, to_hz: float) -> int:
    """Return the number of rows that :func:`resampled` makes of ``n`` rows."""
    up, down = _ratio(from_hz, to_hz)
    return (n - 1) * up // down + 1


def resampled(stretch: Samples, from_hz: float, to_hz: float) -> Samples:
    """Resample rows that are evenly spaced, with a low-pass for the lower of the two rates.

    The rows are taken to be constant before the first and after the last one. A constant channel
    keeps its value to the bit. A bad value (NaN, infinity) is replaced by the last good value of
    its channel, and the output rows nearest to it become bad.

    Parameters
    ----------
    stretch
        The rows, at least one.
    from_hz, to_hz
        Rates of the input and of the output.

    Examples
    --------
    >>> rows = Samples(np.full((100, 2), 4.3), np.arange(100) * 5_000_000)  # 0.5 s at 200 Hz
    >>> resampled(rows, 200.0, 380.0).volts.shape
    (189, 2)
    """
    up, down = _ratio(from_hz, to_hz)
    most = max(up, down)
    half = int(np.ceil(LOBES / EDGE))  # rows of the lower rate
    low_pass = scipy.signal.firwin(2 * half * most + 1, EDGE / most, window='blackman')
    bad = ~np.isfinite(stretch.volts)
    good = forward_filled(stretch.volts, bad)
    # The filter begins with zeros, so it gets what comes after the first row.
    held = np.repeat(good[-1:], half * most // up + 1, axis=0)
    change = np.concatenate([good, held]) - good[0]
    n = rows_after(len(good), from_hz, to_hz)
    volts = good[0] + scipy.signal.resample_poly(change, up, down, window=low_pass)[:n]
    places = np.arange(n) * down / up
    volts[bad[np.minimum(np.floor(places + 0.5).astype(np.intp), len(bad) - 1)]] = np.nan
    before = np.floor(places).astype(np.intp)
    after_ns = np.rint((places - before) * 1e9 / from_hz).astype(np.int64)
    rows = stretch.take(before)
    return rows._replace(volts=volts, stamps_ns=rows.stamps_ns + after_ns)


def _ratio(from_hz: float, to_hz: float) -> tuple[int, int]:
    """Return the ratio of the rates as a fraction, accurate to some millionths."""
    lower, higher = sorted((from_hz, to_hz))
    down, up = fractions.Fraction(lower / higher).limit_denominator(MOST_FACTOR).as_integer_ratio()
    return (up, down) if to_hz > from_hz else (down, up)


def forward_filled(volts: Floats, bad: NDArray[np.bool_]) -> Floats:
    """Return the volts with each bad value replaced by the last good value of its channel.

    Before the first good value it is replaced by that value, or by 0 if there is none.
    """
    if not bad.any():
        return volts
    rows = np.maximum.accumulate(np.where(bad, 0, np.arange(len(volts))[:, np.newaxis]), axis=0)
    rows = np.maximum(rows, np.argmin(bad, axis=0))
    return np.where(bad.all(axis=0), 0.0, np.take_along_axis(volts, rows, axis=0))
