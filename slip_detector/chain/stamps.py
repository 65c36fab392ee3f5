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

The rule for gaps of live input and recordings is here: a short gap is bridged with the last row,
after a long one the chain starts again.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.compiled import compiled_in_place

#: Number of samples whose stamps the line of the grid is fitted to, after a start and later. A
#: long memory averages jitter and still follows a drift.
FIRST_MEMORY, LONG_MEMORY = 16, 256

#: Largest jitter, in periods. A sample further ahead of the grid begins a new grid.
LARGEST_JITTER = 2.0

#: Number of the latest messages that tell lost samples from another rate, and of those to which
#: the line is fitted again when it is another rate.
LATELY, AT_ANOTHER_RATE = 20, 8

#: How much better samples must fit if some are lost, and if it is another rate, as the F of a test
#: of variances; the most messages after which it is decided in any case.
LOST_F, ANOTHER_RATE_F, DECIDED_AFTER = 3.0, 8.0, 12

#: Step before the sample after a gap, beyond the usual one, over the missing rows: at least that.
GAP_STEP = 0.2

#: Number of samples after which observed jitter is forgotten.
JITTER_MEMORY = 2048

#: Largest error of a clock's rate, as a share, that the grid follows; more means missing samples.
#: Errors of 0.15 can be told from that in spite of jitter.
LARGEST_RATE_ERROR = 0.17

#: Limit between jitter and a gap, in periods from stamp to stamp, without further knowledge.
GAP_PERIODS = 1.5

#: A sample that is late by this many periods comes after a gap, unless the jitter is larger.
BEHIND_A_GAP = 0.5

#: Where the sample after it is late by this many periods too, there was a gap.
STILL_LATE = 0.3

#: Longest delay of a message whose number follows the one before, or of bunched samples. After a
#: longer pause the source itself must have stopped.
LONGEST_DELAY_NS = 1e9

#: Jitter in periods that is assumed before any was observed.
FIRST_JITTER = 0.75

#: Samples in a row that must agree until the clock counts as set.
SEVERAL = 4

#: Stamps closer than this, in periods, are close. If more than ``BUNCHED`` of about the last
#: ``BUNCH_MEMORY`` are, the stamps do not tell when samples were taken.
CLOSE_PERIODS, BUNCHED, BUNCH_MEMORY = 0.25, 0.25, 64

# Elements of the array that holds the line: the sample period, the time until the next sample is
# expected, the memory in messages, the jitter in periods, the nominal period, and the shares of
# stamps that are close to, and the same as, the one before; and of bad rows lately. Then of each
# of the latest messages, in a ring, the nominal periods since the one before, its rows, and how
# many were found missing before them.
PERIOD_NS, UNTIL_NEXT_NS, MEMORY, JITTER, NOMINAL_NS, CLOSE, SAME, BAD, PERIODS = range(9)
ROWS, MISSING = PERIODS + LATELY, PERIODS + 2 * LATELY

# Elements of the array of stamps: LAST, the place on the line of the last sample; BEFORE, the
# stamp before; LATE, how many messages may be missing by the last stamp, -1: it was early; of the
# samples in a row that fit elsewhere the first stamp and their number; the rows dropped and not
# made up for yet; the samples whose stamps were wrong; for how many messages it is undecided
# whether some are missing; and of the latest messages the number, the place in the ring of the
# next one and the stamp of the last one. NONE: none.
LAST, BEFORE, LATE, FIRST_ELSEWHERE, ELSEWHERE, DROPPED_ROWS, WRONG = range(7)
UNDECIDED, HELD, NEXT_HELD, LAST_HELD = range(7, 11)
NONE = np.iinfo(np.int64).min

# In place of the number of samples that are missing before a sample: it does not fit, and is
# dropped; or the input had a long gap or its clock was set, and the sample begins a new stretch.
DROPPED, NEW_STRETCH = -1, -2


@compiled_in_place
def _begin(line, stamps, stamp_ns, verdict):
    """Begin a new grid at a stamp; return the verdict."""
    stamps[LAST], stamps[LATE], stamps[ELSEWHERE], stamps[DROPPED_ROWS] = stamp_ns, 0, 0, 0
    line[UNTIL_NEXT_NS], line[MEMORY] = line[PERIOD_NS], FIRST_MEMORY
    stamps[UNDECIDED], stamps[HELD], stamps[LAST_HELD] = 0, 0, stamp_ns
    _hold(line, stamps, stamp_ns, 0.0)
    return verdict


@compiled_in_place
def _hold(line, stamps, stamp_ns, rows):
    """Hold a message as the latest one."""
    at = stamps[NEXT_HELD]
    line[PERIODS + at] = (stamp_ns - stamps[LAST_HELD]) / line[NOMINAL_NS]
    line[ROWS + at], line[MISSING + at] = rows, 0.0
    stamps[LAST_HELD], stamps[NEXT_HELD] = stamp_ns, (at + 1) % LATELY
    stamps[HELD] = min(stamps[HELD] + 1, LATELY)


@compiled_in_place
def _fit(line, stamps, n, earlier, last, missing, late_rows):
    """Fit a line to the stamps of the latest ``n`` messages by their rows, by least squares.

    ``missing`` rows are taken to be missing before those of the ``last`` messages, ``late_rows``
    more before the very last, and those that were found missing earlier, if ``earlier`` is 1.0.
    Return the sum of squares, the slope (periods, over nominal ones, minus 1) and how late the
    last message is, in nominal periods.
    """
    x = t = late = sx = sy = sxx = sxy = syy = 0.0
    for i in range(n):
        at = (stamps[NEXT_HELD] - n + i) % LATELY
        x += line[ROWS + at] + earlier * line[MISSING + at] + (missing if i == n - last else 0.0)
        x += late_rows if i == n - 1 else 0.0
        t += line[PERIODS + at]
        late = t - x
        sx, sy = sx + x, sy + late
        sxx, sxy, syy = sxx + x * x, sxy + x * late, syy + late * late
    sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    slowest, fastest = 1.0 / (1.0 - LARGEST_RATE_ERROR), 1.0 / (1.0 + LARGEST_RATE_ERROR)
    slope = min(max(sxy / max(sxx, 1.0), fastest - 1.0), slowest - 1.0)
    squares = max(syy - 2.0 * slope * sxy + slope * slope * sxx, 0.0)
    return squares, slope, late - (sy + slope * (n * x - sx)) / n


@compiled_in_place
def _lost_or_slow(line, stamps, missing, late_rows):
    """Return ``missing`` if so many rows are missing before one of the latest messages.

    0: it is not decided yet; -1: none are, and the line was fitted again. Where rows are lost, the
    latest stamps fit a line with a step; where the rate has changed, one without, perhaps one in
    which no rows were missing earlier either. Stamps that are early (``missing`` is 0) leave only
    that. Until one fits clearly better, more messages are awaited.
    """
    n = stamps[HELD]
    steady, _, _ = _fit(line, stamps, n, 1.0, 0, 0.0, 0.0)
    none_lost, _, _ = _fit(line, stamps, n, 0.0, 0, 0.0, 0.0)
    slow, lost, since = min(steady, none_lost), math.inf, 0
    for last in range(2, min(DECIDED_AFTER, n - 1) + 1 if missing > 0 else 0):
        at = (stamps[NEXT_HELD] - last) % LATELY
        is_long = line[PERIODS + at] > line[ROWS + at] + GAP_STEP * missing
        squares, _, _ = _fit(line, stamps, n, 1.0, last, float(missing), float(late_rows))
        if is_long and squares < lost:
            lost, since = squares, last
    if (slow - lost) * (n - 2) > LOST_F * lost:
        line[MISSING + (stamps[NEXT_HELD] - since) % LATELY] += missing
        stamps[UNDECIDED] = 0
        return missing
    stamps[UNDECIDED] += 1
    is_open = (lost - slow) * (n - 2) <= ANOTHER_RATE_F * slow
    if is_open and stamps[UNDECIDED] < DECIDED_AFTER:
        return 0
    if none_lost < steady:
        line[MISSING : MISSING + LATELY] = 0.0
    stamps[UNDECIDED], n = 0, min(n, AT_ANOTHER_RATE)
    _, slope, late = _fit(line, stamps, n, 1.0, 0, 0.0, 0.0)
    line[PERIOD_NS] = line[NOMINAL_NS] * (1.0 + slope)
    line[UNTIL_NEXT_NS] = line[PERIOD_NS] - late * line[NOMINAL_NS]
    line[MEMORY] = n
    return -1


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
    period_ns = max(period_ns, line[NOMINAL_NS] / (1.0 + LARGEST_RATE_ERROR))
    period_ns = min(period_ns, line[NOMINAL_NS] / (1.0 - LARGEST_RATE_ERROR))
    line[PERIOD_NS] = period_ns
    line[UNTIL_NEXT_NS] = on_line_ns + period_ns


@compiled_in_place
def _elsewhere(line, stamps, limit_ns, stamp_ns, rows, since_ns):
    """Return the verdict on a message that does not fit: the clock was set if several agree."""
    if stamps[ELSEWHERE] == 0 or not 0 <= since_ns <= limit_ns + rows * line[PERIOD_NS]:
        stamps[FIRST_ELSEWHERE], stamps[ELSEWHERE] = stamp_ns, 0
    stamps[ELSEWHERE] += 1
    stamps[DROPPED_ROWS] += rows
    # Late messages too rise and are behind, but only for so long, and not where the grid is new.
    is_new = stamps[HELD] <= SEVERAL
    span_ns = stamp_ns - stamps[FIRST_ELSEWHERE]
    is_set = stamp_ns > stamps[LAST] or span_ns > limit_ns or is_new
    if stamps[ELSEWHERE] < SEVERAL or not is_set:
        return DROPPED
    return _begin(line, stamps, stamp_ns, NEW_STRETCH)


@compiled_in_place
def _judge(line, stamps, max_gap_ns, stamp_ns, rows, lost):
    """Return how many samples are missing before those of a message, or DROPPED or NEW_STRETCH.

    ``lost`` messages are missing before it; -1: only its stamp can tell.
    """
    since_ns = stamp_ns - stamps[BEFORE]
    stamps[BEFORE] = stamp_ns
    if stamps[LAST] == NONE:
        return _begin(line, stamps, stamp_ns, 0)
    step_ns = stamp_ns - stamps[LAST]
    period_ns = line[PERIOD_NS]
    message_ns = rows * period_ns
    # In messages.
    behind = (step_ns - line[UNTIL_NEXT_NS] + period_ns) / message_ns - 1.0
    if lost >= 0:
        too_many = lost > 0 and (lost * rows + 0.5) * period_ns > max_gap_ns
        if too_many or step_ns - message_ns > max(max_gap_ns, LONGEST_DELAY_NS):
            return _begin(line, stamps, stamp_ns, NEW_STRETCH)
        if step_ns <= 0:  # The clock was set back.
            return _begin(line, stamps, stamp_ns, lost * rows)
        _follow(line, behind - lost, float(rows))
        stamps[LAST], stamps[LATE] = stamp_ns, 0
        stamps[HELD], stamps[LAST_HELD] = 0, stamp_ns
        _hold(line, stamps, stamp_ns, 0.0)
        return lost * rows
    close_ns = CLOSE_PERIODS * message_ns
    line[CLOSE] += ((0 <= since_ns < close_ns) - line[CLOSE]) / BUNCH_MEMORY
    line[SAME] += ((since_ns == 0) - line[SAME]) / BUNCH_MEMORY
    bunched = line[CLOSE] > BUNCHED
    limit_ns = max(max_gap_ns, LONGEST_DELAY_NS) if bunched else max_gap_ns
    jitter = max(0.0, line[JITTER] - BEHIND_A_GAP)
    # Messages are missing as far as two stamps agree that are not of one bunch.
    missing = min(max(stamps[LATE], 0), max(int(np.ceil(behind - jitter - STILL_LATE)), 0))
    missing *= since_ns > close_ns
    behind -= missing
    late = max(int(np.rint(behind - jitter)), 0)
    gap_rows = late * rows - stamps[DROPPED_ROWS]
    if 0 <= step_ns < 0.5 * message_ns and stamps[ELSEWHERE] > 0:
        # Behind dropped ones that rise to the last one, this one is that one again.
        stamps[ELSEWHERE] = 0
        return DROPPED
    if step_ns < 0 or (gap_rows > 0 and (gap_rows + 0.5) * period_ns > limit_ns):
        return _elsewhere(line, stamps, limit_ns, stamp_ns, rows, since_ns)
    if stamps[LATE] > 0 and missing == 0 and not bunched:
        stamps[WRONG] += 1
        if stamps[LATE] > 1:  # Of the latest messages it gets its place, too.
            before = PERIODS + (stamps[NEXT_HELD] - 1) % LATELY
            line[before] -= (stamps[LAST_HELD] - stamps[LAST]) / line[NOMINAL_NS]
            stamps[LAST_HELD] = stamps[LAST]
    _hold(line, stamps, stamp_ns, float(rows))
    is_early = behind < -BEHIND_A_GAP
    if not bunched and (missing > 0 or (is_early and stamps[LATE] < 0)):
        found = _lost_or_slow(line, stamps, missing * rows, late * rows)
        if found < 0:
            stamps[LAST], stamps[LATE], stamps[ELSEWHERE] = stamp_ns, 0, 0
            stamps[DROPPED_ROWS] = 0
            return 0
        if found == 0:
            behind, late, missing = behind + missing, late + missing, 0
    else:
        stamps[UNDECIDED] = 0
    if behind < -LARGEST_JITTER:
        return _begin(line, stamps, stamp_ns, missing * rows)
    _follow(line, behind - late, float(rows))
    # The place on the line; of a bunch the rows are counted, and the line follows slowly.
    stamps[LAST] = stamp_ns - int(late * message_ns * (1.0 - bunched / BUNCH_MEMORY))
    stamps[LATE], stamps[ELSEWHERE] = -1 if is_early else late, 0
    if late == 0:
        stamps[DROPPED_ROWS] = 0
    return missing * rows


@compiled_in_place
def _judge_all(line, stamps, max_gap_ns, stamps_ns, verdicts, places_ns):
    """Write the verdict of :func:`_judge` on each sample, by its stamp, and its place in time."""
    for i in range(stamps_ns.size):
        verdicts[i] = _judge(line, stamps, max_gap_ns, stamps_ns[i], 1, -1)
        places_ns[i] = stamps[LAST]


@compiled_in_place
def _arrive(line, stamps, max_gap_ns, stamp_ns, rows, lost):
    """Return the verdict of :func:`_judge`, and follow the share of dropped and bridged rows."""
    dropped = stamps[DROPPED_ROWS]
    missing = _judge(line, stamps, max_gap_ns, stamp_ns, rows, lost)
    is_dropped = missing == DROPPED
    bad = rows if is_dropped else max(missing - dropped, 0)
    # One gap alone, if it is bridged, stays below a half.
    share = line[PERIOD_NS] / max(LONGEST_DELAY_NS / 2, 2 * max_gap_ns)
    line[BAD] = 1.0 - (1.0 - line[BAD]) * math.exp(-bad * share)
    line[BAD] *= 1.0 if is_dropped else math.exp(-rows * share)
    return missing


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

    The grid is even and follows the stamps: it is a line fitted to them with a fading memory. So
    stamps may jitter by 0.3 periods either way, and the rate of the clock may be off by 15 %, with
    next to no sample being counted as missing (``python -m benchmarks extremes`` counts them). If
    early samples show more jitter, a delay must be larger to count as a gap.

    No stamp alone proves anything. Where one is late, the sample is taken as the next one, and
    samples are missing as far as the stamp after it agrees: they are then bridged before that one.
    Where stamps come later and later the clock may have changed its rate. That and losses are told
    apart by which of them the latest 20 stamps fit, if need be some samples later.
    So rows are counted where several samples have nearly the same stamp, because a driver reads
    them in bunches or its clock is coarse. A sample whose stamp is before the last one, or further
    ahead than ``max_gap_s``, is dropped. When several of these in a row agree, there was a long
    gap or the clock was set, and a new stretch begins; behind the last stamp they must also rise
    for longer than ``max_gap_s``, as late messages rise too.

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
        period_ns = period_s * 1e9
        self._line = np.zeros(MISSING + LATELY)
        self._line[:CLOSE] = period_ns, 0.0, FIRST_MEMORY, FIRST_JITTER, period_ns
        self._stamps = np.array([NONE, *[0] * LAST_HELD])
        self._number: int | None = None
        self._mended_ns = NONE  # The last stamp that was returned.
        self.max_gap_s = max_gap_s

    @property
    def period_ns(self) -> float:
        """Time from sample to sample, by the stamps."""
        return float(self._line[PERIOD_NS])

    @property
    def kind(self) -> str:
        """What the stamps are: regular, coarse (many are the same) or bunched (many are close)."""
        if self._line[CLOSE] <= BUNCHED:
            return 'regular'
        return 'coarse' if self._line[SAME] > BUNCHED else 'bunched'

    @property
    def mostly_bad(self) -> bool:
        """Whether most of the latest rows, of half a second or more, were dropped or bridged."""
        return bool(self._line[BAD] > 0.5)

    @property
    def wrong(self) -> int:
        """Number of samples that were taken at their place in spite of a late stamp."""
        return int(self._stamps[WRONG])

    def arrive(self, stamp_ns: int, rows: int = 1, number: int | None = None) -> int:
        """Return how many samples are missing before those of the next message.

        They are to be bridged with the last row; ``DROPPED`` and ``NEW_STRETCH`` stand in place of
        the number.

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
        missing = int(_arrive(self._line, self._stamps, max_gap_ns, stamp_ns, rows, lost))
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
        max_gap_ns, nominal_ns = self.max_gap_s * 1e9, self._line[NOMINAL_NS]
        _judge_all(self._line, self._stamps, max_gap_ns, stamps_ns, verdicts, places_ns)
        kept = np.flatnonzero(verdicts != DROPPED)
        missing = np.maximum(verdicts[kept], 0)
        # Each sample is preceded by the missing ones, for which the one before is repeated.
        rows = missing + 1
        ends = np.cumsum(rows) - 1
        places = np.repeat(np.concatenate([[-1], kept])[:-1], rows)
        places[ends] = kept
        before = np.repeat(ends, rows) - np.arange(len(places))
        mended_ns = np.repeat(places_ns[kept], rows)
        mended_ns -= np.rint(before * nominal_ns).astype(np.int64)
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
