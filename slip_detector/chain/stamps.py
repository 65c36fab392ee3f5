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

"""Stamps of incoming samples: finds missing samples, gaps and stamps that do not fit.

One rule for gaps holds for live input and recordings: a short gap is bridged with the last row,
and after a long one the chain starts again.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain import stamp_rules as rules
from slip_detector.chain.stamp_rules import DROPPED, NEW_STRETCH, NONE


class MendedSamples(NamedTuple):
    """Samples with bridged gaps, and the stretches that they form.

    Attributes
    ----------
    places : ndarray of int, shape (n,)
        Index of each sample in the input; -1 is the last sample before the input.
    stamps_ns : ndarray of int, shape (n,)
        They rise strictly within a stretch.
    stretches : tuple of slice
        The samples of each stretch, at least one. The first may continue an earlier stretch.
    first_is_new : bool
        Whether the first of these stretches begins a new one.
    gaps, bridged, dropped : int
        Number of short gaps, of samples that bridge them, and of samples that were dropped.
    """

    places: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    stretches: tuple[slice, ...]
    first_is_new: bool
    gaps: int
    bridged: int
    dropped: int


def missing_rows(last_ns: int, stamp_ns: int, sample_rate_hz: float) -> int:
    """Return the number of missing rows between two stamps; 0 if the clock was set back.

    Examples
    --------
    >>> missing_rows(0, 1_000_000_000, 100.0)
    99
    >>> missing_rows(1_000_000_000, 0, 100.0)
    0
    """
    return max(round((stamp_ns - last_ns) * 1e-9 * sample_rate_hz) - 1, 0)


def rising(stamps_ns: NDArray[np.int64], before_ns: int = NONE) -> NDArray[np.int64]:
    """Move each stamp that is not after the one before to 1 ns after it.

    Examples
    --------
    >>> rising(np.array([5, 5, 4, 9]), before_ns=5)
    array([6, 7, 8, 9])
    """
    after = np.arange(1, len(stamps_ns) + 1)
    return np.maximum(np.maximum.accumulate(stamps_ns - after), before_ns) + after


class StampGrid:
    """A grid of times at which samples are expected; it decides on each sample by its stamp.

    The grid is a line fitted to the stamps with a fading memory. So stamps may jitter by 0.3
    periods either way, and the rate of the clock may be off by 15 %, with next to no sample being
    counted as missing (``python -m benchmarks extremes`` counts them). If early samples show more
    jitter, a delay must be larger to count as a gap.

    No stamp alone proves anything. A sample with a late stamp is taken as the next one. Samples
    are missing as far as the stamp after it agrees, and are then bridged before that stamp. Where
    stamps come later and later, either samples are lost or the clock has changed its rate; the
    grid takes what the latest 20 stamps fit better, if need be some samples later. Where several
    samples have nearly the same stamp, because a driver reads them in bunches or its clock is
    coarse, the grid counts rows. A sample whose stamp is before the last one, or further ahead
    than ``max_gap_s``, is dropped. When several dropped samples in a row agree, there was a long
    gap or the clock was set, and a new stretch begins. Behind the last stamp the dropped samples
    must also rise for longer than ``max_gap_s``, as late messages rise too.

    A message may be published any number of periods after its samples were taken: a late message,
    closely followed by the next ones, is not a gap. If messages are numbered, the numbers tell
    exactly which of them are missing, and the grid only follows the stamps.

    Parameters
    ----------
    period_s
        Time from sample to sample.
    max_gap_s
        Longest gap that is bridged.

    Examples
    --------
    >>> grid = StampGrid(period_s=0.01, max_gap_s=0.1)
    >>> [grid.arrive(ms * 1_000_000) for ms in (0, 10, 20, 50, 60)]
    [0, 0, 0, 0, 2]
    >>> [grid.arrive(ms * 1_000_000) for ms in (9000, 80, 90)] == [DROPPED, 0, 1]
    True
    >>> [grid.arrive(ms * 1_000_000) for ms in (9000, 9010, 9020, 9030)][-1] == NEW_STRETCH
    True
    """

    def __init__(self, period_s: float, max_gap_s: float) -> None:
        self._grids = rules.new_records(1, rules.GRID)
        self._latest = rules.new_records(rules.LATELY, rules.LATEST)
        self._grid = grid = self._grids[0]
        grid.period_ns = grid.nominal_ns = period_s * 1e9
        grid.memory, grid.jitter = rules.FIRST_MEMORY, rules.FIRST_JITTER
        grid.last_ns = NONE
        self._number: int | None = None
        self._mended_ns = NONE  # The last stamp that was returned.
        self.max_gap_s = max_gap_s

    @property
    def period_ns(self) -> float:
        """Time from sample to sample, by the stamps."""
        return float(self._grid.period_ns)

    @property
    def kind(self) -> str:
        """Whether the stamps are regular, coarse (many are equal) or bunched (many are close)."""
        if self._grid.close <= rules.BUNCHED:
            return 'regular'
        return 'coarse' if self._grid.same > rules.BUNCHED else 'bunched'

    @property
    def mostly_bad(self) -> bool:
        """Whether most of the latest rows, of half a second or more, were dropped or bridged."""
        return bool(self._grid.bad > 0.5)

    @property
    def wrong(self) -> int:
        """Number of samples that were taken at their place in spite of a late stamp."""
        return int(self._grid.wrong)

    def arrive(self, stamp_ns: int, rows: int = 1, number: int | None = None) -> int:
        """Return how many samples are missing before those of the next message.

        Missing samples are to be bridged with the last row. ``DROPPED`` and ``NEW_STRETCH`` stand
        in place of a number.

        Parameters
        ----------
        stamp_ns
            Stamp of the message's last sample, or the time of publication of a numbered message.
        rows
            Number of the message's samples, which arrive or are missing together.
        number
            Number of the message, one more than that of the message sent before it; None if
            messages are not numbered. A number that is not greater than the last one comes from
            another sender: such a message is judged by its stamp.

        Examples
        --------
        >>> grid = StampGrid(period_s=0.001, max_gap_s=0.1)
        >>> published_ms = {1: 10, 2: 20, 3: 75, 4: 76, 6: 77}  # 3 was late, 5 is missing.
        >>> [grid.arrive(ms * 1_000_000, 10, n) for n, ms in published_ms.items()]
        [0, 0, 0, 0, 10]
        """
        lost = -1
        if number is not None and self._number is not None and number > self._number:
            lost = number - self._number - 1
        max_gap_ns = self.max_gap_s * 1e9
        arrive = rules.compiled_arrive()
        missing: int = arrive(self._grids, self._latest, max_gap_ns, stamp_ns, rows, lost)
        if missing != DROPPED:
            self._number = number
        return missing

    def skip(self, number: int | None) -> None:
        """Register the number of a message without samples, which is not missing."""
        self._number = number

    def mend(self, stamps_ns: NDArray[np.int64]) -> MendedSamples:
        """Decide on samples one by one: drop samples, bridge gaps and separate stretches.

        Parameters
        ----------
        stamps_ns : ndarray of int, shape (n,)
            The stamp of each sample.

        Examples
        --------
        >>> grid = StampGrid(period_s=0.01, max_gap_s=0.1)
        >>> mended = grid.mend(np.array([0, 10, 40, 50, 1000, 1010, 1020, 1030]) * 1_000_000)
        >>> mended.places
        array([0, 1, 2, 2, 2, 3, 7])
        >>> mended.stretches, mended.dropped
        ((slice(0, 6, None), slice(6, 7, None)), 3)
        """
        stamps_ns = np.ascontiguousarray(stamps_ns, np.int64)
        verdicts, places_ns = np.zeros((2, len(stamps_ns)), np.int64)
        max_gap_ns = self.max_gap_s * 1e9
        rules.judge_all(self._grids, self._latest, max_gap_ns, stamps_ns, verdicts, places_ns)
        kept = np.flatnonzero(verdicts != DROPPED)
        missing = np.maximum(verdicts[kept], 0)
        # Each sample is preceded by the missing ones, for which the one before is repeated.
        rows = missing + 1
        ends = np.cumsum(rows) - 1
        places = np.repeat(np.concatenate([[-1], kept])[:-1], rows)
        places[ends] = kept
        before = np.repeat(ends, rows) - np.arange(len(places))
        mended_ns = np.repeat(places_ns[kept], rows)
        mended_ns -= np.rint(before * self._grid.nominal_ns).astype(np.int64)
        starts = [0, *ends[verdicts[kept] == NEW_STRETCH].tolist()]
        first_is_new = starts[1:2] == [0]
        stretches = [slice(a, b) for a, b in pairwise([*starts, len(places)]) if a < b]
        before_ns = NONE if first_is_new else self._mended_ns
        for stretch in stretches:
            mended_ns[stretch] = rising(mended_ns[stretch], before_ns)
            self._mended_ns, before_ns = int(mended_ns[stretch][-1]), NONE
        return MendedSamples(
            places,
            mended_ns,
            tuple(stretches),
            first_is_new,
            int(np.count_nonzero(missing)),
            int(missing.sum()),
            len(stamps_ns) - len(kept),
        )
