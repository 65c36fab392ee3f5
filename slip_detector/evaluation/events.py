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

"""True slips and alarms with their matches, and the figures that matter to a robot."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.chance import slip_figures

#: The stages between a signal and the global decision, in order; the parts of a latency.
STAGES = ('filter', 'envelope', 'decision', 'vote')

#: Takes the place of a stage where an alarm that began before the slip was not over.
ALREADY_ON = 'already_on'

#: Kinds of alarms.
TRUE, REPEAT, FALSE, SETTLING = 'true', 'repeat', 'false', 'settling'


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
        label. None where the slip is missed, and where it is neither found nor missed.
    settling : bool
        Whether the slip begins while filters and windows settle, at the beginning of a recording
        or after a long gap. Then it is neither found nor missed.
    lead_s, window_s : float
        How long before its start its alarm may rise at the earliest, and length of the time in
        which it may; see :mod:`.chance`.
    late : bool
        Whether the latency is above ``late_after_s``.
    stages_s : dict or None
        The parts of the latency, by :data:`STAGES`; their sum is the latency. ``filter`` ends
        when a channel of the deciding group has a filtered signal (rectified, raised to the
        exponent) above the threshold: it includes the time until the sensor feels the slip.
        ``envelope`` ends when the envelope of a channel is above the threshold (for the limits
        that evidence uses instead see :mod:`.stage_watch`), ``decision`` when its level is,
        which turns the channel ON, and ``vote`` when the group is ON. None where there is no
        latency, where the alarm rises before the label and where another alarm was not over when
        the slip began.
    lost_at : str or None
        Where a missed slip was lost: the first of :data:`STAGES` after which no channel was above
        the threshold in the time in which the alarm could rise; ``vote`` where channels were ON
        but no group; :data:`ALREADY_ON` where an alarm that began before the slip was not over.
        None where the slip was not missed.
    on_at_start : bool
        Whether the global decision was ON in the row before the slip.
    on_while : bool
        Whether the global decision was ON at any time during the slip (the paper's success).
    channel_delays_s : tuple of float or None
        For each enabled channel the time from the start to its first ON during the slip.
    delay_s : float or None
        Mean of these delays (Eq. 10).

    Examples
    --------
    >>> slip = TrueSlip(
    ...     start_s=1.0, end_s=2.0, alarm=0, latency_s=0.04, settling=False, lead_s=0.1,
    ...     window_s=0.5, late=False, stages_s=None, lost_at=None, on_at_start=False,
    ...     on_while=True, channel_delays_s=(0.03, 0.05), delay_s=0.04,
    ... )
    >>> slip.start_s + slip.latency_s  # when its alarm rose
    1.04
    """

    start_s: float
    end_s: float
    alarm: int | None
    latency_s: float | None
    settling: bool
    lead_s: float
    window_s: float
    late: bool
    stages_s: dict[str, float] | None
    lost_at: str | None
    on_at_start: bool
    on_while: bool
    channel_delays_s: tuple[float | None, ...]
    delay_s: float | None


@dataclasses.dataclass(frozen=True)
class Alarm:
    """A rise of the global decision, and what follows until it is OFF for ``off_before_s``.

    Attributes
    ----------
    start_s, end_s : float
        Times of its first row and of the first row after its last ON, from the start of the
        recording.
    kind : str
        ``true``: the alarm of a slip; ``repeat``: a further alarm of a slip that has one already;
        ``settling``: one that rises, or whose slip begins, while the chain settles; ``false``:
        any other.
    slip : int or None
        Number of its slip in the recording; None where it belongs to none.

    Examples
    --------
    >>> Alarm(start_s=2.0, end_s=2.5, kind=FALSE, slip=None).kind
    'false'
    """

    start_s: float
    end_s: float
    kind: str
    slip: int | None


def event_figures(
    slips: Sequence[TrueSlip], alarms: Sequence[Alarm], rest_s: float, on_rest_s: float
) -> dict[str, Any]:
    """Return the figures that matter to a robot; None where one is not defined.

    Parameters
    ----------
    slips, alarms
        The slips and alarms of one recording or of several.
    rest_s, on_rest_s
        Time of the rest, and how much of it the global decision is ON.

    Returns
    -------
    dict
        ``slips``, with how many of them are ``matched`` to an alarm, ``missed``, or neither
        because they begin while the chain settles (``settling_slips``), and how many of the
        matched ones are ``late``; ``alarms``, with ``repeated_alarms``, ``false_alarms`` and
        ``settling_alarms``; ``precision``: the share of the alarms that are matched, without
        repeated and settling ones, and ``precision_by_chance``: the share of the scored
        time in which an alarm would be matched; ``rest_s``; the figures of
        :func:`.slip_figures`; ``<stage>_ms``: mean time that the latency of the matched slips
        spends in the stage; ``late_<stage>_ms``: the same for the late slips;
        ``missed_at_<stage>`` and ``missed_already_on``: how many slips were lost there.

    Examples
    --------
    >>> false_alarms = [Alarm(2.0, 2.1, 'false', slip=None), Alarm(5.0, 5.4, 'false', slip=None)]
    >>> figures = event_figures([], false_alarms, rest_s=30.0, on_rest_s=0.5)
    >>> figures['false_alarms_per_minute'], figures['false_time_s_per_hour'], figures['recall']
    (4.0, 60.0, None)
    """
    scored = [slip for slip in slips if not slip.settling]
    kinds = [alarm.kind for alarm in alarms]
    false_alarms = kinds.count(FALSE)
    matched = sum(slip.latency_s is not None for slip in scored)
    lost = [slip.lost_at for slip in scored]
    late = [slip for slip in scored if slip.late]
    known = all(slip.lost_at for slip in scored if slip.latency_s is None)
    windows_s = [slip.window_s for slip in scored]
    scored_s = sum(windows_s) + rest_s
    latencies_ms = [np.nan if slip.latency_s is None else slip.latency_s * 1e3 for slip in scored]
    return {
        'slips': len(slips),
        'settling_slips': len(slips) - len(scored),
        'matched': matched,
        'late': len(late),
        'missed': len(scored) - matched,
        'alarms': len(alarms),
        'repeated_alarms': kinds.count(REPEAT),
        'false_alarms': false_alarms,
        'settling_alarms': kinds.count(SETTLING),
        'precision': matched / (matched + false_alarms) if matched + false_alarms else None,
        'precision_by_chance': sum(windows_s) / scored_s if scored_s else None,
        'rest_s': rest_s,
        **slip_figures(
            latencies_ms,
            [slip.lead_s for slip in scored],
            windows_s,
            false_alarms,
            rest_s,
            on_rest_s,
        ),
        **_mean_stages(scored, ''),
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
