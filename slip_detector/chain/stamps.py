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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
LONGEST_DELAY_S = 1.0

#: Jitter in periods that is assumed before any was observed.
FIRST_JITTER = 0.75


# Elements of the array that holds the line: the sample period, the time until the next sample is
# expected, the memory in messages, the jitter in periods, and the bounds of the period.
PERIOD_NS, UNTIL_NEXT_NS, MEMORY, JITTER, FASTEST_NS, SLOWEST_NS = range(6)


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
    jitter = line[JITTER] * (1.0 - 1.0 / JITTER_MEMORY)
    line[JITTER] = off if off > jitter else jitter
    gain = 1.0 / (n * (n + 1.0))
    period_ns = line[PERIOD_NS]
    # The time until the next sample: from this stamp to its place on the line, plus one period.
    on_line_ns = -behind * (1.0 - 2.0 * (2.0 * n - 1.0) * gain) * rows * period_ns
    period_ns *= 1.0 + behind * 6.0 * gain
    period_ns = min(max(period_ns, line[FASTEST_NS]), line[SLOWEST_NS])
    line[PERIOD_NS] = period_ns
    line[UNTIL_NEXT_NS] = on_line_ns + period_ns


@compiled_in_place
def _follow_all(line, steps_ns):
    """Follow samples until one is not the next one expected; return whether all were."""
    for i in range(steps_ns.size):
        step_ns = float(steps_ns[i])
        behind = (step_ns - line[UNTIL_NEXT_NS]) / line[PERIOD_NS]
        missing = behind - max(0.0, line[JITTER] - BEHIND_A_GAP)
        if step_ns <= 0.0 or behind < -LARGEST_JITTER or missing > 0.5:
            return False
        _follow(line, behind, 1.0)
    return True


class Arrival(NamedTuple):
    """What to do with a sample.

    Attributes
    ----------
    accepted : bool
        Whether the sample is used; it is dropped if its stamp is not after the last one.
    missing : int
        Number of missing samples before it, which are bridged with the last row.
    reset : bool
        Whether the sample begins a new stretch: too many are missing, or the clock was set back.
    """

    accepted: bool
    missing: int
    reset: bool

    def bridge(self, last: ArrayLike, rows: ArrayLike) -> NDArray[Any]:
        """Return rows preceded by the missing ones, for which the last row is repeated.

        Parameters
        ----------
        last
            The row before the gap, shape (1, ...).
        rows
            The rows after the gap, shape (n, ...).

        Examples
        --------
        >>> Arrival(accepted=True, missing=2, reset=False).bridge([4.1], [4.3])
        array([4.1, 4.1, 4.3])
        """
        return np.concatenate([np.repeat(last, self.missing, axis=0), rows])


NEXT = Arrival(True, 0, False)
NEW_STRETCH = Arrival(True, 0, True)
BACKWARDS = Arrival(False, 0, False)


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
    >>> [grid.arrive(ms * 1_000_000).missing for ms in (0, 10, 20, 50)]
    [0, 0, 0, 2]
    >>> grid.arrive(2_000_000_000).reset
    True
    """

    def __init__(self, period_s: float, max_gap_s: float) -> None:
        period_ns = period_s * 1e9
        self._line = np.array(
            [
                period_ns,
                0.0,
                FIRST_MEMORY,
                FIRST_JITTER,
                (1.0 - LARGEST_RATE_ERROR) * period_ns,
                (1.0 + LARGEST_RATE_ERROR) * period_ns,
            ]
        )
        self._nominal_ns = period_ns
        self.max_gap_s = max_gap_s
        self._last_ns: int | None = None
        self._number: int | None = None
        self._dropped_first_ns: int | None = None
        self._dropped_last_ns = 0

    @property
    def period_ns(self) -> float:
        """Time from sample to sample, by the stamps."""
        return float(self._line[PERIOD_NS])

    def arrive(self, stamp_ns: int, rows: int = 1, number: int | None = None) -> Arrival:
        """Return what to do with the samples of the next message.

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
        >>> [grid.arrive(ms * 1_000_000, 10, n).missing for n, ms in published_ms.items()]
        [0, 0, 0, 0, 10]
        """
        if self._last_ns is None:
            self._begin(stamp_ns)
            arrival = NEXT
        elif number is None or self._number is None or number <= self._number:
            arrival = self._arrive_by_stamp(stamp_ns, rows)
        else:
            arrival = self._arrive_by_number(stamp_ns, rows, number - self._number - 1)
        if arrival.accepted:
            self._number = number
        return arrival

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
        if not stamps_ns.size:
            return True
        last_ns, line = self._last_ns, self._line.copy()
        if last_ns is None:
            self._begin(int(stamps_ns[0]))
            steps_ns = np.diff(stamps_ns)
        else:
            steps_ns = np.diff(stamps_ns, prepend=last_ns)
        if _follow_all(self._line, steps_ns):
            self._last_ns, self._dropped_first_ns = int(stamps_ns[-1]), None
            return True
        self._last_ns, self._line = last_ns, line
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
        places: list[int] = []
        mended_ns: list[int] = []
        starts = [0]
        last, gaps, bridged, dropped = -1, 0, 0, 0
        for i, stamp_ns in enumerate(stamps_ns.tolist()):
            arrival = self.arrive(stamp_ns)
            if not arrival.accepted:
                dropped += 1
                continue
            if arrival.reset:
                starts.append(len(places))
            if arrival.missing:
                gaps += 1
                bridged += arrival.missing
                begin_ns = stamp_ns - round(arrival.missing * self._nominal_ns)
                mended_ns += [
                    begin_ns + round(k * self._nominal_ns) for k in range(arrival.missing)
                ]
                places += arrival.bridge([last], [i]).tolist()
            else:
                places.append(i)
            mended_ns.append(stamp_ns)
            last = i
        return MendedSamples(
            np.array(places, np.int64),
            np.array(mended_ns, np.int64),
            tuple(slice(a, b) for a, b in pairwise([*starts, len(places)]) if a < b),
            starts[1:2] == [0],
            gaps,
            bridged,
            dropped,
        )

    def _arrive_by_stamp(self, stamp_ns: int, rows: int) -> Arrival:
        assert self._last_ns is not None
        step_ns = stamp_ns - self._last_ns
        if step_ns <= 0:
            return self._backwards(stamp_ns)
        self._dropped_first_ns = None
        period_ns, until_next_ns, _, jitter, _, _ = self._line.tolist()
        # In periods of the messages.
        behind = ((step_ns - until_next_ns) / period_ns - (rows - 1)) / rows
        if behind < -LARGEST_JITTER:
            self._begin(stamp_ns)
            return NEXT
        missing = 0
        if behind >= BEHIND_A_GAP:
            missing = max(0, round(behind - max(0.0, jitter - BEHIND_A_GAP)))
            if missing and step_ns - (rows - 1) * period_ns > self.max_gap_s * 1e9:
                self._begin(stamp_ns)
                return NEW_STRETCH
            behind -= missing
        _follow(self._line, behind, float(rows))
        self._last_ns = stamp_ns
        return Arrival(True, missing * rows, False) if missing else NEXT

    def _arrive_by_number(self, stamp_ns: int, rows: int, lost: int) -> Arrival:
        """Return what to do with a message before which ``lost`` messages are missing."""
        assert self._last_ns is not None
        step_ns = stamp_ns - self._last_ns
        missing = lost * rows
        period_ns, until_next_ns = self._line[:2].tolist()
        too_many = missing > 0 and (missing + 1) * period_ns > self.max_gap_s * 1e9
        pause_ns = step_ns - rows * period_ns
        if too_many or pause_ns > max(self.max_gap_s, LONGEST_DELAY_S) * 1e9:
            self._begin(stamp_ns)
            return NEW_STRETCH
        if step_ns <= 0:  # The clock was set back.
            self._begin(stamp_ns)
        else:
            # In periods of the messages.
            behind = ((step_ns - until_next_ns) / period_ns - (rows - 1)) / rows - lost
            _follow(self._line, behind, float(rows))
            self._last_ns = stamp_ns
            self._dropped_first_ns = None
        return Arrival(True, missing, False) if missing else NEXT

    def _begin(self, stamp_ns: int) -> None:
        self._last_ns = stamp_ns
        self._line[UNTIL_NEXT_NS] = self._line[PERIOD_NS]
        self._line[MEMORY] = FIRST_MEMORY
        self._dropped_first_ns = None

    def _backwards(self, stamp_ns: int) -> Arrival:
        if self._dropped_first_ns is None or stamp_ns <= self._dropped_last_ns:
            self._dropped_first_ns = stamp_ns
        self._dropped_last_ns = stamp_ns
        if stamp_ns - self._dropped_first_ns <= self.max_gap_s * 1e9:
            return BACKWARDS
        self._begin(stamp_ns)
        return NEW_STRETCH
