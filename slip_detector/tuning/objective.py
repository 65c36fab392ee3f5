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

"""The cost of a chain on labelled recordings, with the best threshold of each vote."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.settling import settling_rows
from slip_detector.evaluation.chance import HALF
from slip_detector.evaluation.scores import MOTION, REST, ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.sweep import (
    ThresholdSweep,
    Vote,
    VoteStatistics,
    sweep_thresholds,
    thresholds,
    votes_of,
)
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]

#: The cost of a threshold is averaged with those of this many neighbours on each side, which are
#: :data:`slip_detector.tuning.sweep.STEP` apart: from day to day, contact and sensor change
#: the amplitude by about a tenth.
NEIGHBOURS = 3

#: Confidence that is needed to prefer a chain to one nearer to the given chain. It is high, as the
#: best of many chains may be the best by chance.
CONFIDENCE = 0.99

#: Areas under the ROC curve that differ by less than this count as equal.
AUC_STEP = 1e-3

#: Other figures that differ by less than this count as equal.
EQUAL = 1e-9

#: Factor on the cost of the amount by which a figure is worse than that of the given chain.
WORSE_COUNTS = 10.0


class CandidateFigures(NamedTuple):
    """The figures of a chain that the search compares; None where one is not defined.

    Attributes
    ----------
    latency_median_all_ms, latency_median_ms : float or None
        Median latency of all slips, and of those found.
    sooner_than_chance : float or None
    false_alarms_per_minute : float or None
    false_time_percent : float or None
        These five are those of :func:`.slip_figures`.
    auc : float or None
        Area under the ROC curve of the decision statistic; see :meth:`Objective.auc`.

    Examples
    --------
    >>> given = CandidateFigures(50.0, 50.0, 1.0, 2.0, 0.1, auc=0.9)
    >>> CandidateFigures(40.0, 38.0, 0.9, 2.0, 0.1, auc=0.9).worse_than(given)
    ['sooner than chance 0.9 against 1']
    """

    latency_median_all_ms: float | None
    latency_median_ms: float | None
    sooner_than_chance: float | None
    false_alarms_per_minute: float | None
    false_time_percent: float | None
    auc: float | None

    @property
    def better_than_chance(self) -> bool:
        """Whether the chain finds slips sooner than decisions that do not depend on slip."""
        return self.sooner_than_chance is not None and self.sooner_than_chance > 0.0

    @property
    def false_alarms_per_minute_off(self) -> float | None:
        """False alarms per minute of rest in which the decision is OFF; None where it never is.

        A decision that is ON for most of the time has few alarms, as they hardly end.
        """
        if self.false_alarms_per_minute is None or self.false_time_percent is None:
            return None
        off = 1.0 - self.false_time_percent / 100.0
        return self.false_alarms_per_minute / off if off > 0.0 else None

    def worse_than(self, other: 'CandidateFigures') -> list[str]:
        """Return a text for each figure that is worse, or not defined where the other's is.

        Empty where the other's figures are no better than chance. The latency of the slips found
        is not compared, as it falls where late slips are missed.
        """
        if not other.better_than_chance:
            return []
        return [
            *_worse(
                'median latency', self.latency_median_all_ms, other.latency_median_all_ms, ' ms'
            ),
            *_worse(
                'false alarms',
                self.false_alarms_per_minute_off,
                other.false_alarms_per_minute_off,
                ' in a minute of OFF',
            ),
            *_worse('false time', self.false_time_percent, other.false_time_percent, ' %'),
            *_worse(
                'sooner than chance',
                self.sooner_than_chance,
                other.sooner_than_chance,
                more_is_better=True,
            ),
            *_worse(
                'area under the ROC curve', self.auc, other.auc, more_is_better=True, step=AUC_STEP
            ),
        ]


def _worse(
    name: str,
    figure: float | None,
    other: float | None,
    unit: str = '',
    more_is_better: bool = False,
    step: float = EQUAL,
) -> list[str]:
    """Return a text where a figure is worse than another by more than a step, else nothing."""
    if other is None:
        return []
    if figure is None:
        return [f'no {name} defined against {other:.4g}{unit}']
    excess = other - figure if more_is_better else figure - other
    return [f'{name} {figure:.4g} against {other:.4g}{unit}'] if excess > step else []


class Candidate(NamedTuple):
    """A chain with its threshold and vote, and its cost.

    Attributes
    ----------
    chain : ChainConfig
    cost_ms : float
    error_ms : float
        Half the confidence interval of the mean latency in the cost, by Student's t; large with
        few slips.
    figures : CandidateFigures
    """

    chain: ChainConfig
    cost_ms: float
    error_ms: float
    figures: CandidateFigures


class Objective:
    """The cost of chains on labelled tracks.

    Parameters
    ----------
    tracks
        Tracks with at least one slip and some time without slip.
    evaluation
        What counts as detected.
    config
        The weights of the cost.
    given
        Figures that must not get worse; None: any figures are allowed.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = Samples.evenly(np.tile(volts, (16, 1)).T, 380.0, slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> given = Objective([track], EvaluationConfig(), TuneConfig()).as_it_is(ChainConfig())
    >>> given.figures.sooner_than_chance, given.figures.false_alarms_per_minute
    (1.0, 0.0)
    """

    def __init__(
        self,
        tracks: Sequence[Track],
        evaluation: EvaluationConfig,
        config: TuneConfig,
        given: CandidateFigures | None = None,
    ) -> None:
        self._tracks, self._evaluation, self._config = tracks, evaluation, config
        self._given = given
        self._tally = ScoreTally()
        self._scores = np.empty(max((len(track.volts) for track in tracks), default=0))
        self._outs: list[Floats | None] = [None] * len(tracks)

    def best(self, chain: ChainConfig) -> list[Candidate]:
        """Return a chain with the best threshold for each vote, the cheapest vote first.

        Votes with which the chain is never ON are left out, and all where no slip or no rest is
        scored.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        candidates = []
        for vote, statistic in self.statistics(chain, votes_of(chain)).items():
            limits = thresholds(chain, statistic, self._tracks)
            if limits.size:
                sweep = self.sweep(chain, statistic, limits)
                costs_ms = _with_neighbours(self._event_costs_ms(sweep))
                if np.isinf(costs_ms).all():
                    continue
                at = int(np.argmin(costs_ms))
                best = dataclasses.replace(chain, threshold=float(limits[at]), vote=vote)
                candidates.append(self._candidate(best, statistic, sweep, at, float(costs_ms[at])))
        return sorted(candidates, key=lambda one: one.cost_ms)

    def as_it_is(self, chain: ChainConfig) -> Candidate:
        """Return the cost of a chain with its own threshold and vote.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        statistic = self.statistics(chain, [chain.vote])[chain.vote]
        sweep = self.sweep(chain, statistic, np.array([chain.threshold]))
        cost_ms = float(self._event_costs_ms(sweep)[0])
        return self._candidate(chain, statistic, sweep, 0, cost_ms)

    def statistics(
        self, chain: ChainConfig, votes: Sequence[Vote]
    ) -> Mapping[Vote, Sequence[Floats]]:
        """Return the decision statistic, by vote and track: arrays of shape (n,).

        It is compared with the threshold. The next call may overwrite it.
        """
        one_pass = VoteStatistics(chain, votes)
        tracks = [
            one_pass.of(track, out) for track, out in zip(self._tracks, self._outs, strict=True)
        ]
        self._outs = [*tracks]
        return {vote: [one[v] for one in tracks] for v, vote in enumerate(votes)}

    def sweep(
        self, chain: ChainConfig, statistic: Sequence[Floats], limits: Floats
    ) -> ThresholdSweep:
        """Match slips and alarms at each threshold; see :func:`sweep_thresholds`."""
        rows = settling_rows(chain)
        return sweep_thresholds(statistic, self._tracks, limits, self._evaluation, rows)

    def auc(self, statistic: Sequence[Floats], threshold: float) -> float | None:
        """Return the area under the ROC curve of rows with slip against rows of motion.

        Where no motion is known, it is against all rows without slip.
        """
        for part, track in zip(statistic, self._tracks, strict=True):
            # The chain divides in the same way, so the scores equal an evaluation's to the bit.
            scores = np.divide(part, threshold, out=self._scores[: part.size])
            self._tally.add(scores, track.kinds)
        counts = self._tally.take()
        return counts.auc([MOTION] if counts.counts[MOTION].any() else (REST, MOTION))

    def _candidate(
        self,
        chain: ChainConfig,
        statistic: Sequence[Floats],
        sweep: ThresholdSweep,
        at: int,
        event_cost_ms: float,
    ) -> Candidate:
        """Return the cost of a chain at its own threshold, which is one of a sweep."""
        auc = self.auc(statistic, chain.threshold)
        lacking = 1.0 - (auc or 0.0)
        if self._given is not None and self._given.better_than_chance:
            lacking += WORSE_COUNTS * max((self._given.auc or 0.0) - (auc or 0.0), 0.0)
        cost_ms = event_cost_ms + self._config.auc_costs_ms * lacking
        figures = sweep.figures(at)
        compared = {name: figures[name] for name in CandidateFigures._fields if name != 'auc'}
        return Candidate(
            chain, cost_ms, self._error_ms(sweep, at), CandidateFigures(**compared, auc=auc)
        )

    def _event_costs_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return the cost of slips and alarms at each of T thresholds, shape (T,).

        It is infinite where no slip or no rest is scored, which says nothing about the chain.
        """
        config, given = self._config, self._given
        late_ms = self._late_ms(sweep)
        if not sweep.scored.any() or not sweep.rest_s:
            return np.full(late_ms.shape[1], np.inf)
        missed_costs, false_costs = config.missed_costs_ms, config.false_alarm_costs_ms
        costs = (
            late_ms.mean(axis=0)
            + sweep.saved_by_chance_ms(missed_costs)
            + false_costs * sweep.false_alarms_per_minute
            + config.false_time_costs_ms * sweep.false_time_percent
        )
        if given is not None and given.better_than_chance:
            sooner = sweep.sooner_than_chance
            median = np.where(sooner >= HALF, np.median(late_ms, axis=0), missed_costs)
            worse = (
                _more(median, given.latency_median_all_ms)
                + missed_costs * np.maximum((given.sooner_than_chance or 0.0) - sooner, 0.0)
                + false_costs
                * _more(sweep.false_alarms_per_minute_off, given.false_alarms_per_minute_off)
                + config.false_time_costs_ms
                * _more(sweep.false_time_percent, given.false_time_percent)
            )
            costs += WORSE_COUNTS * worse
        return np.asarray(costs)

    def _error_ms(self, sweep: ThresholdSweep, at: int) -> float:
        """Return the error of the mean latency by Student's t, at ``CONFIDENCE``.

        A chain whose cost is higher by less than this counts as equally good. With one slip the
        error is infinite.
        """
        late_ms = self._late_ms(sweep)[sweep.scored, at]
        if late_ms.size < 2:
            return math.inf
        # Imported here: what is learnt of rest and of taps does without it.
        from scipy import special

        t = float(special.stdtrit(late_ms.size - 1, 0.5 + CONFIDENCE / 2))
        return t * float(np.std(late_ms, ddof=1)) / math.sqrt(late_ms.size)

    def _late_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return how late each slip is found, from 0 to the cost of a miss; shape (slips, T).

        Slips that begin while a chain settles count as missed, so that a chain does not gain by
        settling for longer.
        """
        costs_ms = self._config.missed_costs_ms
        return np.asarray(np.clip(np.fmin(sweep.latencies_ms, costs_ms), 0.0, costs_ms))


def _more(figures: Floats, given: float | None) -> Floats:
    """Return by how much figures are larger than a given one; 0 where that is not defined."""
    return np.asarray(np.maximum(figures - (np.inf if given is None else given), 0.0))


def _with_neighbours(costs: Floats) -> Floats:
    """Return the mean of each cost and of the costs of the neighbouring thresholds; shape (T,).

    Nothing is ON from the highest threshold on, so that its cost continues above. What is ON below
    the lowest is not known, so thresholds that lack neighbours there have an infinite cost.
    """
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(costs, NEIGHBOURS, mode='edge')
    padded[:NEIGHBOURS] = np.inf
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))
