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

"""Matches each true slip to at most one alarm, at many thresholds at once.

An alarm begins where the global decision rises after it was OFF for ``off_before_s`` or more; a
shorter OFF does not end the alarm before. A true slip is an interval of the label. The first rows
of a recording, and those after a long gap, are not scored, as filters and windows still settle.
Scored rows in which no alarm of a slip can rise are *rest*.

Time is counted in rows from the first row of the recording, including the rows that are missing in
gaps, so that nothing depends on rounding.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.compiled import compiled
from slip_detector.evaluation.events import LASTING, Events
from slip_detector.evaluation.figures import FALSE, REPEAT, SETTLING, TRUE, Alarm
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


class Intervals(NamedTuple):
    """Intervals of rows in order, none of them empty; three arrays of one shape.

    ``rows_before`` is the number of rows in all intervals before each.
    """

    starts: Ints
    ends: Ints
    rows_before: Ints

    @classmethod
    def between(cls, starts: Ints, ends: Ints) -> 'Intervals':
        """Return the intervals between starts and ends without those that are empty."""
        filled = starts < ends
        lengths = (ends - starts)[filled]
        return cls(starts[filled], ends[filled], np.cumsum(np.append(0, lengths)))


@compiled
def rows_until(row, intervals, k):
    """Return how many rows of intervals are before a row, and the first interval not before it.

    ``k`` is any interval up to that one.
    """
    while k < intervals.ends.size and intervals.ends[k] <= row:
        k += 1
    within = max(row - intervals.starts[k], 0) if k < intervals.ends.size else 0
    return intervals.rows_before[k] + within, k


def unscored_rows(settling_rows: int, config: EvaluationConfig, sample_rate_hz: float) -> int:
    """Return how many rows from the beginning of each stretch are not scored."""
    return max(settling_rows, round(config.off_before_s * sample_rate_hz))


@compiled
def _assign_alarm(row, lows, highs, rises, threshold):
    """Assign an alarm to the first slip that it can belong to and that has no alarm yet.

    Return whether it belongs to a slip, also where that has an alarm already. ``row`` is the row
    at which the alarm rises, and ``rises`` that of the alarm of each slip at each threshold.

    Windows overlap only where the tail of one slip meets the early part of the next. So the alarm
    can belong to the first slip whose window has not ended, or to the slip after it.
    """
    belongs, slip = False, np.searchsorted(highs, row, 'right')
    for s in range(slip, min(slip + 2, lows.size)):
        if lows[s] <= row:
            belongs = True
            if rises[s, threshold] == NONE:
                rises[s, threshold] = row
                break
    return belongs


@compiled
def _follow(
    rows, values, stretch, scored_from, off_rows, limits, windows, certain, rest, rises, alarms,
    rows_above,
):  # fmt: skip
    """Follow a statistic through all thresholds over one stretch.

    ``alarms`` counts the false alarms at each threshold, and ``rows_above`` the rows of
    ``certain`` and of ``rest`` by the number of thresholds that the statistic is above. Only what
    crosses a threshold takes time.
    """
    # For each threshold the row at which the value last fell to it.
    fell = np.full(limits.size, stretch[0] - off_rows)
    above = in_certain = in_rest = 0
    for k in range(rows.size):
        value, before, row = values[k], above, rows[k]
        while above < limits.size and value > limits[above]:
            above += 1
        while above > 0 and value <= limits[above - 1]:
            above -= 1
            fell[above] = row
        if above == before:
            continue
        certain_rows, in_certain = rows_until(row, certain, in_certain)
        rest_rows, in_rest = rows_until(row, rest, in_rest)
        rows_above[before, 0] += certain_rows
        rows_above[before, 1] += rest_rows
        rows_above[above, 0] -= certain_rows
        rows_above[above, 1] -= rest_rows
        for t in range(before, above):
            if row >= scored_from and row - fell[t] >= off_rows:
                alarms[t] += not _assign_alarm(row, windows[0], windows[1], rises, t)
    rows_above[above, 0] += rows_until(stretch[1], certain, in_certain)[0]
    rows_above[above, 1] += rows_until(stretch[1], rest, in_rest)[0]


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
    kind
        The kind of the recording.

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
    certain : Intervals
        Rows that certainly slip, of scored slips.
    rest : Intervals
        Scored rows that are in no window.

    Examples
    --------
    >>> config = EvaluationConfig(off_before_s=0.05, tail_s=0.05)
    >>> rows = ScoredRows([RowInterval(10, 20), RowInterval(50, 60)], [RowInterval(0, 100)],
    ...                   settling_rows=30, config=config, sample_rate_hz=100.0)
    >>> rows.scored, rows.settling_rows, rows.rest.starts, rows.rest.ends
    (array([False,  True]), 30, array([30, 65]), array([ 50, 100]))
    """

    def __init__(
        self,
        slips: Sequence[RowInterval],
        stretches: Sequence[RowInterval],
        settling_rows: int,
        config: EvaluationConfig,
        sample_rate_hz: float,
        accuracy_s: float = 0.0,
        kind: str = '',
    ) -> None:
        self._rate_hz, self._accuracy_s, self._kind = sample_rate_hz, accuracy_s, kind
        self.off_rows = round(config.off_before_s * sample_rate_hz)
        inexact = round(accuracy_s * sample_rate_hz)
        self._stretches, (self._starts, ends) = stretches, _columns(stretches)
        unscored = unscored_rows(settling_rows, config, sample_rate_hz)
        self.settled = np.minimum(self._starts + unscored, ends)
        slip_starts, slip_ends = _columns(slips)
        self._slip_starts = slip_starts
        stretch = self._stretch_of(slip_starts)
        self.scored = np.asarray(slip_starts >= self.settled[stretch])
        starts = np.where(self.scored, slip_starts + inexact, slip_ends)
        self.certain = Intervals.between(starts, slip_ends - inexact)
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
        self.rest = Intervals.between(starts, ends)
        self.settling_rows = int((self.settled - self._starts).sum())

    def _stretch_of(self, rows: Ints) -> Ints:
        return np.searchsorted(self._starts, rows, 'right') - 1

    def _alarms(self, on: Sequence[RowInterval]) -> list[RowInterval]:
        """Return the alarms of a decision that is ON in these intervals, which are in order.

        Two intervals in one stretch that are less than ``off_rows`` apart are one alarm.
        """
        starts, ends = _columns(on)
        stretch = self._stretch_of(starts)
        new = (starts[1:] - ends[:-1] >= self.off_rows) | (stretch[1:] != stretch[:-1])
        outer = np.ones(min(len(starts), 1), bool)
        first, last = np.concatenate([outer, new]), np.concatenate([new, outer])
        return list(map(RowInterval, starts[first].tolist(), ends[last].tolist()))

    def match(self, rows: Ints, values: Floats, limits: Floats) -> tuple[Ints, Events]:
        """Match each true slip to at most one alarm, at each of T thresholds.

        An alarm can belong to a slip when it rises within the slip's window. In the order of time
        each alarm is given to the first slip that it can belong to and that has no alarm yet; no
        other matching has more pairs. Alarms that rise while the chain settles take no part.

        Parameters
        ----------
        rows
            Rows in which the decision statistic may change, in rising order; shape (n,).
        values
            The statistic from each of these rows up to the next, or to the end of the stretch. The
            decision is ON where it is above the threshold.
        limits
            The thresholds in rising order; shape (T,).

        Returns
        -------
        rises : ndarray of int, shape (slips, T)
            The row at which the alarm of each slip rises; ``NONE`` where it has none.
        events : Events
            The same of the slips that are scored, and the rest.

        Examples
        --------
        >>> config = EvaluationConfig(off_before_s=0.0, tail_s=0.05)
        >>> slips, stretches = [RowInterval(10, 20), RowInterval(50, 60)], [RowInterval(0, 99)]
        >>> rows = ScoredRows(slips, stretches, 0, config, sample_rate_hz=100.0)
        >>> rises, events = rows.match(np.array([12, 17, 40, 41]), np.array([2.0, 1.0, 3.0, 0.0]),
        ...                            limits=np.array([0.5, 1.5]))
        >>> rises.tolist(), events.rest[2]
        ([[12, 12], [-1, -1]], array([0., 1.]))
        """
        rises = np.full((len(self.lows), limits.size), NONE, np.int64)
        alarms, rows_above = np.zeros(limits.size), np.zeros((limits.size + 1, 2))
        cuts = [0, *np.searchsorted(rows, self._starts[1:]), rows.size]
        parts = map(slice, cuts[:-1], cuts[1:])
        for stretch, scored_from, part in zip(self._stretches, self.settled, parts, strict=False):
            _follow(
                rows[part], values[part], stretch, scored_from, self.off_rows, limits,
                (self.lows, self.highs), self.certain, self.rest, rises, alarms, rows_above,
            )  # fmt: skip
        late_s = (rises - self._slip_starts[:, np.newaxis]) / self._rate_hz
        late_s -= np.clip(late_s, -self._accuracy_s, self._accuracy_s)
        latencies_ms = np.where(rises == NONE, np.nan, 1e3 * late_s)[self.scored]
        lasting = np.zeros((len(LASTING), 3, limits.size))
        slip, rest = lasting[0], lasting[LASTING.index(self._kind)]
        whole = (self.certain, self.rest)
        slip[0], rest[0] = (of.rows_before[-1] / self._rate_hz for of in whole)
        # It is ON at threshold t where it is above more than t thresholds.
        on_rows = np.cumsum(rows_above[::-1], axis=0)[-2::-1]
        (slip[1], rest[1]), rest[2] = on_rows.T / self._rate_hz, alarms
        of_scored = self.leads_s[self.scored], self.windows_s[self.scored]
        return rises, Events(latencies_ms, *of_scored, lasting, int(np.sum(~self.scored)))

    def match_decision(
        self, on: Sequence[RowInterval]
    ) -> tuple[list[Alarm], dict[int, int], Events]:
        """Match slips and alarms of a decision that is ON in these intervals, which are in order.

        Returns
        -------
        alarms : list of Alarm
        alarm_of : dict
            The number of the alarm of each scored slip that has one.
        events : Events
            The events at the one threshold.

        Examples
        --------
        >>> config = EvaluationConfig(off_before_s=0.0, tail_s=0.05)
        >>> slips, stretches = [RowInterval(10, 20), RowInterval(50, 60)], [RowInterval(0, 99)]
        >>> rows = ScoredRows(slips, stretches, 0, config, sample_rate_hz=100.0)
        >>> alarms, alarm_of, _ = rows.match_decision([RowInterval(k, k + 1) for k in (12, 17)])
        >>> alarm_of, [(alarm.outcome, alarm.slip) for alarm in alarms]
        ({0: 0}, [('true', 0), ('repeat', 0)])
        """
        edges, alarms = np.array(on, np.int64).ravel(), self._alarms(on)
        rises, events = self.match(edges, np.resize([1.0, 0.0], edges.size), np.array([0.5]))
        slip_of_rise = {row: slip for slip, row in enumerate(rises[:, 0].tolist()) if row != NONE}
        starts, _ = _columns(alarms)
        settles = starts < self.settled[self._stretch_of(starts)]
        # Any other alarm belongs to the first slip whose window it rises in.
        windows = np.searchsorted(self.highs, starts, 'right')
        inside = np.append(self.lows, np.iinfo(np.int64).max)[windows] <= starts
        alarm_of, found = dict[int, int](), list[Alarm]()
        for number, (start, end) in enumerate(alarms):
            slip = slip_of_rise.get(start, int(windows[number]) if inside[number] else None)
            if settles[number] or (slip is not None and not self.scored[slip]):
                outcome = SETTLING
            elif slip is None:
                outcome = FALSE
            elif start in slip_of_rise:
                outcome, alarm_of[slip] = TRUE, number
            else:
                outcome = REPEAT
            found.append(Alarm(start / self._rate_hz, end / self._rate_hz, outcome, slip))
        return found, alarm_of, events


def _columns(intervals: Sequence[RowInterval]) -> tuple[Ints, Ints]:
    starts, ends = np.array(intervals, np.int64).reshape(-1, 2).T.copy()
    return starts, ends
