"""The figures of all thresholds and votes of a chain from one pass over labelled rows.

For each vote the chain gives one number for each row, the decision statistic, which is compared
with the threshold. The global decision rises where this number rises above the threshold. So the
filters run once, and in each row only the thresholds are touched that the number passes.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.matching import (
    NONE,
    alarm_windows,
    give_alarm,
    is_false,
    slip_not_over,
    tolerance_rows,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.space import Vote
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Number of rows that the chain is given at a time, so that its results stay in the cache.
ROWS_PER_CALL = 2048


class VoteStatistics:
    """Runs a chain over tracks and returns the decision statistic of each vote.

    Parameters
    ----------
    config
        Parameters of the chain; its threshold and vote are not used.
    votes
        Each is ``all``, ``mean`` or a number of channels.

    Raises
    ------
    ValueError
        When the chain cannot be built.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> rows = LabelledRows(np.full((5, 16), 4.3), truth=np.zeros(5, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> VoteStatistics(ChainConfig(), ['all', 'mean']).of(track).shape
    (2, 5)
    """

    def __init__(self, config: ChainConfig, votes: Sequence[Vote]) -> None:
        # At a threshold of 1 the statistic has the unit of the level; where evidence never gets
        # there, a power of two makes it so without rounding. The chain's own decision is not used,
        # so it has the vote that takes the least time.
        self._unit = 1.0
        if config.decision == 'evidence' and config.evidence_limit_db_s <= 1.0:
            self._unit = 2.0 ** (math.floor(math.log2(config.evidence_limit_db_s)) - 1)
        self._chain = SlipChain(dataclasses.replace(config, vote='all', threshold=self._unit))
        self._votes = tuple(votes)

    def of(self, track: Track, out: Floats | None = None) -> Floats:
        """Return the statistic of each row of a track in the level's unit.

        Parameters
        ----------
        track
            A track of n rows.
        out
            The array that an earlier call returned for this track, to be overwritten: new memory
            takes time.

        Returns
        -------
        ndarray, shape (votes, n)
            A chain with that vote is ON exactly where this is above its threshold.
        """
        shape = (len(self._votes), len(track.volts))
        if out is None or out.shape != shape:
            out = np.empty(shape)
        for begin, end, _, new_stretch in track.pieces:
            if new_stretch:
                self._chain.restart() if begin else self._chain.reset()
            for start in range(begin, end, ROWS_PER_CALL):
                rows = slice(start, min(start + ROWS_PER_CALL, end))
                result = self._chain.update(
                    track.volts[rows], envelope=False, level=False, votes=self._votes
                )
                _transpose(result.vote_statistic, self._unit, out, start)
        return out


@compiled
def _transpose(statistics, unit, out, start):
    """Write rows of statistics, shape (n, votes), to columns of ``out`` from ``start`` on.

    They are multiplied by ``unit``.
    """
    for v in range(statistics.shape[1]):
        for k in range(statistics.shape[0]):
            out[v, start + k] = unit * statistics[k, v]


@compiled
def _sweep(statistic, limits, first_row, lows, highs, state, rises, false_alarms):
    """Follow the rises of a statistic through all thresholds over one piece of a track.

    ``state`` is the number of thresholds below the value of the row before, and the first slip
    whose window has not ended. An alarm is identified by the row at which it rises.
    """
    above, slip = state[0], state[1]
    # Most rows stay between the same two thresholds, which takes two comparisons.
    low = limits[above - 1] if above > 0 else -np.inf
    high = limits[above] if above < limits.size else np.inf
    for r in range(statistic.size):
        value = statistic[r]
        if low < value <= high:
            continue
        before = above
        while above < limits.size and value > limits[above]:
            above += 1
        while above > 0 and value <= limits[above - 1]:
            above -= 1
        low = limits[above - 1] if above > 0 else -np.inf
        high = limits[above] if above < limits.size else np.inf
        if above > before:
            row = first_row + r
            slip = slip_not_over(row, slip, highs)
            if is_false(row, slip, lows):
                for t in range(before, above):
                    false_alarms[t] += 1
            else:
                for t in range(before, above):
                    give_alarm(row, row, slip, lows, rises, t)
    state[0], state[1] = above, slip


class ThresholdSweep(NamedTuple):
    """Latencies and false alarms at each of T thresholds of one vote.

    Attributes
    ----------
    latencies_ms : ndarray, shape (slips, T)
        Latency of each true slip; NaN where it is missed.
    false_alarms : ndarray of int, shape (T,)
    quiet_s : float
        Time without slip.

    Examples
    --------
    >>> sweep = ThresholdSweep(np.array([[40.0, np.nan]]), np.array([2, 0]), quiet_s=60.0)
    >>> sweep.false_alarms_per_minute, sweep.missed
    (array([2., 0.]), array([0., 1.]))
    """

    latencies_ms: Floats
    false_alarms: Ints
    quiet_s: float

    @property
    def false_alarms_per_minute(self) -> Floats:
        """False alarms per minute of the time without slip; shape (T,)."""
        return np.asarray(60.0 * self.false_alarms / self.quiet_s)

    @property
    def missed(self) -> Floats:
        """Share of the slips that are missed; shape (T,)."""
        return np.asarray(np.isnan(self.latencies_ms).mean(axis=0))


def sweep_thresholds(
    statistic: Sequence[Floats],
    tracks: Sequence[Track],
    limits: Floats,
    config: EvaluationConfig,
) -> ThresholdSweep:
    """Match slips and alarms at each threshold, as :func:`.matching.match` does at one.

    Parameters
    ----------
    statistic
        The decision statistic of one vote for each track, shapes (n,).
    tracks
        The tracks, of which at least one has rows without slip.
    limits
        Thresholds in rising order.
    config
        What counts as detected.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.array([False, False, True, True, True])
    >>> track = track_of('trial', [LabelledRows(np.zeros((5, 1)), slip)], sample_rate_hz=100.0)
    >>> statistic, limits = np.array([0.0, 0.2, 0.2, 0.6, 0.9]), np.array([0.1, 0.5, 1.0])
    >>> sweep = sweep_thresholds([statistic], [track], limits, EvaluationConfig())
    >>> sweep.latencies_ms, sweep.false_alarms
    (array([[nan, 10., nan]]), array([1, 0, 0]))
    """
    false_alarms = np.zeros(limits.size, np.int64)
    latencies_ms = [np.zeros((0, limits.size))]
    for part, track in zip(statistic, tracks, strict=True):
        rate_hz = track.sample_rate_hz
        lows, highs = alarm_windows(track.slips, *tolerance_rows(config, rate_hz))
        rises = np.full((len(track.slips), limits.size), NONE, np.int64)
        state = np.zeros(2, np.int64)
        for begin, end, first_row, new_stretch in track.pieces:
            if new_stretch:
                state[0] = 0
            _sweep(
                part[begin:end], limits, first_row, lows, highs, state, rises, false_alarms
            )  # fmt: skip
        starts = np.array([slip.start for slip in track.slips], np.int64)[:, np.newaxis]
        latencies_ms.append(np.where(rises == NONE, np.nan, (rises - starts) / rate_hz * 1e3))
    quiet_s = sum(track.quiet_s for track in tracks)
    return ThresholdSweep(np.concatenate(latencies_ms), false_alarms, quiet_s)
