"""True slips and alarms as they were matched, and the figures that a robot needs of them."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

#: The stages between a signal and the global decision, in order; the parts of a latency.
STAGES = ('filter', 'envelope', 'decision', 'vote')

#: In place of a stage: the global decision was ON before the slip began.
ALREADY_ON = 'already_on'

#: Kinds of alarms.
TRUE, REPEAT, FALSE = 'true', 'repeat', 'false'


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
