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

"""The figures of a chain on recordings of a finger.

Each recording is one continuous stream. Slips and alarms are matched, and rows are scored or left
out, as the evaluation does.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.fingers.joints import joints, latency_s
from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit, percent
from slip_detector.evaluation.matching import ScoredRows
from slip_detector.evaluation.replay import Replay
from slip_detector.evaluation.scores import REST, SLIP, ScoreTally
from slip_detector.parameters import ChainConfig, EvaluationConfig
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.tracks import Track

#: What rows are that do not slide: those of a kind of recordings, or where the robot moves.
NOTHING_SLIDES = (*KINDS, 'motion')

#: The figures of the evaluation that are given.
OF_SLIPS = 'slips', 'recall', 'recall_by_chance', 'coverage', 'false_alarms_per_minute'


class Judged(NamedTuple):
    """What a chain decides on a recording.

    Attributes
    ----------
    name : str
    outcome : ReplayOutcome
    rows : dict
        The decision statistic of scored rows: of those that ``slide``, and those of
        :data:`NOTHING_SLIDES`; of a recording without a kind these are ``rest``.
    latencies_s : dict
        Of joints of each rest with a ``slide`` and another ``rest``; see :func:`.latency_s`.
    """

    name: str
    outcome: ReplayOutcome
    rows: dict[str, Floats]
    latencies_s: dict[str, list[float | None]]


class _Statistic:
    """Receives the rows of a replay, and keeps the decision statistic."""

    def __init__(self) -> None:
        self.parts: list[Floats] = []

    def add(self, volts: Floats, result: SlipResult, truth: Bools) -> None:
        self.parts.append(result.vote_statistic[:, 0].copy())

    def gap(self, seconds: float) -> None:
        """Rows that are missing have no statistic."""


def judge(chain: ChainConfig, track: Track, config: EvaluationConfig, fade_rows: int) -> Judged:
    """Run a chain over a recording, and over its joints, cross-faded over so many rows."""
    statistic, rate_hz = _Statistic(), track.sample_rate_hz
    outcome = Replay(chain, config).run(track.rows(), rate_hz, statistic)
    stretches, accuracy_s = [one.interval for one in track.stretches], track.samples.accuracy_s
    settling = settling_rows(chain)
    scored = ScoredRows(track.slips, stretches, settling, config, rate_hz, accuracy_s)
    numbers = np.concatenate([np.arange(*one) for one in stretches])

    def within(starts: Ints, ends: Ints) -> Bools:
        edges = np.stack([starts, ends], axis=1).ravel()
        return np.asarray(np.searchsorted(edges, numbers, 'right') % 2 == 1)

    slide = within(scored.certain_starts, scored.certain_ends)
    rest = within(scored.rest_starts, scored.rest_ends)
    moving = rest & (False if track.samples.moving is None else track.samples.moving)
    which = {'slide': slide, track.kind or 'rest': rest & ~moving, 'motion': moving}
    rows = {name: np.concatenate(statistic.parts)[its] for name, its in which.items()}
    latencies_s = {
        name: [latency_s(chain, *one, fade_rows) for one in joints(track, rest, its, fade_rows)]
        for name, its in (('slide', slide), ('rest', rest))
        if track.slips
    }
    return Judged(track.name, outcome, rows, latencies_s)


def rows_of(several: Sequence[Judged], name: str) -> Floats:
    """Return the statistic of the rows of recordings that are one thing."""
    return np.concatenate([np.zeros(0), *(one.rows.get(name, []) for one in several)])


def area(positive: Floats, negative: Floats) -> float | None:
    """Return the area under the ROC curve of some rows against others; None without either.

    Examples
    --------
    >>> area(np.full(9, 2.0), np.full(5, 2.0)), area(np.full(9, 2.0), np.zeros(5))
    (0.5, 1.0)
    """
    tally = ScoreTally()
    for rows, kind in ((positive, SLIP), (negative, REST)):
        tally.add(rows, np.full(rows.size, kind))
    return tally.collect().auc()


def figures(several: Sequence[Judged]) -> dict[str, Any]:
    """Return the figures of recordings; see :mod:`benchmarks.fingers.command`."""
    of = figures_of_merit([one.outcome for one in several])
    slide, rest = (rows_of(several, name) for name in ('slide', 'rest'))
    kinds = {name: rows_of(several, name) for name in NOTHING_SLIDES}
    every = np.concatenate([slide, *kinds.values()])
    return {
        **{name: of[name] for name in OF_SLIPS},
        'on_percent': percent(float((every > 1.0).sum()), every.size),
        'kinds': {
            name: {
                'on_percent': percent(float((rows > 1.0).sum()), rows.size),
                'auc': area(slide, rows),
                'auc_of_rest': area(rest, rows),
            }
            for name, rows in kinds.items()
            if rows.size
        },
        'joints': {
            name: _of_joints(
                [late_s for one in several for late_s in one.latencies_s.get(name, [])]
            )
            for name in ('slide', 'rest')
        },
        'recordings_on_percent': {
            one.name: percent(one.outcome.on_rest_rows, one.outcome.rest_rows) for one in several
        },
    }


def _of_joints(latencies_s: Sequence[float | None]) -> dict[str, Any]:
    known = np.array([one for one in latencies_s if one is not None], np.float64)
    found = known[~np.isnan(known)]
    return {
        'joints': len(latencies_s),
        'on_before': len(latencies_s) - known.size,
        'detected_percent': percent(found.size, known.size),
        'median_ms': 1e3 * float(np.median(found)) if found.size else None,
    }
