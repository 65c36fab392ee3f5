"""All thresholds and votes of a chain from one pass over labelled rows.

Neither needs another pass of the filters. For each vote the chain gives one number a row that is
held against the threshold, and a rise of the global decision at a threshold is a rise of that
number through it. So the rows are run through once, and of each row only those thresholds are
touched that its number passes.
"""

import dataclasses
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
    slip_not_over,
    tolerance_rows,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.space import Vote
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Rows that the chain takes at a time: what it makes of them stays in the cache.
ROWS_PER_CALL = 2048


class VoteStatistics:
    """Runs a chain over tracks and keeps, for each vote, what is held against the threshold.

    Parameters
    ----------
    config
        The chain's; its threshold and vote do not matter.
    votes
        Each ``all``, ``mean`` or a count of channels.

    Raises
    ------
    ValueError
        When the chain cannot be built.
    """

    def __init__(self, config: ChainConfig, votes: Sequence[Vote]) -> None:
        # At a threshold of 1 the statistic is in the unit of the level. The chain's own vote is
        # not asked for: it has the one that costs least.
        self._chain = SlipChain(dataclasses.replace(config, vote='all', threshold=1.0))
        self._votes = tuple(votes)

    def of(self, track: Track, room: Floats | None = None) -> Floats:
        """Return the statistic of each row of a track in the level's unit.

        Parameters
        ----------
        track
            Of n rows.
        room
            What an earlier call returned for it, to be overwritten: new memory costs time.

        Returns
        -------
        ndarray, shape (votes, n)
            A chain with that vote is ON at a threshold where, and only where, this is above it.
        """
        shape = (len(self._votes), len(track.volts))
        out = room if room is not None and room.shape == shape else np.empty(shape)
        for begin, end, _, new_stretch in track.pieces:
            if new_stretch:
                self._chain.reset()
            for start in range(begin, end, ROWS_PER_CALL):
                rows = slice(start, min(start + ROWS_PER_CALL, end))
                result = self._chain.update(
                    track.volts[rows], envelope=False, level=False, votes=self._votes
                )
                out[:, rows] = result.vote_statistic.T
        return out


@compiled
def _sweep(statistic, limits, first_row, lows, highs, state, rises, false_alarms):
    """Follow the rises of a statistic through all thresholds over one piece of a track.

    ``state``: how many thresholds the row before was above, and the first slip whose window has
    not ended. An alarm is known by the row at which it rises.
    """
    above, slip = state[0], state[1]
    # Rows between the same two thresholds, as most are, cost two comparisons.
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
            for t in range(before, above):
                if give_alarm(row, row, slip, lows, rises, t) == NONE:
                    false_alarms[t] += 1
    state[0], state[1] = above, slip


class ThresholdSweep(NamedTuple):
    """What becomes of tracks at each of T thresholds of one vote.

    Attributes
    ----------
    latencies_ms : ndarray, shape (slips, T)
        Of each true slip; NaN where it is missed.
    false_alarms : ndarray of int, shape (T,)
    quiet_s : float
        Time without slip.
    """

    latencies_ms: Floats
    false_alarms: Ints
    quiet_s: float

    @property
    def false_alarms_per_minute(self) -> Floats:
        """Of the time without slip; shape (T,)."""
        return np.asarray(60.0 * self.false_alarms / self.quiet_s)

    @property
    def missed(self) -> Floats:
        """Share of the slips; shape (T,)."""
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
        By track, shapes (n,), of one vote.
    tracks
        With some time without slip in all.
    limits
        Thresholds, rising.
    config
        What counts as detected.
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
