"""Matches each true slip to at most one alarm, at one threshold or at many at once.

An alarm lasts from a rise of the global decision to its fall; a true slip is an interval of the
label. Time is counted in rows from the first row of the recording, with the rows that are missing
in gaps, so that nothing depends on rounding.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.evaluation import EvaluationConfig

Ints = NDArray[np.int64]

#: Stands in place of the number of an alarm or a slip where there is none.
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
        Rows at which the signal rises and falls, in turns.

    Examples
    --------
    >>> signal = OnIntervals()
    >>> signal.add(np.array([False, True]), first_row=0)
    [1]
    >>> signal.add(np.array([True, False, True]), first_row=2)
    [4]
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

    def add(self, on: NDArray[np.bool_], first_row: int) -> list[int]:
        """Take the next rows and return those at which the signal rises.

        Parameters
        ----------
        on
            The signal, shape (n,).
        first_row
            The number of the first of these rows.
        """
        if not on.size:
            return []
        turns = (np.flatnonzero(on[1:] != on[:-1]) + (first_row + 1)).tolist()
        if bool(on[0]) != self.on:
            turns.insert(0, first_row)
        known = len(self.edges)
        self.edges += turns
        return self.edges[known + known % 2 :: 2]

    def close(self, end_row: int) -> None:
        """End the interval that is open, if there is one, before a row."""
        if self.on:
            self.edges.append(end_row)

    def closed(self) -> list[RowInterval]:
        """Return the intervals that have ended, the oldest first."""
        pairs = zip(self.edges[::2], self.edges[1::2], strict=False)
        return [RowInterval(*pair) for pair in pairs]


def tolerance_rows(config: EvaluationConfig, sample_rate_hz: float) -> tuple[int, int]:
    """Return how many rows before a slip, and how many after its end, its alarm may rise.

    Examples
    --------
    >>> tolerance_rows(EvaluationConfig(early_s=0.01, tail_s=0.1), sample_rate_hz=380.0)
    (4, 38)
    """
    return round(config.early_s * sample_rate_hz), round(config.tail_s * sample_rate_hz)


def alarm_windows(
    slips: Sequence[RowInterval], early_rows: int, tail_rows: int
) -> tuple[Ints, Ints]:
    """Return the window of each slip: the rows at which an alarm that belongs to it can rise.

    A window begins ``early_rows`` before the slip, but not within the slip before it. It ends
    ``tail_rows`` after the slip, but before the next slip.

    Parameters
    ----------
    slips
        In the order of time, without overlap.
    early_rows, tail_rows
        At least 0.

    Returns
    -------
    lows, highs : ndarray of int, shape (slips,)
        The first row of each window and the first row after it.

    Examples
    --------
    >>> alarm_windows([RowInterval(10, 20), RowInterval(25, 30)], early_rows=8, tail_rows=9)
    (array([ 2, 20]), array([25, 39]))
    """
    bounds = np.array(slips, np.int64).reshape(-1, 2)
    lows, highs = bounds[:, 0] - early_rows, bounds[:, 1] + tail_rows
    lows[1:] = np.maximum(lows[1:], bounds[:-1, 1])
    highs[:-1] = np.minimum(highs[:-1], bounds[1:, 0])
    return lows, highs


@compiled
def slip_not_over(row, slip, highs):
    """Return the first slip, from ``slip`` on, whose window has not ended before a row."""
    while slip < highs.size and highs[slip] <= row:
        slip += 1
    return slip


@compiled
def give_alarm(alarm, row, slip, lows, alarm_of, threshold):
    """Give an alarm to the first slip that it can belong to and that has no alarm yet.

    Windows overlap only where one slip's tail meets the early part of the next. So the alarm can
    belong to ``slip``, the first whose window has not ended, or to the slip after it.

    Parameters
    ----------
    alarm : int
        Number of the alarm, at least 0.
    row : int
        The row at which the alarm rises.
    slip : int
        See :func:`slip_not_over`.
    lows : ndarray of int, shape (slips,)
        See :func:`alarm_windows`.
    alarm_of : ndarray of int, shape (slips, thresholds)
        The number of each slip's alarm at each threshold, ``NONE`` before there is one.
    threshold : int
        Index of the threshold at which the alarm rises.

    Returns
    -------
    int
        The slip that the alarm belongs to, also where it is a repeated alarm; ``NONE`` for a
        false alarm.
    """
    belongs = NONE
    for s in range(slip, min(slip + 2, lows.size)):
        if lows[s] <= row:
            if alarm_of[s, threshold] == NONE:
                alarm_of[s, threshold] = alarm
                return s
            if belongs == NONE:
                belongs = s
    return belongs


@compiled
def is_false(row, slip, lows):
    """Return whether :func:`give_alarm` finds no slip for an alarm, whatever the threshold."""
    return slip == lows.size or row < lows[slip]


@compiled
def _match(rises, lows, highs, alarm_of, slip_of):
    slip = 0
    for alarm in range(rises.size):
        slip = slip_not_over(rises[alarm], slip, highs)
        slip_of[alarm] = give_alarm(alarm, rises[alarm], slip, lows, alarm_of, 0)


def match(
    slips: Sequence[RowInterval], rises: Sequence[int], early_rows: int, tail_rows: int
) -> tuple[list[int | None], list[int | None]]:
    """Match each true slip to at most one alarm and each alarm to at most one slip.

    An alarm can belong to a slip when it rises within the slip's window, see
    :func:`alarm_windows`. In the order of time each alarm is given to the first slip that it can
    belong to and that has no alarm yet; no other matching has more pairs.

    Parameters
    ----------
    slips
        In the order of time, without overlap.
    rises
        Rows at which the alarms rise, in the order of time.
    early_rows, tail_rows
        At least 0.

    Returns
    -------
    alarm_of : list of int or None
        The alarm of each slip; None for a missed slip.
    slip_of : list of int or None
        The slip that each alarm belongs to, also where it is a repeated alarm; None for a false
        alarm.

    Examples
    --------
    >>> match([RowInterval(10, 20), RowInterval(50, 60)], [12, 17, 40], early_rows=0, tail_rows=5)
    ([0, None], [0, 0, None])
    """
    lows, highs = alarm_windows(slips, early_rows, tail_rows)
    alarm_of = np.full((len(slips), 1), NONE, np.int64)
    slip_of = np.full(len(rises), NONE, np.int64)
    _match(np.array(rises, np.int64), lows, highs, alarm_of, slip_of)
    return _or_none(alarm_of[:, 0]), _or_none(slip_of)


def _or_none(numbers: Ints) -> list[int | None]:
    return [None if number == NONE else number for number in numbers.tolist()]
