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

"""Stamps of incoming samples: finds missing samples, gaps and stamps that run backwards.

The rule for gaps of live input and recordings is here: a short gap is bridged with the last row,
after a long one the chain starts again.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled_in_place

#: Number of samples whose stamps the line of the grid is fitted to, after a start and later. A
#: long memory averages jitter and still follows a drift.
FIRST_MEMORY, LONG_MEMORY = 16, 256

#: Largest jitter, in periods. A sample further ahead of the grid begins a new grid.
LARGEST_JITTER = 2.0

#: Number of samples after which observed jitter is forgotten.
JITTER_MEMORY = 2048

#: Largest error of a clock's rate, as a share, that the grid follows; more means missing samples.
LARGEST_RATE_ERROR = 0.15

#: Limit between jitter and a gap, in periods from stamp to stamp, without further knowledge.
GAP_PERIODS = 1.5

#: A sample that is late by this many periods comes after a gap, unless the jitter is larger.
BEHIND_A_GAP = 0.5

#: Longest delay of a message whose number follows the one before. After a longer pause the source
#: itself must have stopped.
LONGEST_DELAY_NS = 1e9

#: Jitter in periods that is assumed before any was observed.
FIRST_JITTER = 0.75


# Elements of the array that holds the line: the sample period, the time until the next sample is
# expected, the memory in messages, the jitter in periods, and the bounds of the period.
PERIOD_NS, UNTIL_NEXT_NS, MEMORY, JITTER, FASTEST_NS, SLOWEST_NS = range(6)

# Elements of the array of stamps: of the last accepted sample, and of the first and last of the
# samples that have been dropped since. NONE: there is no such stamp.
LAST, FIRST_DROPPED, LAST_DROPPED = range(3)
NONE = np.iinfo(np.int64).min

# In place of the number of samples that are missing before a sample: its stamp is not after the
# last one, and it is dropped; or too many are missing, or the clock was set back, and the sample
# begins a new stretch.
BACKWARDS, NEW_STRETCH = -1, -2


@compiled_in_place
def _begin(line, stamps, stamp_ns, verdict):
    """Begin a new grid at a stamp; return the verdict."""
    stamps[LAST], stamps[FIRST_DROPPED] = stamp_ns, NONE
    line[UNTIL_NEXT_NS], line[MEMORY] = line[PERIOD_NS], FIRST_MEMORY
    return verdict


@compiled_in_place
def _follow(line, behind, rows):
    """Move the line towards the stamp of a message that is late by ``behind`` periods.

    The gains are those of a least-squares line through the last ``memory`` messages.
    """
    n = line[MEMORY]
    if n < LONG_MEMORY:
        line[MEMORY] = n + 1.0
    # Lateness beyond BEHIND_A_GAP may be a gap and not jitter; an early sample is always jitter.
    off = -behind if behind < 0.0 else min(behind, BEHIND_A_GAP)
    line[JITTER] = max(off, line[JITTER] * (1.0 - 1.0 / JITTER_MEMORY))
    gain = 1.0 / (n * (n + 1.0))
    period_ns = line[PERIOD_NS]
    # The time until the next sample: from this stamp to its place on the line, plus one period.
    on_line_ns = -behind * (1.0 - 2.0 * (2.0 * n - 1.0) * gain) * rows * period_ns
    period_ns *= 1.0 + behind * 6.0 * gain
    period_ns = min(max(period_ns, line[FASTEST_NS]), line[SLOWEST_NS])
    line[PERIOD_NS] = period_ns
    line[UNTIL_NEXT_NS] = on_line_ns + period_ns


@compiled_in_place
def _judge(line, stamps, max_gap_ns, stamp_ns, rows, lost):
    """Return how many samples are missing before those of a message, or BACKWARDS or NEW_STRETCH.

    ``lost`` messages are missing before it; -1: only its stamp can tell.
    """
    if stamps[LAST] == NONE:
        return _begin(line, stamps, stamp_ns, 0)
    step_ns = stamp_ns - stamps[LAST]
    period_ns = line[PERIOD_NS]
    # In periods of the messages.
    behind = ((step_ns - line[UNTIL_NEXT_NS]) / period_ns - (rows - 1)) / rows
    missing = lost
    if lost >= 0:
        too_many = lost > 0 and (lost * rows + 1) * period_ns > max_gap_ns
        if too_many or step_ns - rows * period_ns > max(max_gap_ns, LONGEST_DELAY_NS):
            return _begin(line, stamps, stamp_ns, NEW_STRETCH)
        if step_ns <= 0:  # The clock was set back.
            return _begin(line, stamps, stamp_ns, lost * rows)
    elif step_ns <= 0:
        if stamps[FIRST_DROPPED] == NONE or stamp_ns <= stamps[LAST_DROPPED]:
            stamps[FIRST_DROPPED] = stamp_ns
        stamps[LAST_DROPPED] = stamp_ns
        if stamp_ns - stamps[FIRST_DROPPED] <= max_gap_ns:
            return BACKWARDS
        return _begin(line, stamps, stamp_ns, NEW_STRETCH)
    elif behind < -LARGEST_JITTER:
        return _begin(line, stamps, stamp_ns, 0)
    else:
        missing = max(0, int(np.rint(behind - max(0.0, line[JITTER] - BEHIND_A_GAP))))
        if missing > 0 and step_ns - (rows - 1) * period_ns > max_gap_ns:
            return _begin(line, stamps, stamp_ns, NEW_STRETCH)
    _follow(line, behind - missing, float(rows))
    stamps[LAST], stamps[FIRST_DROPPED] = stamp_ns, NONE
    return missing * rows


@compiled_in_place
def _judge_all(line, stamps, max_gap_ns, stamps_ns, verdicts):
    """Write the verdict of :func:`_judge` on each sample, by its stamp."""
    for i in range(stamps_ns.size):
        verdicts[i] = _judge(line, stamps, max_gap_ns, stamps_ns[i], 1, -1)


class MendedSamples(NamedTuple):
    """Samples with bridged gaps, and the stretches that they form.

    Attributes
    ----------
    places : ndarray of int, shape (n,)
        Index of each sample in the input; -1 is the last sample before the input.
    stamps_ns : ndarray of int, shape (n,)
    stretches : tuple of slice
        The samples of each stretch, at least one. The first may continue an earlier stretch.
    first_is_new : bool
        Whether the first of them begins a new stretch.
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


class StampGrid:
    """A grid of times at which samples are expected; it decides on each sample by its stamp.

    The grid is even and follows the stamps: it is a line fitted to them with a fading memory. So a
    stamp may be wrong by half a period, and the rate of the clock by ``LARGEST_RATE_ERROR``,
    without any sample being counted as missing. If early samples show more jitter, a delay must be
    larger to count as a gap.

    A sample whose stamp is not after the previous one is dropped. When the stamps of dropped
    samples rise for longer than ``max_gap_s``, the clock was set back or a bag was started again,
    and a new stretch begins. Otherwise one step back would silence the detector forever.

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
    >>> [grid.arrive(ms * 1_000_000) for ms in (0, 10, 20, 50)]
    [0, 0, 0, 2]
    >>> grid.arrive(2_000_000_000) == NEW_STRETCH
    True
    """

    def __init__(self, period_s: float, max_gap_s: float) -> None:
        self._nominal_ns = period_ns = period_s * 1e9
        off_ns = LARGEST_RATE_ERROR * period_ns
        self._line = np.array(
            [period_ns, 0.0, FIRST_MEMORY, FIRST_JITTER, period_ns - off_ns, period_ns + off_ns]
        )
        self._stamps = np.full(3, NONE)
        self._number: int | None = None
        self.max_gap_s = max_gap_s

    @property
    def period_ns(self) -> float:
        """Time from sample to sample, by the stamps."""
        return float(self._line[PERIOD_NS])

    def arrive(self, stamp_ns: int, rows: int = 1, number: int | None = None) -> int:
        """Return how many samples are missing before those of the next message.

        A short gap is to be bridged with the last row; ``BACKWARDS`` and ``NEW_STRETCH`` stand in
        place of the number.

        Parameters
        ----------
        stamp_ns
            Stamp of its last sample. For numbered messages it may be the time of publication.
        rows
            Number of its samples, which arrive or are missing together.
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
        missing = int(_judge(self._line, self._stamps, max_gap_ns, stamp_ns, rows, lost))
        if missing != BACKWARDS:
            self._number = number
        return missing

    def skip(self, number: int | None) -> None:
        """Register the number of a message without samples, which is not missing."""
        self._number = number

    def arrive_all(self, stamps_ns: NDArray[np.int64]) -> bool:
        """Accept all samples at once if each is the next one expected; else accept none of them.

        Parameters
        ----------
        stamps_ns : ndarray of int, shape (n,)
            The stamp of each sample.

        Returns
        -------
        bool
            Whether they were accepted; if not, call :meth:`mend` for them.
        """
        before = self._line.copy(), self._stamps.copy()
        if not self._verdicts(stamps_ns).any():
            return True
        self._line, self._stamps = before
        return False

    def mend(self, stamps_ns: NDArray[np.int64]) -> MendedSamples:
        """Decide on samples one by one: drop samples, bridge gaps and separate stretches.

        Parameters
        ----------
        stamps_ns : ndarray of int, shape (n,)
            The stamp of each sample.

        Examples
        --------
        >>> grid = StampGrid(period_s=0.01, max_gap_s=0.1)
        >>> mended = grid.mend(np.array([0, 10, 40, 1000]) * 1_000_000)
        >>> mended.places
        array([0, 1, 1, 1, 2, 3])
        >>> mended.stretches
        (slice(0, 5, None), slice(5, 6, None))
        """
        verdicts = self._verdicts(stamps_ns)
        kept = np.flatnonzero(verdicts != BACKWARDS)
        missing = np.maximum(verdicts[kept], 0)
        # Each sample is preceded by the missing ones, for which the one before is repeated.
        rows = missing + 1
        ends = np.cumsum(rows) - 1
        places = np.repeat(np.concatenate([[-1], kept])[:-1], rows)
        places[ends] = kept
        begins_ns = stamps_ns[kept] - _whole_ns(missing * self._nominal_ns)
        nth = np.arange(len(places)) - np.repeat(ends - missing, rows)
        mended_ns = np.repeat(begins_ns, rows) + _whole_ns(nth * self._nominal_ns)
        mended_ns[ends] = stamps_ns[kept]
        starts = [0, *ends[verdicts[kept] == NEW_STRETCH].tolist()]
        return MendedSamples(
            places,
            mended_ns,
            tuple(slice(a, b) for a, b in pairwise([*starts, len(places)]) if a < b),
            starts[1:2] == [0],
            int(np.count_nonzero(missing)),
            int(missing.sum()),
            len(stamps_ns) - len(kept),
        )

    def _verdicts(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        stamps_ns = np.ascontiguousarray(stamps_ns, np.int64)
        verdicts = np.zeros_like(stamps_ns)
        _judge_all(self._line, self._stamps, self.max_gap_s * 1e9, stamps_ns, verdicts)
        return verdicts


def _whole_ns(times_ns: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(times_ns).astype(np.int64)
