"""Slips and alarms as events: each true slip is matched to at most one alarm.

An alarm is the time from a rise of the global decision to its fall; a true slip is an interval of
the label. Time is counted in rows here, from the first row of the recording, those that are
missing in a gap counted as well, so that nothing depends on rounding.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: What a signal passes on its way to the global decision, in order; the parts of a latency.
STAGES = ('filter', 'envelope', 'decision', 'vote')

#: In place of a stage: the global decision was ON before the slip began.
ALREADY_ON = 'already_on'

#: Kinds of alarms.
TRUE, REPEAT, FALSE = 'true', 'repeat', 'false'


class RowInterval(NamedTuple):
    """Rows from ``start`` to before ``end``."""

    start: int
    end: int


class OnIntervals:
    """Collects the intervals in which a signal is ON, over any cut of its rows into pieces.

    Attributes
    ----------
    edges : list of int
        Rows at which it rises and falls, in turns.
    """

    def __init__(self) -> None:
        self.edges: list[int] = []

    @property
    def on(self) -> bool:
        """Whether the signal was ON in the last row."""
        return len(self.edges) % 2 == 1

    def add(self, on: NDArray[np.bool_], first_row: int) -> None:
        """Take the next rows.

        Parameters
        ----------
        on
            The signal, shape (n,).
        first_row
            When the first of them is.
        """
        if not on.size:
            return
        turns = (np.flatnonzero(on[1:] != on[:-1]) + (first_row + 1)).tolist()
        if bool(on[0]) != self.on:
            turns.insert(0, first_row)
        self.edges += turns

    def close(self, end_row: int) -> None:
        """End the interval that is open, if one is: the rows end before this one."""
        if self.on:
            self.edges.append(end_row)

    def closed(self) -> list[RowInterval]:
        """Return the intervals that have ended, the oldest first."""
        return [
            RowInterval(*pair) for pair in zip(self.edges[::2], self.edges[1::2], strict=False)
        ]


def match(
    slips: Sequence[RowInterval], rises: Sequence[int], early_rows: int, tail_rows: int
) -> tuple[list[int | None], list[int | None]]:
    """Match each true slip to at most one alarm and each alarm to at most one slip.

    An alarm can belong to a slip when it rises from ``early_rows`` before the slip's start, but
    not within the slip before it, to ``tail_rows`` after its end, but not within the next slip. In
    the order of time each alarm is given to the first slip that it can belong to and that has
    none yet; no other matching has more pairs.

    Parameters
    ----------
    slips
        Rising, without overlap.
    rises
        Rows at which the alarms rise, rising.
    early_rows, tail_rows
        At least 0.

    Returns
    -------
    alarm_of : list of int or None
        By slip: its alarm.
    slip_of : list of int or None
        By alarm: the slip that it belongs to, be it as its alarm or as a repetition; None for a
        false alarm.
    """
    alarm_of: list[int | None] = [None] * len(slips)
    slip_of: list[int | None] = []
    windows = []
    for i, (start, end) in enumerate(slips):
        low, high = start - early_rows, end + tail_rows
        low = max(low, slips[i - 1].end) if i else low
        windows.append((low, min(high, slips[i + 1].start) if i + 1 < len(slips) else high))
    at = 0
    for alarm, rise in enumerate(rises):
        while at < len(windows) and windows[at][1] <= rise:
            at += 1
        # The tail of one slip can meet the early part of the next, no further one.
        able = [i for i, (low, _) in enumerate(windows[at : at + 2], at) if low <= rise]
        free = [i for i in able if alarm_of[i] is None]
        if free:
            alarm_of[free[0]] = alarm
        slip_of.append(free[0] if free else able[0] if able else None)
    return alarm_of, slip_of


@dataclasses.dataclass(frozen=True)
class TrueSlip:
    """A true slip and what became of it. Times are seconds from the start of the recording.

    Attributes
    ----------
    start_s, end_s : float
        Of the label: its first row and the first after it.
    alarm : int or None
        Which alarm of the recording is its own; None: it was missed.
    latency_s : float or None
        From the start to the rise of its alarm; negative where that came before the label.
    late : bool
        Whether the latency is above ``late_after_s``.
    stages_s : dict or None
        Where the latency went, by :data:`STAGES`; the parts sum to it. Until a channel of the
        group that decided has a filtered signal (rectified, to its exponent) above the threshold:
        ``filter``, which is the filter's delay and the time that the slip takes to be felt; from
        there until the envelope of one is: ``envelope``; until the level of one is, which turns
        the channel ON: ``decision``; until the group has its vote: ``vote``. None where there is
        no latency, the alarm came before the label or the global decision was ON before the slip.
    lost_at : str or None
        Of a missed slip: the first of :data:`STAGES` that no channel came through while its alarm
        was looked for, or ``vote`` where channels were ON and no group was; :data:`ALREADY_ON`
        where the global decision was ON before it began. None where it was not missed.
    on_at_start : bool
        Whether the global decision was ON in the row before the slip.
    on_while : bool
        Whether the global decision was ON at any time of the slip (the paper's success).
    channel_delays_s : tuple of float or None
        By enabled channel: from the start to its first ON while the slip lasts.
    delay_s : float or None
        Their mean (Eq. 10).
    """

    start_s: float
    end_s: float
    alarm: int | None
    latency_s: float | None
    late: bool
    stages_s: dict[str, float] | None
    lost_at: str | None
    on_at_start: bool
    on_while: bool
    channel_delays_s: tuple[float | None, ...]
    delay_s: float | None


@dataclasses.dataclass(frozen=True)
class Alarm:
    """A time in which the global decision is ON, in seconds from the start of the recording.

    Attributes
    ----------
    start_s, end_s : float
        Its first row and the first after it.
    kind : str
        ``true``: the alarm of a slip; ``repeat``: one more of a slip that has its alarm; else
        ``false``.
    slip : int or None
        Which slip of the recording it belongs to; None for a false one.
    """

    start_s: float
    end_s: float
    kind: str
    slip: int | None


def event_figures(
    slips: Sequence[TrueSlip], alarms: Sequence[Alarm], quiet_s: float
) -> dict[str, Any]:
    """Return the figures that a robot needs; None where one is not defined.

    Parameters
    ----------
    slips, alarms
        Of one recording or of several.
    quiet_s
        Time without slip.

    Returns
    -------
    dict
        ``slips``, of which ``matched`` to an alarm, of these ``late``, and ``missed``; ``alarms``,
        of which ``repeated_alarms`` and ``false_alarms``; ``recall``: the share of the slips that
        is matched; ``precision``: the share of the alarms that is matched, repetitions left out;
        ``false_alarms_per_minute`` of the time without slip; ``latency_median_ms``,
        ``latency_p90_ms``, ``latency_worst_ms`` over the matched slips; ``<stage>_ms``: the mean
        part of the latency of the matched slips, ``late_<stage>_ms``: of the late ones;
        ``missed_at_<stage>`` and ``missed_already_on``: how many slips were lost where.
    """
    latencies_ms = [slip.latency_s * 1e3 for slip in slips if slip.latency_s is not None]
    matched = len(latencies_ms)
    kinds = [alarm.kind for alarm in alarms]
    false_alarms = kinds.count(FALSE)
    lost = [slip.lost_at for slip in slips]
    late = [slip for slip in slips if slip.late]
    known = all(slip.lost_at for slip in slips if slip.latency_s is None)
    return {
        'slips': len(slips),
        'matched': matched,
        'late': len(late),
        'missed': len(slips) - matched,
        'alarms': len(alarms),
        'repeated_alarms': kinds.count(REPEAT),
        'false_alarms': false_alarms,
        'recall': matched / len(slips) if slips else None,
        'precision': matched / (matched + false_alarms) if matched + false_alarms else None,
        'false_alarms_per_minute': 60.0 * false_alarms / quiet_s if quiet_s else None,
        'latency_median_ms': float(np.median(latencies_ms)) if matched else None,
        'latency_p90_ms': float(np.percentile(latencies_ms, 90)) if matched else None,
        'latency_worst_ms': max(latencies_ms) if matched else None,
        **_mean_stages(slips, ''),
        **_mean_stages(late, 'late_'),
        **{f'missed_at_{stage}': lost.count(stage) if known else None for stage in STAGES},
        f'missed_{ALREADY_ON}': lost.count(ALREADY_ON) if known else None,
    }


def _mean_stages(slips: Sequence[TrueSlip], prefix: str) -> dict[str, float | None]:
    parts = [slip.stages_s for slip in slips if slip.stages_s is not None]
    return {
        f'{prefix}{stage}_ms': 1e3 * float(np.mean([part[stage] for part in parts]))
        if parts
        else None
        for stage in STAGES
    }
