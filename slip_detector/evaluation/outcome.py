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

"""The outcome of a recording's replay, and the figures of several recordings together."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from slip_detector.evaluation.events import Alarm, TrueSlip, event_figures
from slip_detector.evaluation.labelled_rows import MOTION
from slip_detector.evaluation.paper_figures import paper_figures
from slip_detector.evaluation.scores import ScoreCounts


@dataclasses.dataclass(frozen=True)
class ReplayOutcome:
    """The outcome of a recording's replay through a chain.

    Attributes
    ----------
    rows, slip_rows : int
    moving_rows : int or None
        Number of rows of motion; None where the recording has no velocities.
    on_rows : int
        Number of rows without slip in which the global decision is ON, as the paper counts them.
    settling_rows : int
        Number of rows that are not scored, as filters and windows settle.
    rest_rows, on_rest_rows : int
        Number of rows of rest, see :mod:`.matching`, and how many of them have the global
        decision ON.
    sample_rate_hz : float
        Rate of the recording.
    slips : tuple of TrueSlip
    alarms : tuple of Alarm
    scores : ScoreCounts or None
        Scores of the decision statistic; None where they were not asked for.

    Examples
    --------
    >>> outcome = ReplayOutcome(
    ...     rows=760, slip_rows=190, moving_rows=None, on_rows=19, settling_rows=190,
    ...     rest_rows=380, on_rest_rows=19, sample_rate_hz=380.0, slips=(), alarms=(), scores=None,
    ... )
    >>> outcome.duration_s, outcome.rest_s, outcome.on_rest_s
    (2.0, 1.0, 0.05)
    """

    rows: int
    slip_rows: int
    moving_rows: int | None
    on_rows: int
    settling_rows: int
    rest_rows: int
    on_rest_rows: int
    sample_rate_hz: float
    slips: tuple[TrueSlip, ...]
    alarms: tuple[Alarm, ...]
    scores: ScoreCounts | None

    @property
    def duration_s(self) -> float:
        """Time of its rows, without gaps."""
        return self.rows / self.sample_rate_hz

    @property
    def rest_s(self) -> float:
        """Time of its rest."""
        return self.rest_rows / self.sample_rate_hz

    @property
    def on_rest_s(self) -> float:
        """Time of its rest in which the global decision is ON."""
        return self.on_rest_rows / self.sample_rate_hz


def figures_of_merit(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the figures of merit of recordings, at least one, taken together.

    Returns
    -------
    dict
        Numbers, None where one is not defined: ``rows``, ``slip_rows``, ``moving_rows``,
        ``settling_rows`` (in which neither slips nor rest are scored) and ``duration_s``; areas
        under the ROC curve of the decision statistic, for rows with slip against all other rows
        (``auc_all``) and against rows of motion (``auc_moving``); the figures of
        :func:`slip_detector.evaluation.paper_figures.paper_figures` and of
        :func:`slip_detector.evaluation.events.event_figures`.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.evaluation.replay import Replay
    >>> rest = LabelledRows(np.full((760, 16), 4.3), truth=np.zeros(760, bool))
    >>> figures = figures_of_merit([Replay(ChainConfig()).run([rest])])
    >>> figures['duration_s'], figures['false_alarms'], figures['recall']
    (2.0, 0, None)
    """
    slips = [slip for one in outcomes for slip in one.slips]
    rows, slip_rows = sum(one.rows for one in outcomes), sum(one.slip_rows for one in outcomes)
    moving = [one.moving_rows for one in outcomes if one.moving_rows is not None]
    scores = ScoreCounts.pooled([one.scores for one in outcomes if one.scores is not None])
    return {
        'rows': rows,
        'slip_rows': slip_rows,
        'moving_rows': sum(moving) if moving else None,
        'settling_rows': sum(one.settling_rows for one in outcomes),
        'duration_s': sum(one.duration_s for one in outcomes),
        'auc_all': scores.auc(),
        'auc_moving': scores.auc([MOTION]) if moving else None,
        **paper_figures(slips, sum(one.on_rows for one in outcomes), rows - slip_rows),
        **event_figures(
            slips,
            [alarm for one in outcomes for alarm in one.alarms],
            sum(one.rest_s for one in outcomes),
            sum(one.on_rest_s for one in outcomes),
        ),
    }
