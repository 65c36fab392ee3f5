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

"""True slips, alarms and the outcome of a replay, and the figures of several together."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.events import Events
from slip_detector.evaluation.scores import ScoreCounts

#: The stages between a signal and the global decision, in order; the parts of a latency.
STAGES = ('filter', 'envelope', 'decision', 'vote')

#: Takes the place of a stage where an alarm that began before the slip was not over.
ALREADY_ON = 'already_on'

#: Outcomes of alarms.
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
    accuracy_s : float
        How exact the start of its label is, and with it the latency.
    settling : bool
        Whether the slip begins while filters and windows settle, at the beginning of a recording
        or after a long gap. Then it is neither found nor missed.
    late : bool
        Whether the latency is certainly above ``late_after_s``.
    stages_s : dict or None
        The parts of the latency, by :data:`STAGES`; their sum is the latency. ``filter`` ends
        when a channel of the deciding group has a filtered signal (rectified, raised to the
        exponent) above the threshold: it includes the time until the sensor feels the slip.
        ``envelope`` ends when the envelope of a channel is above the threshold (for the limits
        that evidence uses instead see :mod:`.replay`), ``decision`` when its level is,
        which turns the channel ON, and ``vote`` when the group is ON. None where there is no
        exact latency, where the alarm rises before the label and where another alarm was not over
        when the slip began.
    lost_at : str or None
        Where a missed slip was lost: the first of :data:`STAGES` after which no channel was above
        the threshold in the time in which the alarm could rise; ``vote`` where channels were ON
        but no group; :data:`ALREADY_ON` where an alarm that began before the slip was not over.
        None where the slip was not missed.
    on_at_start : bool
        Whether the global decision was ON in the row before the slip.
    """

    start_s: float
    end_s: float
    alarm: int | None
    latency_s: float | None
    accuracy_s: float
    settling: bool
    late: bool
    stages_s: dict[str, float] | None
    lost_at: str | None
    on_at_start: bool


@dataclasses.dataclass(frozen=True)
class Alarm:
    """A rise of the global decision, and what follows until it is OFF for ``off_before_s``.

    Attributes
    ----------
    start_s, end_s : float
        Times of its first row and of the first row after its last ON, from the start of the
        recording.
    outcome : str
        ``true``: the alarm of a slip; ``repeat``: a further alarm of a slip that has one already;
        ``settling``: one that rises, or whose slip begins, while the chain settles; ``false``:
        any other.
    slip : int or None
        Number of its slip in the recording; None where it belongs to none.
    """

    start_s: float
    end_s: float
    outcome: str
    slip: int | None


def _mean_stages(slips: Sequence[TrueSlip], prefix: str) -> dict[str, float | None]:
    parts = [slip.stages_s for slip in slips if slip.stages_s is not None]
    means = {stage: mean_and_sd(part[stage] * 1e3 for part in parts)[0] for stage in STAGES}
    return {f'{prefix}{stage}_ms': mean_ms for stage, mean_ms in means.items()}


def mean_and_sd(delays: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation (n - 1) of the delays that are not None.

    They are None for the mean of no delay, and for the standard deviation of fewer than two.

    Examples
    --------
    >>> mean_and_sd([1.0, None, 3.0])
    (2.0, 1.4142135623730951)
    """
    known = [delay for delay in delays if delay is not None]
    mean = float(np.mean(known)) if known else None
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else None


def share(part: float, whole: float, unit: float = 1.0) -> float | None:
    """Return the share of a part in a whole; None where the whole is 0."""
    return unit * part / whole if whole else None


def percent(part: float, whole: float) -> float | None:
    """Return the share of a part in a whole in per cent; None where the whole is 0."""
    return share(part, whole, 100.0)


@dataclasses.dataclass(frozen=True)
class ReplayOutcome:
    """The outcome of a recording's replay through a chain.

    Attributes
    ----------
    rows, slip_rows : int
    moving_rows : int or None
        Number of rows of motion; None where the recording has no velocities.
    settling_rows : int
        Number of rows that are not scored, as filters and windows settle.
    sample_rate_hz : float
        Rate of the recording.
    slips : tuple of TrueSlip
    alarms : tuple of Alarm
    events : Events
        The same at the one threshold of the chain.
    scores : ScoreCounts
        Scores of the decision statistic.
    on_s : tuple of (float, float)
        When the global decision was ON: start and end, in seconds from the start of the recording.
    invalid_rows : tuple of int
        For each channel the number of rows in which it was not valid; 0 if it is disabled.
    wrong : mapping
        Why decisions may mean nothing: the channels, from 0, by :mod:`what is wrong <.watch>`.
    """

    rows: int
    slip_rows: int
    moving_rows: int | None
    settling_rows: int
    sample_rate_hz: float
    slips: tuple[TrueSlip, ...]
    alarms: tuple[Alarm, ...]
    events: Events
    scores: ScoreCounts
    on_s: tuple[tuple[float, float], ...] = ()
    invalid_rows: tuple[int, ...] = ()
    wrong: Mapping[str, Sequence[int]] = dataclasses.field(default_factory=dict)


def decision_figures(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return what the detector decided, with or without labels.

    Returns
    -------
    dict
        ``rows`` and ``duration_s``; ``onsets``: how often the global decision turns ON, also after
        the shortest OFF, and how often a minute; how long it is ON, ``on_s``, and the share of
        the time, ``on_percent``; and the number of channels that are not always valid,
        ``invalid_channels``.
    """
    seconds = sum(outcome.rows / outcome.sample_rate_hz for outcome in outcomes)
    on_s = [end_s - start_s for outcome in outcomes for start_s, end_s in outcome.on_s]
    invalid_rows = sum(np.array(outcome.invalid_rows) for outcome in outcomes)
    return {
        'rows': sum(outcome.rows for outcome in outcomes),
        'duration_s': seconds,
        'onsets': len(on_s),
        'onsets_per_minute': share(len(on_s), seconds, 60.0),
        'on_s': sum(on_s, 0.0),
        'on_percent': percent(sum(on_s), seconds),
        'invalid_channels': int(np.count_nonzero(invalid_rows)),
    }


def figures_of_merit(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the figures of merit of recordings, at least one, taken together.

    Returns
    -------
    dict
        Numbers, None where one is not defined: ``rows``, ``slip_rows``, ``moving_rows``,
        ``settling_rows`` (in which nothing is scored) and ``duration_s``; areas under the ROC
        curve of the decision statistic, see :meth:`.ScoreCounts.aucs`;
        ``slips``, with how many of them are ``matched`` to an alarm, ``missed``, or neither
        because they begin while the chain settles (``settling_slips``), and how many of the
        matched ones are ``late``; ``alarms``, with ``repeated_alarms``, ``false_alarms`` and
        ``settling_alarms``; ``precision``: the share of the alarms that are matched, without
        repeated and settling ones, and ``precision_by_chance``: the share of the scored
        time in which an alarm would be matched; ``rest_s``; ``latency_accuracy_ms``: how exact
        the starts of the labels are, 0 if all are; the figures of :meth:`.Events.at`, whose
        latencies are what is certain of them, 0 within this accuracy; ``<stage>_ms``: mean time
        that the latency of the matched slips spends in the stage; ``late_<stage>_ms``: the same
        for the late slips;
        ``missed_at_<stage>`` and ``missed_already_on``: how many slips were lost there.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> rest = Samples.evenly(np.full((760, 16), 4.3), 380.0, truth=np.zeros(760))
    >>> figures = figures_of_merit([Replay(ChainConfig()).run([rest])])
    >>> figures['duration_s'], figures['false_alarms'], figures['recall']
    (2.0, 0, None)
    """
    slips = [slip for outcome in outcomes for slip in outcome.slips]
    alarms = [alarm.outcome for outcome in outcomes for alarm in outcome.alarms]
    events = Events.pooled(outcome.events for outcome in outcomes)
    scored = [slip for slip in slips if not slip.settling]
    late = [slip for slip in scored if slip.late]
    lost = [slip.lost_at for slip in scored if slip.latency_s is None]
    matched, false_alarms = len(scored) - len(lost), alarms.count(FALSE)
    windows_s, rest_s = float(events.windows_s.sum()), float(events.rest[0, 0])
    moving = [outcome.moving_rows for outcome in outcomes if outcome.moving_rows is not None]
    return {
        'rows': sum(outcome.rows for outcome in outcomes),
        'slip_rows': sum(outcome.slip_rows for outcome in outcomes),
        'moving_rows': sum(moving) if moving else None,
        'settling_rows': sum(outcome.settling_rows for outcome in outcomes),
        'duration_s': sum(outcome.rows / outcome.sample_rate_hz for outcome in outcomes),
        **ScoreCounts.pooled([outcome.scores for outcome in outcomes]).aucs(),
        'slips': len(slips),
        'settling_slips': len(slips) - len(scored),
        'late': len(late),
        'alarms': len(alarms),
        'repeated_alarms': alarms.count(REPEAT),
        'false_alarms': false_alarms,
        'settling_alarms': alarms.count(SETTLING),
        'precision': share(matched, matched + false_alarms),
        'precision_by_chance': share(windows_s, windows_s + rest_s),
        'rest_s': rest_s,
        'latency_accuracy_ms': 1e3 * max((slip.accuracy_s for slip in scored), default=0.0),
        **events.at(),
        **_mean_stages(scored, ''),
        **_mean_stages(late, 'late_'),
        **{f'missed_at_{stage}': lost.count(stage) for stage in STAGES},
        f'missed_{ALREADY_ON}': lost.count(ALREADY_ON),
    }
