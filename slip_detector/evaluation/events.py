"""True slips and alarms with their matches, and the figures that matter to a robot."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

#: The stages between a signal and the global decision, in order; the parts of a latency.
STAGES = ('filter', 'envelope', 'decision', 'vote')

#: Stands in place of a stage where the global decision was ON before the slip began.
ALREADY_ON = 'already_on'

#: Kinds of alarms.
TRUE, REPEAT, FALSE = 'true', 'repeat', 'false'


@dataclasses.dataclass(frozen=True)
class TrueSlip:
    """A true slip, its alarm and its latency. Times are seconds from the start of the recording.

    Attributes
    ----------
    start_s, end_s : float
        Times of the first row of the label and of the first row after it.
    alarm : int or None
        Number of its alarm in the recording; None where the slip was missed.
    latency_s : float or None
        Time from the start to the rise of its alarm; negative where the alarm rises before the
        label.
    late : bool
        Whether the latency is above ``late_after_s``.
    stages_s : dict or None
        The parts of the latency, by :data:`STAGES`; their sum is the latency. ``filter`` ends
        when a channel of the deciding group has a filtered signal (rectified, to its exponent)
        above the threshold: it has the delay of the filter and the time until the sensor feels
        the slip. ``envelope`` ends when the envelope of a channel is above the threshold (of
        evidence see :mod:`slip_detector.evaluation.stages`),
        ``decision`` when its level is, which turns the channel ON, and ``vote`` when the group is
        ON. None where there is no latency, where the alarm rises before the label and where the
        global decision was ON before the slip.
    lost_at : str or None
        Where a missed slip was lost: the first of :data:`STAGES` after which no channel was above
        the threshold in the time in which the alarm could rise; ``vote`` where channels were ON
        but no group; :data:`ALREADY_ON` where the global decision was ON before the slip. None
        where the slip was not missed.
    on_at_start : bool
        Whether the global decision was ON in the row before the slip.
    on_while : bool
        Whether the global decision was ON at any time during the slip (the paper's success).
    channel_delays_s : tuple of float or None
        For each enabled channel the time from the start to its first ON during the slip.
    delay_s : float or None
        Mean of these delays (Eq. 10).
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
    """An interval in which the global decision is ON.

    Attributes
    ----------
    start_s, end_s : float
        Times of its first row and of the first row after it, from the start of the recording.
    kind : str
        ``true``: the alarm of a slip; ``repeat``: a further alarm of a slip that has one already;
        ``false``: any other.
    slip : int or None
        Number of its slip in the recording; None for a false alarm.
    """

    start_s: float
    end_s: float
    kind: str
    slip: int | None


def event_figures(
    slips: Sequence[TrueSlip], alarms: Sequence[Alarm], quiet_s: float
) -> dict[str, Any]:
    """Return the figures that matter to a robot; None where one is not defined.

    Parameters
    ----------
    slips, alarms
        The slips and alarms of one recording or of several.
    quiet_s
        Time without slip.

    Returns
    -------
    dict
        ``slips``, with how many of them are ``matched`` to an alarm or ``missed``, and how many
        of the matched ones are ``late``; ``alarms``, with ``repeated_alarms`` and
        ``false_alarms``; ``recall``: the share of the slips that are matched; ``precision``: the
        share of the alarms that are matched, repeated alarms left out;
        ``false_alarms_per_minute`` of the time without slip; ``latency_median_ms``,
        ``latency_p90_ms`` and ``latency_worst_ms`` of the matched slips; ``<stage>_ms``: the mean
        part of the latency of the matched slips; ``late_<stage>_ms``: the same of the late ones;
        ``missed_at_<stage>`` and ``missed_already_on``: how many slips were lost there.

    Examples
    --------
    >>> false_alarms = [Alarm(2.0, 2.1, 'false', slip=None), Alarm(5.0, 5.4, 'false', slip=None)]
    >>> figures = event_figures([], false_alarms, quiet_s=30.0)
    >>> figures['false_alarms_per_minute'], figures['recall']
    (4.0, None)
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
