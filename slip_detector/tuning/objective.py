"""What a chain costs on labelled recordings, with the best threshold of each vote."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.space import Vote, rounded, thresholds, votes_of
from slip_detector.tuning.sweep import Statistics, ThresholdSweep, sweep_thresholds
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]

#: A threshold is judged with its neighbours, so many steps of
#: :data:`slip_detector.tuning.sweep.STEP` to
#: each side: a tenth of the amplitude is what contact and sensor vary by from day to day.
NEIGHBOURS = 3

#: How sure it must be that a chain is better than one nearer to the given: a search has many
#: chances to be lucky.
CONFIDENCE = 0.99

#: Areas under the ROC curve that differ by less are the same.
AUC_STEP = 1e-3

#: What gets worse than with the given parameters counts so many times.
WORSE_COUNTS = 10.0


class CandidateFigures(NamedTuple):
    """What counts of a chain on some tracks.

    Attributes
    ----------
    median_ms : float
        Median latency over all slips, a missed one being later than any.
    missed : float
        Share of the slips.
    false_alarms_per_minute : float
        Of the time without slip.
    auc : float or None
        Of the decision statistic; see :meth:`slip_detector.tuning.sweep.Swept.auc`.
    latency_ms : float or None
        Median latency of the slips that are not missed.
    """

    median_ms: float
    missed: float
    false_alarms_per_minute: float
    auc: float | None
    latency_ms: float | None

    def worse_than(self, other: 'CandidateFigures') -> list[str]:
        """Say, a line each, in which of latency, misses, false alarms and area these are worse."""
        pairs = {
            'median latency': (self.median_ms, other.median_ms, 'ms'),
            'missed': (100.0 * self.missed, 100.0 * other.missed, '%'),
            'false alarms': (
                self.false_alarms_per_minute,
                other.false_alarms_per_minute,
                'a minute',
            ),
        }
        worse = [
            f'{name} {mine:.4g} against {its:.4g} {unit}'
            for name, (mine, its, unit) in pairs.items()
            if mine > its + 1e-9
        ]
        if self.auc is not None and other.auc is not None and self.auc < other.auc - AUC_STEP:
            worse.append(f'area under the ROC curve {self.auc:.4f} against {other.auc:.4f}')
        return worse


class Candidate(NamedTuple):
    """A chain with its threshold and vote, what it costs and why.

    Attributes
    ----------
    chain : ChainConfig
    cost_ms : float
    error_ms : float
        What so few slips and false alarms leave open of it; see :meth:`Objective.error_ms`.
    figures : CandidateFigures
    """

    chain: ChainConfig
    cost_ms: float
    error_ms: float
    figures: CandidateFigures


class Objective:
    """What a chain costs on labelled tracks.

    Parameters
    ----------
    tracks
        With at least one slip and some time without.
    evaluation
        What counts as detected.
    config
        The weights.
    given
        What must not get worse; None: nothing is held against it.
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
        self._rooms: dict[int, Any] = {}

    def best(self, chain: ChainConfig) -> list[Candidate]:
        """Return a chain with the best threshold for each vote, the cheapest vote first.

        Votes at which it never is ON are left out.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        votes = votes_of(chain)
        statistic = self.statistic(chain, votes)
        found = []
        for vote in votes:
            parts = [part[vote] for part in statistic]
            limits = thresholds(parts, self._tracks, chain.exponent)
            if not limits.size:
                continue
            swept = self.swept(parts, limits)
            costs = _with_neighbours(self.costs_ms(swept))
            at = int(np.argmin(costs))
            threshold = rounded(float(limits[at]))
            found.append(
                Candidate(
                    dataclasses.replace(chain, threshold=threshold, vote=vote),
                    float(costs[at]),
                    self.error_ms(swept, at),
                    self.figures(swept, at),
                )
            )
        return sorted(found, key=lambda one: one.cost_ms)

    def as_it_is(self, chain: ChainConfig) -> Candidate:
        """Return what a chain costs with its own threshold and vote.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        parts = [part[chain.vote] for part in self.statistic(chain, [chain.vote])]
        near = thresholds(parts, self._tracks, chain.exponent)
        limits = np.union1d(near, [chain.threshold])
        swept = self.swept(parts, limits)
        at = int(np.searchsorted(limits, chain.threshold))
        cost_ms = float(self.costs_ms(swept)[at])
        return Candidate(chain, cost_ms, self.error_ms(swept, at), self.figures(swept, at))

    def statistic(
        self, chain: ChainConfig, votes: Sequence[Vote]
    ) -> Sequence[Mapping[Vote, Floats]]:
        """Return what is held against the threshold by track and vote, shapes (n,).

        The next call may overwrite it.
        """
        one_pass = Statistics(chain, votes)
        found = []
        for i, track in enumerate(self._tracks):
            found.append(one_pass.of(track, self._rooms.get(i)))
            self._rooms[i] = found[-1]['all'].base
        return found

    def swept(self, statistic: Sequence[Floats], limits: Floats) -> ThresholdSweep:
        """Return what becomes of the tracks at each threshold; see :func:`sweep.sweep`."""
        return sweep_thresholds(statistic, self._tracks, limits, self._evaluation)

    def costs_ms(self, swept: ThresholdSweep) -> Floats:
        """Return the cost at each of T thresholds, shape (T,)."""
        config, given = self._config, self._given
        late_ms = self._late_ms(swept)
        false_costs = config.false_alarm_costs_ms
        costs = late_ms.mean(axis=0) + false_costs * swept.false_alarms_per_minute
        costs += config.auc_costs_ms * (1.0 - (swept.auc() or 0.0))
        if given is not None:
            median = min(given.median_ms, config.missed_costs_ms)
            worse = np.maximum(np.median(late_ms, axis=0) - median, 0.0)
            worse += config.missed_costs_ms * np.maximum(swept.missed - given.missed, 0.0)
            worse += false_costs * np.maximum(
                swept.false_alarms_per_minute - given.false_alarms_per_minute, 0.0
            )
            costs += WORSE_COUNTS * worse
        return np.asarray(costs)

    def error_ms(self, swept: ThresholdSweep, at: int) -> float:
        """Return by how much more a chain may cost and still be as good, at ``CONFIDENCE``.

        It is the error of the mean latency by Student's t: of one slip alone nothing is known.
        """
        late_ms = self._late_ms(swept)[:, at]
        if late_ms.size < 2:
            return math.inf
        t = float(stats.t.ppf(0.5 + CONFIDENCE / 2, late_ms.size - 1))
        return t * float(np.std(late_ms, ddof=1)) / math.sqrt(late_ms.size)

    def _late_ms(self, swept: ThresholdSweep) -> Floats:
        """Return the latencies with what a missed slip counts for; shape (slips, T)."""
        missed_ms = self._config.missed_costs_ms
        return np.fmin(swept.latencies_ms, missed_ms)

    @staticmethod
    def figures(swept: ThresholdSweep, at: int) -> CandidateFigures:
        """Return the figures at one of the thresholds."""
        latencies_ms = swept.latencies_ms[:, at]
        found = latencies_ms[~np.isnan(latencies_ms)]
        return CandidateFigures(
            median_ms=float(np.median(np.where(np.isnan(latencies_ms), np.inf, latencies_ms))),
            missed=float(swept.missed[at]),
            false_alarms_per_minute=float(swept.false_alarms_per_minute[at]),
            auc=swept.auc(),
            latency_ms=float(np.median(found)) if found.size else None,
        )


def _with_neighbours(costs: Floats) -> Floats:
    """Return the mean of each cost and those of the thresholds around it; shape (T,)."""
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(costs, NEIGHBOURS, mode='edge')
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))
