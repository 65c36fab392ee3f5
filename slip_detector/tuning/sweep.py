"""All thresholds and votes of a chain from one pass over labelled rows.

Neither needs another pass of the filters. For each vote the chain's level gives one number a row
that is held against the threshold (:func:`statistics`), and a rise of the global decision at a
threshold is a rise of that number through it. So the rows are run through once, and of each row
only those thresholds are touched that its number passes.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.chain.kernel import exchange
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.scores import MOTION, SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Vote = str | int

#: Rows that the chain and the statistics take at a time: their level stays in the cache.
ROWS_PER_CALL = 2048

#: Rows that the statistics sort side by side, in vector registers.
LANE_ROWS = 128

#: A geometric mean is taken of the logarithms of products of so many levels: fewer logarithms.
FACTORS = 4


@compiled
def _raise(most, values):
    for r in range(most.size):
        u, v = most[r], values[r]
        most[r] = u if u > v else v


@compiled
def _means(lanes, rows, size, product, mean):
    """Write the geometric mean of ``size`` lanes.

    Arrays are taken whole with their number of rows: of a part of an array the compiler does not
    know that its values are side by side, and works on one at a time.
    """
    if size == FACTORS:  # as in the paper's groups: roots are cheaper than logarithms
        a, b, c, d = lanes[0], lanes[1], lanes[2], lanes[3]
        for r in range(rows):
            mean[r] = np.sqrt(np.sqrt((a[r] * b[r]) * (c[r] * d[r])))
        return
    mean[:] = 0.0
    for first in range(0, size, FACTORS):
        product[:] = 1.0
        for j in range(first, min(first + FACTORS, size)):
            lane = lanes[j]
            for r in range(rows):
                product[r] *= lane[r]
        for r in range(rows):
            mean[r] += np.log(product[r])
    for r in range(rows):
        mean[r] = np.exp(mean[r] / size)


@compiled
def _statistics(level, valid, members, bounds, counts, lanes, product, mean, out, first):
    """Write the largest statistic of the groups, by vote: all, mean, then the counts.

    ``first`` is the column of ``out`` that the first row goes to.
    """
    out[:, first : first + level.shape[0]] = 0.0
    for start in range(0, level.shape[0], LANE_ROWS):
        rows = min(LANE_ROWS, level.shape[0] - start)
        for g in range(bounds.size - 1):
            size = bounds[g + 1] - bounds[g]
            able = True
            for j in range(size):
                member, lane = members[bounds[g] + j], lanes[j]
                for r in range(rows):
                    lane[r] = level[start + r, member]
                for r in range(rows):
                    able &= valid[start + r, member]
            if not able:
                _of_some(level, valid, members[bounds[g] : bounds[g + 1]], counts, start, rows,
                         lanes[0], out, first)  # fmt: skip
                continue
            begin, end = first + start, first + start + rows
            for i in range(size - 1):
                for j in range(size - 1, i, -1):
                    exchange(lanes[j - 1][:rows], lanes[j][:rows])
            _raise(out[0][begin:end], lanes[size - 1])
            for v in range(counts.size):
                _raise(out[2 + v][begin:end], lanes[counts[v] - 1])
            _means(lanes, rows, size, product, mean)
            _raise(out[1][begin:end], mean)


@compiled
def _of_some(level, valid, members, counts, start, rows, values, out, first):
    """Take the statistics of one group in rows where not all of its channels are valid."""
    for r in range(start, start + rows):
        n = 0
        logarithm = 0.0
        for j in range(members.size):
            if valid[r, members[j]]:
                value = level[r, members[j]]
                values[n] = value
                logarithm += np.log(value)
                n += 1
        if n:
            values[:n].sort()
            at = first + r
            out[0, at] = max(out[0, at], values[0])
            out[1, at] = max(out[1, at], np.exp(logarithm / n))
            for v in range(counts.size):
                if counts[v] <= n:
                    out[2 + v, at] = max(out[2 + v, at], values[n - counts[v]])


class Statistics:
    """Runs a chain over tracks and keeps, for each vote, what is held against the threshold.

    Parameters
    ----------
    config
        The chain's; its threshold and vote do not matter.
    votes
        As :func:`votes_of` gives them.

    Raises
    ------
    ValueError
        When the chain cannot be built.
    """

    def __init__(self, config: ChainConfig, votes: Sequence[Vote]) -> None:
        # Its own vote is not asked for: the one that costs least.
        self._chain = SlipChain(dataclasses.replace(config, vote='all'))
        disabled = set(config.disabled_channels)
        groups = [[c - 1 for c in m if c not in disabled] for m in config.groups.values()]
        groups = [members for members in groups if members]
        self._members = np.array([c for members in groups for c in members], dtype=np.uint64)
        self._bounds = np.cumsum([0] + [len(members) for members in groups])
        counted = [vote for vote in votes if isinstance(vote, int)]
        self._counts = np.array(counted, dtype=np.int64)
        self._order: list[Vote] = ['all', 'mean', *counted]
        largest = max(map(len, groups))
        self._lanes = np.zeros((largest, max(LANE_ROWS, largest)))
        self._product, self._mean = np.zeros(LANE_ROWS), np.zeros(LANE_ROWS)

    def of(self, track: Track, room: Floats | None = None) -> dict[Vote, Floats]:
        """Return the statistic of each row by vote, shapes (n,), in the level's unit.

        A row is ON at a threshold where its statistic is above it; for ``mean`` up to the last
        bits, as the chain compares a sum of logarithms with 0.

        Parameters
        ----------
        track
            Of n rows.
        room
            What an earlier call returned it in, to be overwritten: new memory costs time.
        """
        shape = (len(self._order), len(track.volts))
        out = room if room is not None and room.shape == shape else np.empty(shape)
        for begin, end, _, new_stretch in track.cuts:
            if new_stretch:
                self._chain.reset()
            for start in range(begin, end, ROWS_PER_CALL):
                rows = slice(start, min(start + ROWS_PER_CALL, end))
                result = self._chain.update(track.volts[rows], envelope=False)
                _statistics(
                    result.level, result.valid, self._members, self._bounds, self._counts,
                    self._lanes, self._product, self._mean, out, start,
                )  # fmt: skip
        return dict(zip(self._order, out, strict=True))


@compiled
def _sweep(statistic, kind, limits, first_row, lows, highs, state, firsts, false, counts):
    """Follow the rises through all thresholds over one piece.

    ``state``: how many thresholds the row before was above, and the first slip whose window has
    not ended.
    """
    above, at = state[0], state[1]
    n_limits, n_slips = limits.size, lows.size
    # Rows between the same two thresholds, as most are, cost two comparisons.
    low, high = -np.inf, -np.inf
    for r in range(statistic.size):
        value = statistic[r]
        if low < value <= high:
            counts[kind[r], above] += 1
            continue
        before = above
        while above < n_limits and value > limits[above]:
            above += 1
        while above > 0 and value <= limits[above - 1]:
            above -= 1
        low = limits[above - 1] if above > 0 else -np.inf
        high = limits[above] if above < n_limits else np.inf
        counts[kind[r], above] += 1
        if above > before:
            row = first_row + r
            while at < n_slips and highs[at] <= row:
                at += 1
            able = at < n_slips and lows[at] <= row
            next_able = at + 1 < n_slips and lows[at + 1] <= row
            for t in range(before, above):
                if able and firsts[at, t] < 0:
                    firsts[at, t] = row
                elif next_able and firsts[at + 1, t] < 0:
                    firsts[at + 1, t] = row
                elif not able and not next_able:
                    false[t] += 1
    state[0], state[1] = above, at


def windows(track: Track, early_rows: int, tail_rows: int) -> tuple[Ints, Ints]:
    """Return from which row to before which an alarm can belong to each slip; shapes (slips,)."""
    bounds = np.array(track.slips, np.int64).reshape(-1, 2)
    lows, highs = bounds[:, 0] - early_rows, bounds[:, 1] + tail_rows
    lows[1:] = np.maximum(lows[1:], bounds[:-1, 1])
    highs[:-1] = np.minimum(highs[:-1], bounds[1:, 0])
    return lows, highs


class ThresholdSweep(NamedTuple):
    """What becomes of tracks at each of T thresholds of one vote.

    Attributes
    ----------
    thresholds : ndarray, shape (T,)
    latencies_ms : ndarray, shape (slips, T)
        Of each true slip; NaN where it is missed.
    false_alarms : ndarray of int, shape (T,)
    quiet_s : float
        Time without slip.
    counts : ndarray of int, shape (3, T + 1)
        Rows by their kind and by how many thresholds they are above.
    """

    thresholds: Floats
    latencies_ms: Floats
    false_alarms: Ints
    quiet_s: float
    counts: Ints

    @property
    def false_alarms_per_minute(self) -> Floats:
        """Of the time without slip; shape (T,)."""
        return np.asarray(60.0 * self.false_alarms / self.quiet_s)

    @property
    def missed(self) -> Floats:
        """Share of the slips; shape (T,)."""
        return np.asarray(np.isnan(self.latencies_ms).mean(axis=0))

    def auc(self) -> float | None:
        """Area under the ROC curve of rows with slip against rows of motion without.

        Where no row is known to be one of motion, against all rows without slip. Rows between the
        same two thresholds are ties.
        """
        negative = self.counts[MOTION] if self.counts[MOTION].any() else self.counts[:SLIP].sum(0)
        positive = self.counts[SLIP]
        pairs = int(positive.sum()) * int(negative.sum())
        if not pairs:
            return None
        return float(positive @ (np.cumsum(negative) - 0.5 * negative)) / pairs


def sweep_thresholds(
    statistic: Sequence[Floats],
    tracks: Sequence[Track],
    limits: Floats,
    config: EvaluationConfig,
) -> ThresholdSweep:
    """Match slips and alarms at each threshold, as :func:`.events.match` does at one.

    Parameters
    ----------
    statistic
        By track, shapes (n,), of one vote.
    tracks
        At least one slip in all.
    limits
        Thresholds, rising.
    config
        What counts as detected.
    """
    false = np.zeros(limits.size, np.int64)
    counts = np.zeros((3, limits.size + 1), np.int64)
    latencies_ms = []
    for part, track in zip(statistic, tracks, strict=True):
        rate_hz = track.sample_rate_hz
        early, tail = (round(seconds * rate_hz) for seconds in (config.early_s, config.tail_s))
        lows, highs = windows(track, early, tail)
        firsts = np.full((len(track.slips), limits.size), -1, np.int64)
        state = np.zeros(2, np.int64)
        for begin, end, first_row, new_stretch in track.cuts:
            if new_stretch:
                state[0] = 0
            _sweep(
                part[begin:end], track.kind[begin:end], limits, first_row, lows, highs,
                state, firsts, false, counts,
            )  # fmt: skip
        starts = np.array([slip.start for slip in track.slips], np.float64)[:, None]
        found = np.where(firsts >= 0, firsts - starts, np.nan)
        latencies_ms.append(found * (1e3 / rate_hz))
    quiet_s = sum(track.quiet_s for track in tracks)
    return ThresholdSweep(limits, np.concatenate(latencies_ms), false, quiet_s, counts)
