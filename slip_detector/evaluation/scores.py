"""Figures of merit of decisions against labels: the paper's, and the area under the ROC curve."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.chain.result import SlipResult
from slip_detector.chain.votes import VOTE_ALL, VOTE_MEAN
from slip_detector.parameters.detector import ChainConfig

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Kinds of rows: the robot rests (or nobody says whether it moves), it moves, there is slip.
REST, MOTION, SLIP = range(3)

#: Scores of one class differ by less than this share.
SCORE_RESOLUTION = 2.0**-10

# A class is the exponent of a score, as float64 has it, and the first ten bits of its mantissa; it
# is 0 below 2^-126, and the last one from 2^129.
_DROPPED_BITS = 42
_LOWEST_CLASS = (1023 - 127) << 10
_CLASSES = 1 << 18


@compiled
def _statistic(  # type: ignore[no-untyped-def]
    level, flags, members, bounds, vote, threshold, among, statistic
):
    """Write the largest statistic of the groups of each row; ``among`` is room to work in."""
    first = flags.shape[1] - level.shape[1]
    for k in range(level.shape[0]):
        row, marks = level[k], flags[k][first:]
        if vote == VOTE_ALL:  # In vector instructions, and no branches below.
            for i in range(row.size):
                among[i] = row[i] if marks[i] else np.inf
        most = 0.0
        for g in range(bounds.size - 1):
            value = 0.0
            if vote == VOTE_ALL:
                least = np.inf
                for j in range(bounds[g], bounds[g + 1]):
                    mine = among[members[j]]
                    least = mine if mine < least else least
                value = least if least < np.inf else 0.0
            else:
                n = 0
                for j in range(bounds[g], bounds[g + 1]):
                    if marks[members[j]]:
                        among[n] = row[members[j]]
                        n += 1
                if vote == VOTE_MEAN and n > 0:
                    total = 0.0
                    for j in range(n):
                        total += np.log(among[j]) if among[j] > 0.0 else -np.inf
                    value = np.exp(total / n)
                elif vote > 0 and n >= vote:
                    among[:n].sort()
                    value = among[n - vote]
            most = value if value > most else most
        statistic[k] = most / threshold


@compiled
def _count(bits, kinds, table):  # type: ignore[no-untyped-def]
    """Add rows to the table by their kind and the class of their score, given by its bits."""
    for k in range(bits.size):
        # The bits of floats of one sign are ordered as the floats are.
        at = (bits[k] >> _DROPPED_BITS) - _LOWEST_CLASS
        table[kinds[k], min(max(at, 0), _CLASSES - 1)] += 1


class DecisionStatistic:
    """The number that the global decision holds against 1.

    Per group it is taken over level / threshold of the valid channels: the smallest for the vote
    ``all``, the k-th largest for a vote of k, the geometric mean for ``mean``; 0 where the group
    cannot vote. Over the groups it is the largest. Sweeping a limit over it is sweeping the
    threshold, hence it is the score of the ROC curve.

    Parameters
    ----------
    config
        Of the chain.
    """

    def __init__(self, config: ChainConfig) -> None:
        groups = list(config.groups.values())
        self._plan = (
            # Unsigned, so that the kernel need not look for indices counted from the end.
            np.array([channel - 1 for members in groups for channel in members], np.uint64),
            np.cumsum([0] + [len(members) for members in groups]),
            {'all': VOTE_ALL, 'mean': VOTE_MEAN}.get(str(config.vote), config.vote),
            config.threshold,
            np.empty(config.channels),
        )

    def __call__(self, result: SlipResult) -> Floats:
        """Compute it for each row.

        Parameters
        ----------
        result
            Of the chain, n rows with their level.

        Returns
        -------
        ndarray, shape (n,)
            Dimensionless; above 1 where ``result.slip``.
        """
        # One layout, whatever else the result holds: another would be compiled once more.
        level = np.ascontiguousarray(result.level)
        statistic = np.empty(len(level))
        _statistic(level, result.flags, *self._plan, statistic)
        return statistic


class ScoreCounts:
    """How many rows of which kind have which score, in memory that does not grow with the rows.

    Scores are told apart to :data:`SCORE_RESOLUTION` of their value, from 1e-38 to 3e38.

    Attributes
    ----------
    classes : ndarray of int, shape (k,)
        Classes of scores that occur, rising.
    counts : ndarray of int, shape (3, k)
        Rows of the kinds :data:`REST`, :data:`MOTION` and :data:`SLIP` in each.
    """

    def __init__(self, classes: Ints | None = None, counts: Ints | None = None) -> None:
        self.classes = np.zeros(0, np.int64) if classes is None else classes
        self.counts = np.zeros((3, 0), np.int64) if counts is None else counts

    @classmethod
    def pooled(cls, parts: Iterable['ScoreCounts']) -> 'ScoreCounts':
        """Put the rows of several recordings together."""
        tally = ScoreTally()
        for part in parts:
            for kind in (REST, MOTION, SLIP):
                tally.table[kind, part.classes] += part.counts[kind]
        return tally.take()

    @property
    def score(self) -> Floats:
        """The least score of each class; shape (k,)."""
        bits = (self.classes + _LOWEST_CLASS) << _DROPPED_BITS
        return np.where(self.classes > 0, bits.view(np.float64), 0.0)

    def auc(self, against: Iterable[int] = (REST, MOTION)) -> float | None:
        """Return the area under the ROC curve of slip against rows of other kinds.

        Two scores of one class count as a tie. So the area is true to half the share of such
        pairs, which for scores that spread over an octave is some 1e-4.

        Parameters
        ----------
        against
            Kinds of the negatives.

        Returns
        -------
        float or None
            0 to 1; None where there is no positive or no negative.
        """
        positive, negative = self.counts[SLIP], self.counts[list(against)].sum(axis=0)
        pairs = int(positive.sum()) * int(negative.sum())
        if not pairs:
            return None
        below = np.cumsum(negative) - 0.5 * negative
        return float(positive @ below) / pairs

    def roc(self, against: Iterable[int] = (REST, MOTION)) -> tuple[Floats, Floats, Floats]:
        """Return the ROC curve of slip against rows of other kinds.

        Returns
        -------
        false_share, true_share, limit : ndarray, shape (k,)
            Shares of the negatives and of the positives at or above each limit of the score, the
            highest limit first; NaN where there is none of the kind.
        """
        positive = np.cumsum(self.counts[SLIP][::-1])
        negative = np.cumsum(self.counts[list(against)].sum(axis=0)[::-1])
        shares = [
            many / many[-1] if many.size and many[-1] else np.full(many.shape, np.nan)
            for many in (negative, positive)
        ]
        return shares[0], shares[1], self.score[::-1]


class ScoreTally:
    """Counts scores as they come; made once and used for one recording after the other."""

    def __init__(self) -> None:
        self.table = np.zeros((3, _CLASSES), np.int64)

    def add(self, score: ArrayLike, kind: ArrayLike) -> None:
        """Count rows.

        Parameters
        ----------
        score : array_like, shape (n,)
            At least 0.
        kind : array_like of int, shape (n,)
            :data:`REST`, :data:`MOTION` or :data:`SLIP`.
        """
        scores = np.ascontiguousarray(score, np.float64)
        kinds = np.ascontiguousarray(kind, np.int64)
        _count(scores.view(np.int64), kinds, self.table)

    def take(self) -> ScoreCounts:
        """Return what has been counted and forget it."""
        classes = np.flatnonzero(self.table.any(axis=0))
        counts = self.table[:, classes]
        self.table[:, classes] = 0
        return ScoreCounts(classes, counts)


def first_on_delay_s(on: ArrayLike, time_s: ArrayLike, start_s: float) -> float | None:
    """Return the time from the start of slip to the first ON at or after it.

    Parameters
    ----------
    on : array_like of bool, shape (n,)
        Decisions on one channel, group or all.
    time_s : array_like, shape (n,)
        Time of each row, rising.
    start_s : float
        When slip begins.

    Returns
    -------
    float or None
        Seconds; None where there is no such ON.
    """
    times = np.asarray(time_s, dtype=np.float64)
    after = np.flatnonzero(np.asarray(on, dtype=bool) & (times >= start_s))
    return float(times[after[0]]) - start_s if after.size else None


def mean_delay(delays: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation of the delays of the channels (the paper's Eq. 10).

    Parameters
    ----------
    delays
        Seconds, one a channel; None for a channel without.

    Returns
    -------
    mean, sd : float or None
        Over those channels that have a delay; the mean of none and the standard deviation (of
        the sample: n - 1) of fewer than two are not defined: None.
    """
    known = [delay for delay in delays if delay is not None]
    mean = float(np.mean(known)) if known else None
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else None


def false_positive_percent(on: ArrayLike, truth: ArrayLike) -> float | None:
    """Return the share of the time without slip that is ON (the paper's false positives).

    Parameters
    ----------
    on, truth : array_like of bool, shape (n,)
        Decision and true slip of each row.

    Returns
    -------
    float or None
        Percent; None where all rows have slip.
    """
    without = ~np.asarray(truth, dtype=bool)
    return float(100.0 * np.asarray(on, dtype=bool)[without].mean()) if without.any() else None
