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

"""Rows of rest, motion and slip, and the ROC curve of their scores, in bounded memory."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.recordings.labels import KINDS

Kinds = NDArray[np.int8]

#: Kinds of rows without slip: the robot rests, or its motion is not known; the robot moves; any
#: row of a recording in which a finger is tapped, presses, rolls or touches nothing.
WITHOUT_SLIP = ('rest', 'moving', *(kind for kind in KINDS if kind != 'rest'))
REST, MOTION = 0, 1

#: Further kinds of rows: there is slip; what is not scored, as the label is not certain or the
#: chain settles.
SLIP = len(WITHOUT_SLIP)
UNCERTAIN = SLIP + 1

# Scores in one class differ by less than 2^-10 of their value. The number of a class is the
# exponent of a score in float64 followed by the first ten bits of its mantissa. Scores below
# 2^-126 are in class 0, scores from 2^129 on in the last class.
_DROPPED_BITS = 42
_LOWEST_CLASS = (1023 - 127) << 10
_CLASSES = 1 << 18


def kinds_of(
    truth: Bools, moving: Bools | None = None, certain: Bools | None = None, kind: str = ''
) -> Kinds:
    """Return the kind of each row, :data:`REST` to :data:`UNCERTAIN`; shape (n,).

    A row with slip is of the kind :data:`SLIP` whether the robot moves or not.

    Parameters
    ----------
    truth : ndarray of bool, shape (n,)
        Whether there is slip.
    moving : ndarray of bool, shape (n,), or None
        Whether the robot moves, where that is known.
    certain : ndarray of bool, shape (n,), or None
        Whether the label is certain; None: in all rows.
    kind : str
        The kind of the recording, see :mod:`slip_detector.recordings.labels`.

    Examples
    --------
    >>> kinds_of(np.array([False, False, True]), np.array([False, True, True]))
    array([0, 1, 6], dtype=int8)
    """
    others: Kinds | int = REST if moving is None else np.where(moving, MOTION, REST)
    if kind not in ('', 'rest'):
        others = WITHOUT_SLIP.index(kind)
    kinds = np.where(truth, SLIP, others)
    return np.where(True if certain is None else certain, kinds, UNCERTAIN).astype(np.int8)


class ScoreCounts(NamedTuple):
    """Number of rows of each kind by score, in memory that does not grow with the rows.

    Scores from 1e-38 to 3e38 are resolved to 2^-10 of their value.

    Attributes
    ----------
    classes : ndarray of int, shape (k,)
        The classes of the scores that occur, in rising order.
    counts : ndarray of int, shape (7, k)
        Number of rows of each of the kinds :data:`REST` to :data:`SLIP` in each class.

    Examples
    --------
    >>> tally = ScoreTally()
    >>> tally.add([0.1, 2.0], [REST, SLIP])
    >>> counts = tally.collect()
    >>> counts.auc(), int(ScoreCounts.pooled([counts, counts]).counts.sum())
    (1.0, 4)
    """

    classes: Ints
    counts: Ints

    @classmethod
    def pooled(cls, parts: Iterable['ScoreCounts']) -> 'ScoreCounts':
        """Return the counts of several recordings together."""
        several = [cls(np.zeros(0, np.int64), np.zeros((UNCERTAIN, 0), np.int64)), *parts]
        every = np.concatenate([one.counts for one in several], axis=1)
        its_class = np.concatenate([one.classes for one in several])
        classes, places = np.unique(its_class, return_inverse=True)
        counts = [np.bincount(places, kind, minlength=classes.size) for kind in every]
        return cls(classes, np.array(counts, np.int64))

    def auc(self, against: Iterable[int] = range(SLIP)) -> float | None:
        """Return the area under the ROC curve of slip against rows of other kinds.

        Two scores in one class count as equal. The error of the area is at most half the share of
        such pairs, about 1e-4 for scores that are spread over an octave.

        Parameters
        ----------
        against
            The kinds of rows without slip.

        Returns
        -------
        float or None
            0 to 1; None where there are no rows with slip or none of the other kinds.
        """
        positive, negative = self.counts[SLIP], self.counts[list(against)].sum(axis=0)
        pairs = int(positive.sum()) * int(negative.sum())
        if not pairs:
            return None
        below = np.cumsum(negative) - 0.5 * negative
        return float(np.sum(positive * below)) / pairs

    def aucs(self) -> dict[str, float | None]:
        """Return the areas of slip against all other rows and against each kind of them.

        Returns
        -------
        dict
            ``auc_all``, and ``auc_<kind>`` for each of :data:`WITHOUT_SLIP`; and ``auc``: the mean
            of that against rest, in motion where that is known, and of the mean of those against
            the other kinds of recordings. None where one is not defined.
        """
        areas = {f'auc_{name}': self.auc([kind]) for kind, name in enumerate(WITHOUT_SLIP)}
        rest, moving, *kinds = areas.values()
        parts = [rest if moving is None else moving], kinds
        known = [[area for area in part if area is not None] for part in parts]
        means = [np.mean(part) for part in known if part]
        auc = float(np.mean(means)) if means else None
        return {'auc_all': self.auc(), **areas, 'auc': auc}

    def roc(self, against: Iterable[int] = range(SLIP)) -> tuple[Floats, Floats, Floats]:
        """Return the ROC curve of slip against rows of other kinds.

        Returns
        -------
        false_share, true_share, limit : ndarray, shape (k,)
            Shares of the rows without and with slip whose score is at least each limit, the
            highest limit first; NaN where there are no such rows.
        """
        positive = np.cumsum(self.counts[SLIP][::-1])
        negative = np.cumsum(self.counts[list(against)].sum(axis=0)[::-1])
        shares = [
            many / many[-1] if many.size and many[-1] else np.full(many.shape, np.nan)
            for many in (negative, positive)
        ]
        classes = self.classes[::-1]
        lowest = ((classes + _LOWEST_CLASS) << _DROPPED_BITS).view(np.float64)
        return shares[0], shares[1], np.where(classes > 0, lowest, 0.0)


class ScoreTally:
    """Counts the scores of a recording; it can be used for one recording after another.

    Examples
    --------
    >>> tally = ScoreTally()
    >>> tally.add([0.1, 0.4, 0.3, 2.0], [REST, MOTION, SLIP, SLIP])
    >>> counts = tally.collect()
    >>> counts.auc(), counts.auc(against=[MOTION])
    (0.75, 0.5)
    """

    def __init__(self) -> None:
        self._counts = np.zeros((_CLASSES, UNCERTAIN + 1), np.int64)
        self._occurs = np.zeros(_CLASSES, bool)

    def add(self, score: ArrayLike, kind: ArrayLike) -> None:
        """Count rows.

        Parameters
        ----------
        score : array_like, shape (n,)
            At least 0.
        kind : array_like of int, shape (n,)
            :data:`REST` to :data:`UNCERTAIN`, which does not count.
        """
        bits = np.ascontiguousarray(score, np.float64).view(np.int64)
        # The bits of positive floats have the same order as the floats.
        classes = np.clip((bits >> _DROPPED_BITS) - _LOWEST_CLASS, 0, _CLASSES - 1)
        places = classes * (UNCERTAIN + 1) + np.asarray(kind, np.int64)
        np.add.at(self._counts.reshape(-1), places, 1)
        self._occurs[classes] = True

    def collect(self) -> ScoreCounts:
        """Return the counts so far and start again from zero."""
        classes = np.flatnonzero(self._occurs)
        counts = self._counts[classes, :UNCERTAIN].T
        self._counts[classes] = self._occurs[classes] = 0
        occur = counts.any(axis=0)
        return ScoreCounts(classes[occur], counts[:, occur])
