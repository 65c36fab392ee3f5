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

"""Resampling of a recording, piece by piece."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slip_detector.recordings.piece import Piece

Floats = NDArray[np.float64]

#: Zero crossings of the sinc on either side of a row.
LOBES = 16

#: Edge of the low-pass as a share of half the lower rate. Above half the lower rate the gain is
#: below -70 dB.
EDGE = 0.8

#: Largest factor between the two rates; the number of input rows per output row grows with it.
MOST_FACTOR = 1000

#: Number of output rows that are computed at a time, which bounds the memory.
MOST_ROWS = 8192


class Resampler:
    """Interpolates rows with a windowed sinc, a low-pass for the lower of the two rates.

    It assumes that rows are evenly spaced within a stretch, and constant before its first and
    after its last row. The weights of each row add up to one, so that a constant baseline keeps
    its value to the bit. A bad value (NaN, infinity) is replaced by the last good value of its
    channel, and the output rows nearest to it become bad. The result does not depend on how the
    rows are cut into pieces.

    Parameters
    ----------
    from_hz, to_hz
        Rates of the input and of the output.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.recordings import Piece
    >>> from slip_detector.recordings.resample import Resampler
    >>> stamps_ns, which = np.arange(100) * 5_000_000, np.arange(100)
    >>> piece = Piece(np.full((100, 2), 4.3), stamps_ns, None, True, which)  # 0.5 s at 200 Hz
    >>> resampled = list(Resampler(200.0, 380.0).pieces(iter([piece])))
    >>> volts = np.concatenate([piece.volts for piece in resampled])
    >>> volts.shape, np.unique(volts)
    ((189, 2), array([4.3]))
    """

    def __init__(self, from_hz: float, to_hz: float) -> None:
        self._step = from_hz / to_hz
        self._from_hz = from_hz
        self._edge = EDGE * min(1.0, to_hz / from_hz)  # of half the rate of the input
        self._half = int(np.ceil(LOBES / self._edge))

    def pieces(self, pieces: 'Iterator[Piece]') -> 'Iterator[Piece]':
        """Yield the pieces at the new rate, each as soon as the input rows it needs have come."""
        stretch: _Stretch | None = None
        for piece in pieces:
            if piece.new_stretch or stretch is None:
                if stretch is not None:
                    yield from self._some(stretch, end=True)
                stretch = _Stretch(piece, self._half)
            else:
                stretch.add(piece)
            yield from self._some(stretch, end=False)
        if stretch is not None:
            yield from self._some(stretch, end=True)

    def _some(self, stretch: '_Stretch', end: bool) -> 'Iterator[Piece]':
        """Yield the output rows whose input rows have all come."""
        half, step = self._half, self._step
        if end:
            stretch.hold_last(half)
        # Output row j is at place j * step of the input and needs `half` more input rows.
        last = stretch.known - 1 if end else stretch.known - 1 - half
        after = int(np.floor(last / step)) + 2
        while stretch.given < after:
            j = np.arange(stretch.given, min(stretch.given + MOST_ROWS, after))
            j = j[j * step <= last]
            if not len(j):
                return
            yield self._rows(stretch, j)

    def _rows(self, stretch: '_Stretch', j: NDArray[np.int64]) -> 'Piece':
        """Return the output rows with the numbers ``j``, whose input rows have all come."""
        step = self._step
        places = j * step
        base = np.floor(places).astype(np.int64)
        rest = places - base
        volts = self._interpolated(stretch, base, rest)
        nearest = np.floor(places + 0.5).astype(np.int64)
        volts[stretch.bad_at(nearest)] = np.nan
        after_ns = np.rint(rest * 1e9 / self._from_hz).astype(np.int64)
        piece = stretch.piece(base, volts, after_ns)
        stretch.given = int(j[-1]) + 1
        stretch.forget(int(np.floor(stretch.given * step)))
        return piece

    def _interpolated(self, stretch: '_Stretch', base: NDArray[np.int64], rest: Floats) -> Floats:
        """Return the weighted sums around the places, (m, c).

        Summation tap by tap has the same order, hence gives the same bits, for any number of rows.
        The terms are differences from the row before the place, so that a constant channel stays
        exactly constant.
        """
        total = np.zeros(len(base))
        before = stretch.good_at(base)
        differences = np.zeros_like(before)
        for tap in range(-self._half + 1, self._half + 1):
            away = rest - tap  # in rows of the input
            share = away / self._half
            window = 0.42 + 0.5 * np.cos(np.pi * share) + 0.08 * np.cos(2 * np.pi * share)
            weight = np.sinc(self._edge * away) * window
            total += weight
            differences += weight[:, np.newaxis] * (stretch.good_at(base + tap) - before)
        return np.asarray(before + differences / total[:, np.newaxis])


class _Stretch:
    """The rows of one stretch that are still needed."""

    def __init__(self, piece: 'Piece', half: int) -> None:
        self._half = half
        self._piece = piece
        self._bad = ~np.isfinite(piece.volts)
        self._good = _held(piece.volts, self._bad, None)
        # The input before the first row is assumed to equal that row.
        self._good = np.concatenate([np.repeat(self._good[:1], half, axis=0), self._good])
        self._first = 0  # place of the first row in memory
        self.known = len(piece.volts)
        self.given = 0
        self._new = True

    def add(self, piece: 'Piece') -> None:
        """Append the next rows."""
        bad = ~np.isfinite(piece.volts)
        good = _held(piece.volts, bad, self._good[-1])
        self._good = np.concatenate([self._good, good])
        self._bad = np.concatenate([self._bad, bad])
        truth = None
        if self._piece.truth is not None and piece.truth is not None:
            truth = np.concatenate([self._piece.truth, piece.truth])
        self._piece = self._piece._replace(
            stamps_ns=np.concatenate([self._piece.stamps_ns, piece.stamps_ns]),
            truth=truth,
            row_numbers=np.concatenate([self._piece.row_numbers, piece.row_numbers]),
        )
        self.known += len(piece.volts)

    def hold_last(self, n: int) -> None:
        """Append the last row n times."""
        self._good = np.concatenate([self._good, np.repeat(self._good[-1:], n, axis=0)])

    def good_at(self, places: NDArray[np.int64]) -> Floats:
        """Return the rows at the places, with bad values replaced."""
        return np.asarray(self._good[places - self._first + self._half])

    def bad_at(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which values of the rows at the places are bad."""
        return np.asarray(self._bad[np.minimum(places, self.known - 1) - self._first])

    def piece(
        self, base: NDArray[np.int64], volts: Floats, after_ns: NDArray[np.int64]
    ) -> 'Piece':
        """Make a piece of output rows that are ``after_ns`` after the input rows ``base``."""
        at = base - self._first
        truth = self._piece.truth
        new, self._new = self._new and self._piece.new_stretch, False
        return self._piece._replace(
            volts=volts,
            stamps_ns=self._piece.stamps_ns[at] + after_ns,
            truth=None if truth is None else truth[at],
            new_stretch=new,
            row_numbers=self._piece.row_numbers[at],
        )

    def forget(self, place: int) -> None:
        """Drop the rows before a place."""
        n = min(place, self.known) - self._first
        if n <= 0:
            return
        self._first += n
        self._good = self._good[n:].copy()
        self._bad = self._bad[n:]
        truth = self._piece.truth
        self._piece = self._piece._replace(
            stamps_ns=self._piece.stamps_ns[n:],
            truth=None if truth is None else truth[n:],
            row_numbers=self._piece.row_numbers[n:],
        )


def _held(volts: Floats, bad: NDArray[np.bool_], last: 'Floats | None') -> Floats:
    """Return the volts with each bad value replaced by the last good value of its channel.

    Bad values before the first good one are replaced by ``last`` or, if that is None, by the first
    good value, or by 0 if there is none.
    """
    if not bad.any():
        return volts
    row = np.where(bad, -1, np.arange(len(volts))[:, np.newaxis])
    row = np.maximum.accumulate(row, axis=0)
    held = np.take_along_axis(volts, np.maximum(row, 0), axis=0)
    if last is None:
        first_good = np.argmin(bad, axis=0)
        last = np.where(bad.all(axis=0), 0.0, volts[first_good, np.arange(volts.shape[1])])
    return np.where(row < 0, last, held)
