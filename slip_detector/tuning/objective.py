"""The cost of a chain on labelled recordings, with the best threshold of each vote."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from slip_detector.evaluation.labelled_rows import MOTION, REST
from slip_detector.evaluation.scores import ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.space import Vote, threshold_scale, thresholds, votes_of
from slip_detector.tuning.sweep import ThresholdSweep, VoteStatistics, sweep_thresholds
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]

#: A threshold is judged together with this many neighbours on each side, which are steps of
#: :data:`slip_detector.tuning.space.STEP`: contact and sensor change by about a tenth of the
#: amplitude from day to day.
NEIGHBOURS = 3

#: Confidence that is needed to prefer a chain to one nearer to the given chain. It is high, as the
#: best of many chains may only be lucky.
CONFIDENCE = 0.99

#: Areas under the ROC curve that differ by less than this count as equal.
AUC_STEP = 1e-3

#: Factor on the cost of whatever is worse than with the given parameters.
WORSE_COUNTS = 10.0


class CandidateFigures(NamedTuple):
    """The figures of a chain that the search compares.

    Attributes
    ----------
    median_ms : float
        Median latency of all slips, where a missed slip counts as infinitely late.
    missed : float
        Share of the slips that are missed.
    false_alarms_per_minute : float
        In the time without slip.
    auc : float or None
        Area under the ROC curve of the decision statistic; see :meth:`Objective.auc`.
    latency_ms : float or None
        Median latency of the slips that are not missed.

    Examples
    --------
    >>> given = CandidateFigures(50.0, 0.0, 1.0, auc=0.9, latency_ms=50.0)
    >>> CandidateFigures(40.0, 0.1, 1.0, auc=0.9, latency_ms=38.0).worse_than(given)
    ['missed 10 against 0 %']
    """

    median_ms: float
    missed: float
    false_alarms_per_minute: float
    auc: float | None
    latency_ms: float | None

    def worse_than(self, other: 'CandidateFigures') -> list[str]:
        """Return a text for each of latency, misses, false alarms and area that is worse."""
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
    """A chain with its threshold and vote, and its cost.

    Attributes
    ----------
    chain : ChainConfig
    cost_ms : float
    error_ms : float
        Error of the cost, by Student's t: few slips tell little.
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
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = LabelledRows(np.tile(volts, (16, 1)).T, truth=slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> given = Objective([track], EvaluationConfig(), TuneConfig()).as_it_is(ChainConfig())
    >>> given.figures.missed, given.figures.false_alarms_per_minute
    (0.0, 0.0)
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

        Votes with which the chain is never ON are left out.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        candidates = []
        for vote, statistic in self.statistics(chain, votes_of(chain)).items():
            limits = thresholds(statistic, self._tracks, *threshold_scale(chain))
            if limits.size:
                sweep = self.sweep(statistic, limits)
                costs_ms = _with_neighbours(self._event_costs_ms(sweep))
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
        sweep = self.sweep(statistic, np.array([chain.threshold]))
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

    def sweep(self, statistic: Sequence[Floats], limits: Floats) -> ThresholdSweep:
        """Return latencies and false alarms at each threshold; see :func:`sweep_thresholds`."""
        return sweep_thresholds(statistic, self._tracks, limits, self._evaluation)

    def auc(self, statistic: Sequence[Floats], threshold: float) -> float | None:
        """Return the area under the ROC curve of rows with slip against rows of motion.

        Where no motion is known, it is against all rows without slip.
        """
        for part, track in zip(statistic, self._tracks, strict=True):
            # The chain divides too: so the scores are those of an evaluation, to the bit.
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
        cost_ms = event_cost_ms + self._config.auc_costs_ms * (1.0 - (auc or 0.0))
        latencies_ms = sweep.latencies_ms[:, at]
        known = latencies_ms[~np.isnan(latencies_ms)]
        figures = CandidateFigures(
            median_ms=float(np.median(np.where(np.isnan(latencies_ms), np.inf, latencies_ms))),
            missed=float(sweep.missed[at]),
            false_alarms_per_minute=float(sweep.false_alarms_per_minute[at]),
            auc=auc,
            latency_ms=float(np.median(known)) if known.size else None,
        )
        return Candidate(chain, cost_ms, self._error_ms(sweep, at), figures)

    def _event_costs_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return the cost of slips and alarms at each of T thresholds, shape (T,)."""
        config, given = self._config, self._given
        late_ms = self._late_ms(sweep)
        false_costs = config.false_alarm_costs_ms
        costs = late_ms.mean(axis=0) + false_costs * sweep.false_alarms_per_minute
        if given is not None:
            median = min(given.median_ms, config.missed_costs_ms)
            worse = np.maximum(np.median(late_ms, axis=0) - median, 0.0)
            worse += config.missed_costs_ms * np.maximum(sweep.missed - given.missed, 0.0)
            worse += false_costs * np.maximum(
                sweep.false_alarms_per_minute - given.false_alarms_per_minute, 0.0
            )
            costs += WORSE_COUNTS * worse
        return np.asarray(costs)

    def _error_ms(self, sweep: ThresholdSweep, at: int) -> float:
        """Return the error of the mean latency by Student's t, at ``CONFIDENCE``.

        A chain whose cost is higher by less than this counts as equally good. With one slip the
        error is infinite.
        """
        late_ms = self._late_ms(sweep)[:, at]
        if late_ms.size < 2:
            return math.inf
        t = float(special.stdtrit(late_ms.size - 1, 0.5 + CONFIDENCE / 2))
        return t * float(np.std(late_ms, ddof=1)) / math.sqrt(late_ms.size)

    def _late_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return the latencies, with the cost of a miss for missed slips; shape (slips, T)."""
        return np.fmin(sweep.latencies_ms, self._config.missed_costs_ms)


def _with_neighbours(costs: Floats) -> Floats:
    """Return the mean of each cost and of the costs of the neighbouring thresholds; shape (T,)."""
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(costs, NEIGHBOURS, mode='edge')
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))
