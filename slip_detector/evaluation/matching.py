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

"""Matches each true slip to at most one alarm, at one threshold or at many at once.

An alarm begins where the global decision rises after it was OFF for ``off_before_s`` or more; a
shorter OFF does not end the alarm before. A true slip is an interval of the label. The first rows
of a recording, and those after a long gap, are not scored, as filters and windows still settle.
Scored rows in which no alarm of a slip can rise are *rest*.

Time is counted in rows from the first row of the recording, including the rows that are missing in
gaps, so that nothing depends on rounding.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.compiled import compiled
from slip_detector.evaluation.events import LASTING, Events
from slip_detector.parameters import EvaluationConfig

#: Takes the place of the number of an alarm or a slip where there is none.
NONE = -1


class RowInterval(NamedTuple):
    """The rows from ``start`` up to, but not including, ``end``."""

    start: int
    end: int


class OnIntervals:
    """Collects the intervals in which a signal is ON; its rows may come in pieces of any length.

    Attributes
    ----------
    edges : list of int
        Rows at which the signal rises and falls, alternately.

    Examples
    --------
    >>> signal = OnIntervals()
    >>> signal.add(np.array([False, True]), first_row=0)
    >>> signal.add(np.array([True, False, True]), first_row=2)
    >>> signal.close(end_row=5)
    >>> signal.closed()
    [RowInterval(start=1, end=3), RowInterval(start=4, end=5)]
    """

    def __init__(self) -> None:
        self.edges: list[int] = []

    @property
    def on(self) -> bool:
        """Whether the signal was ON in the last row."""
        return len(self.edges) % 2 == 1

    def add(self, on: Bools, first_row: int) -> None:
        """Take the next rows of the signal, shape (n,), and the number of the first of them."""
        turns = np.flatnonzero(np.diff(on, prepend=self.on))
        self.edges += (turns + first_row).tolist()

    def close(self, end_row: int) -> None:
        """End the interval that is open, if there is one, before a row."""
        if self.on:
            self.edges.append(end_row)

    def closed(self) -> list[RowInterval]:
        """Return the intervals that have ended, the oldest first."""
        return list(map(RowInterval, self.edges[::2], self.edges[1::2]))


def rows_on(on: Sequence[RowInterval], starts: ArrayLike, ends: ArrayLike) -> Ints:
    """Return in how many rows from each start to its end, shapes (n,), a signal is ON.

    Examples
    --------
    >>> rows_on([RowInterval(2, 5), RowInterval(8, 9)], starts=[0, 4], ends=[3, 9])
    array([1, 2])
    """
    edges = np.array([0, 0, *itertools.chain(*on)], np.int64)
    # The rows that are ON before each edge: within an interval they grow by one a row.
    before = np.cumsum(np.diff(edges, prepend=0) * (np.arange(edges.size) % 2))
    rows_before = np.interp([starts, ends], edges, before)
    return np.asarray(np.diff(rows_before, axis=0)[0], np.int64)


def unscored_rows(settling_rows: int, config: EvaluationConfig, sample_rate_hz: float) -> int:
    """Return how many rows from the beginning of each stretch are not scored."""
    return max(settling_rows, round(config.off_before_s * sample_rate_hz))


@compiled
def assign_alarm(alarm, row, lows, highs, alarm_of, threshold):
    """Assign an alarm to the first slip that it can belong to and that has no alarm yet.

    Return the slip, also where the alarm is a repeated one; ``NONE`` for a false alarm. ``row`` is
    the row at which the alarm rises, and ``alarm_of`` has the number of each slip's alarm at each
    threshold, ``NONE`` before there is one; shape (slips, thresholds).

    Windows overlap only where the tail of one slip meets the early part of the next. So the alarm
    can belong to the first slip whose window has not ended, or to the slip after it.
    """
    belongs, slip = NONE, np.searchsorted(highs, row, 'right')
    for s in range(slip, min(slip + 2, lows.size)):
        if lows[s] <= row:
            if alarm_of[s, threshold] == NONE:
                alarm_of[s, threshold] = alarm
                return s
            if belongs == NONE:
                belongs = s
    return belongs


class ScoredRows:
    """The rows of a recording that are scored, and those in which the alarm of each slip may rise.

    The *window* of a slip, in which an alarm that belongs to it can rise, begins ``early_s``
    before the slip, but not within the slip before it. It ends ``tail_s`` after the slip, but
    before the next slip. It has only scored rows of the stretch of its slip. Both times are longer
    by the accuracy of the label.

    Parameters
    ----------
    slips
        True slips in the order of time, without overlap; each within a stretch.
    stretches
        The stretches of the recording, each of at least one row; the chain is reset at the
        beginning of each.
    settling_rows
        Number of rows for which the chain settles, see :func:`.filters.settling_rows`.
    config
        What counts as detected.
    sample_rate_hz
        Rate of the recording.
    accuracy_s
        How exact the starts and ends of the slips are.

    Attributes
    ----------
    off_rows : int
        Least number of rows for which the decision is OFF before an alarm.
    settled : ndarray of int, shape (stretches,)
        The first scored row of each stretch, at least ``off_rows`` after its beginning; the end
        of a stretch in which no row is scored.
    scored : ndarray of bool, shape (slips,)
        Whether a slip begins in a row that is scored. The others are neither found nor missed.
    lows, highs : ndarray of int, shape (slips,)
        The first row of each window and the first row after it.
    leads_s, windows_s : ndarray, shape (slips,)
        Time from the beginning of each window to the middle of the first row of its slip, or, as
        far as its start is not exact, to the latest such row; and length of the window.
    certain : tuple of ndarray of int, shapes (slips,)
        First and last rows, plus one, that certainly slip, of scored slips; none of others.
    rest : tuple of ndarray of int, shapes (intervals,)
        The same of the rest: scored rows that are in no window.

    Examples
    --------
    >>> config = EvaluationConfig(off_before_s=0.05, tail_s=0.05)
    >>> rows = ScoredRows([RowInterval(10, 20), RowInterval(50, 60)], [RowInterval(0, 100)],
    ...                   settling_rows=30, config=config, sample_rate_hz=100.0)
    >>> rows.scored, rows.settling_rows, rows.rest
    (array([False,  True]), 30, (array([30, 65]), array([ 50, 100])))
    """

    def __init__(
        self,
        slips: Sequence[RowInterval],
        stretches: Sequence[RowInterval],
        settling_rows: int,
        config: EvaluationConfig,
        sample_rate_hz: float,
        accuracy_s: float = 0.0,
    ) -> None:
        self._rate_hz, self._accuracy_s = sample_rate_hz, accuracy_s
        self.off_rows = round(config.off_before_s * sample_rate_hz)
        inexact = round(accuracy_s * sample_rate_hz)
        self._starts, ends = _columns(stretches)
        unscored = unscored_rows(settling_rows, config, sample_rate_hz)
        self.settled = np.minimum(self._starts + unscored, ends)
        slip_starts, slip_ends = _columns(slips)
        self._slip_starts = slip_starts
        stretch = self._stretch_of(slip_starts)
        self.scored = np.asarray(slip_starts >= self.settled[stretch])
        starts = np.where(self.scored, slip_starts + inexact, slip_ends)
        self.certain = starts, np.maximum(slip_ends - inexact, starts)
        lows = slip_starts - round(config.early_s * sample_rate_hz) - inexact
        highs = slip_ends + round(config.tail_s * sample_rate_hz) + inexact
        lows[1:] = np.maximum(lows[1:], slip_ends[:-1])
        highs[:-1] = np.minimum(highs[:-1], slip_starts[1:])
        self.lows = np.maximum(lows, self.settled[stretch])
        self.highs = np.maximum(np.minimum(highs, ends[stretch]), self.lows)
        leads = slip_starts + inexact - self.lows + 0.5
        self.leads_s: Floats = np.asarray(leads / sample_rate_hz, np.float64)
        self.windows_s = (self.highs - self.lows) / sample_rate_hz
        # Rest begins where a window ends or the chain has settled, and lasts to the next window
        # or the end of the stretch. There is no rest between windows that meet or overlap.
        starts = np.sort(np.concatenate([self.settled, self.highs]))
        ends = np.sort(np.concatenate([self.lows, ends]))
        self.rest = starts[starts < ends], ends[starts < ends]
        self.settling_rows = int((self.settled - self._starts).sum())

    def _stretch_of(self, rows: Ints) -> Ints:
        return np.searchsorted(self._starts, rows, 'right') - 1

    def alarms(self, on: Sequence[RowInterval]) -> list[RowInterval]:
        """Return the alarms of a decision that is ON in these intervals, which are in order.

        Two intervals in one stretch that are less than ``off_rows`` apart are one alarm.

        Examples
        --------
        >>> config = EvaluationConfig(off_before_s=0.05)
        >>> rows = ScoredRows([], [RowInterval(0, 100)], 0, config, sample_rate_hz=100.0)
        >>> rows.alarms([RowInterval(10, 20), RowInterval(24, 30), RowInterval(35, 36)])
        [RowInterval(start=10, end=30), RowInterval(start=35, end=36)]
        """
        starts, ends = _columns(on)
        stretch = self._stretch_of(starts)
        new = (starts[1:] - ends[:-1] >= self.off_rows) | (stretch[1:] != stretch[:-1])
        outer = np.ones(min(len(starts), 1), bool)
        first, last = np.concatenate([outer, new]), np.concatenate([new, outer])
        return list(map(RowInterval, starts[first].tolist(), ends[last].tolist()))

    def settling(self, rises: Sequence[int]) -> Bools:
        """Return at which rows the chain still settles after a stretch began; shape (n,)."""
        rows = np.array(rises, np.int64)
        return np.asarray(rows < self.settled[self._stretch_of(rows)])

    def events(
        self, kind: str, rises: Ints, alarms: Ints, on_certain: Ints, on_rest: Ints
    ) -> Events:
        """Return what a decision makes of the recording at each of T thresholds.

        Parameters
        ----------
        kind
            The kind of the recording.
        rises
            The row at which the alarm of each slip rises, ``NONE`` without one; shape (slips, T).
        alarms
            Number of false alarms; shape (T,).
        on_certain, on_rest
            In how many rows of :attr:`certain` and :attr:`rest` it is ON; shapes (T,).
        """
        late_s = (rises - self._slip_starts[:, np.newaxis]) / self._rate_hz
        late_s -= np.clip(late_s, -self._accuracy_s, self._accuracy_s)
        latencies_ms = np.where(rises == NONE, np.nan, 1e3 * late_s)[self.scored]
        lasting = np.zeros((len(LASTING), 3, len(alarms)))
        slip, rest = lasting[0], lasting[LASTING.index(kind)]
        slip[0], rest[0] = (np.sum(b - a) / self._rate_hz for a, b in (self.certain, self.rest))
        slip[1], rest[1], rest[2] = on_certain / self._rate_hz, on_rest / self._rate_hz, alarms
        of_scored = self.leads_s[self.scored], self.windows_s[self.scored]
        return Events(latencies_ms, *of_scored, lasting, int(np.sum(~self.scored)))

    def match(self, rises: Sequence[int]) -> tuple[Ints, Ints]:
        """Match each true slip to at most one alarm and each alarm to at most one slip.

        An alarm can belong to a slip when it rises within the slip's window. In the order of time
        each alarm is given to the first slip that it can belong to and that has no alarm yet; no
        other matching has more pairs. Alarms that rise while the chain settles take no part.

        Parameters
        ----------
        rises
            Rows at which the alarms rise, in the order of time.

        Returns
        -------
        alarm_of : ndarray of int, shape (slips,)
            The alarm of each slip; ``NONE`` where there is none, or the slip is not scored.
        slip_of : ndarray of int, shape (alarms,)
            The slip that each alarm belongs to, also where it is a repeated alarm; else ``NONE``.

        Examples
        --------
        >>> config = EvaluationConfig(off_before_s=0.0, tail_s=0.05)
        >>> slips, stretches = [RowInterval(10, 20), RowInterval(50, 60)], [RowInterval(0, 99)]
        >>> ScoredRows(slips, stretches, 0, config, sample_rate_hz=100.0).match([12, 17, 40])
        (array([ 0, -1]), array([ 0,  0, -1]))
        """
        alarm_of = np.full((len(self.lows), 1), NONE, np.int64)
        slip_of = np.full(len(rises), NONE, np.int64)
        rows = np.array(rises, np.int64)
        for alarm in np.flatnonzero(~self.settling(rises)):
            slip_of[alarm] = assign_alarm(alarm, rows[alarm], self.lows, self.highs, alarm_of, 0)
        alarm_of[~self.scored] = NONE
        return alarm_of[:, 0], slip_of


def _columns(intervals: Sequence[RowInterval]) -> tuple[Ints, Ints]:
    starts, ends = np.array(intervals, np.int64).reshape(-1, 2).T.copy()
    return starts, ends
