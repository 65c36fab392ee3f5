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

"""Rows of rest, motion and slip, counted by their scores, and areas under the ROC curve."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.recordings.labels import KINDS

RowClasses = NDArray[np.int8]

#: Classes of rows without slip: the robot rests, or its motion is not known; the robot moves; any
#: row of a recording in which a finger is tapped, presses, rolls or touches nothing.
WITHOUT_SLIP = ('rest', 'moving', *(kind for kind in KINDS if kind != 'rest'))
REST, MOTION = 0, 1

#: Further classes of rows: there is slip; the row is not scored, as its label is not certain or
#: the chain settles.
SLIP = len(WITHOUT_SLIP)
UNCERTAIN = SLIP + 1

# Scores in one bin differ by less than 2^-10 of their value. The number of a bin is the exponent
# of a score in float64 followed by the first ten bits of its mantissa. Scores below 2^-126 are in
# bin 0, scores from 2^129 on in the last bin.
_DROPPED_BITS = 42
_LOWEST_BIN = (1023 - 127) << 10
_BINS = 1 << 18


def row_classes(
    truth: Bools, moving: Bools | None = None, certain: Bools | None = None, kind: str = ''
) -> RowClasses:
    """Return the class of each row, :data:`REST` to :data:`UNCERTAIN`; shape (n,).

    A row with slip is of the class :data:`SLIP` whether the robot moves or not.

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
    >>> row_classes(np.array([False, False, True]), np.array([False, True, True]))
    array([0, 1, 6], dtype=int8)
    """
    without: RowClasses | int = REST if moving is None else np.where(moving, MOTION, REST)
    if kind not in ('', 'rest'):
        without = WITHOUT_SLIP.index(kind)
    classes = np.where(truth, SLIP, without)
    return np.where(True if certain is None else certain, classes, UNCERTAIN).astype(np.int8)


class ScoreCounts(NamedTuple):
    """Number of rows of each class by score, in memory that does not grow with the rows.

    Scores from 1e-38 to 3e38 are resolved to 2^-10 of their value.

    Attributes
    ----------
    bins : ndarray of int, shape (k,)
        The bins of the scores that occur, in rising order.
    counts : ndarray of int, shape (7, k)
        Number of rows of each of the classes :data:`REST` to :data:`SLIP` in each bin.

    Examples
    --------
    >>> tally = ScoreTally()
    >>> tally.add([0.1, 2.0], [REST, SLIP])
    >>> counts = tally.collect()
    >>> counts.auc(), int(ScoreCounts.pooled([counts, counts]).counts.sum())
    (1.0, 4)
    """

    bins: Ints
    counts: Ints

    @classmethod
    def pooled(cls, parts: Iterable['ScoreCounts']) -> 'ScoreCounts':
        """Return the counts of several recordings together."""
        several = [cls(np.zeros(0, np.int64), np.zeros((UNCERTAIN, 0), np.int64)), *parts]
        counts = np.concatenate([part.counts for part in several], axis=1)
        bins = np.concatenate([part.bins for part in several])
        bins, places = np.unique(bins, return_inverse=True)
        pooled = [np.bincount(places, row, minlength=bins.size) for row in counts]
        return cls(bins, np.array(pooled, np.int64))

    def auc(self, against: Iterable[int] = range(SLIP)) -> float | None:
        """Return the area under the ROC curve of slip against rows of these classes.

        The area is the share of pairs, of a row with slip and a row without, in which the row with
        slip has the higher score; None where there are no pairs. Two scores in one bin count as
        equal. The error of the area is at most half the share of such pairs, about 1e-4 for scores
        that are spread over an octave.
        """
        positive, negative = self.counts[SLIP], self.counts[list(against)].sum(axis=0)
        pairs = int(positive.sum()) * int(negative.sum())
        below = np.cumsum(negative) - 0.5 * negative
        return float(np.sum(positive * below)) / pairs if pairs else None

    def aucs(self) -> dict[str, float | None]:
        """Return the areas of slip against all other rows and against each class of them.

        Returns
        -------
        dict
            ``auc_all``, and ``auc_<class>`` for each of :data:`WITHOUT_SLIP`. ``auc`` is the mean
            of two areas: against rest (against motion, where that is known), and the mean area
            against the other kinds of recordings. None where an area is not defined.
        """
        areas = {f'auc_{name}': self.auc([number]) for number, name in enumerate(WITHOUT_SLIP)}
        rest, moving, *others = areas.values()
        parts = [rest if moving is None else moving], others
        known = [[area for area in part if area is not None] for part in parts]
        means = [np.mean(part) for part in known if part]
        return {'auc_all': self.auc(), **areas, 'auc': float(np.mean(means)) if means else None}

    @property
    def scores(self) -> Floats:
        """The least score of each bin; shape (k,)."""
        lowest = ((self.bins + _LOWEST_BIN) << _DROPPED_BITS).view(np.float64)
        return np.where(self.bins > 0, lowest, 0.0)


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
        self._counts = np.zeros((_BINS, UNCERTAIN + 1), np.int64)
        self._occurs = np.zeros(_BINS, bool)

    def add(self, scores: ArrayLike, classes: ArrayLike) -> None:
        """Count rows: scores of at least 0, and classes, of which ``UNCERTAIN`` is not counted."""
        bits = np.ascontiguousarray(scores, np.float64).view(np.int64)
        # The bits of positive floats have the same order as the floats.
        bins = np.clip((bits >> _DROPPED_BITS) - _LOWEST_BIN, 0, _BINS - 1)
        places = bins * (UNCERTAIN + 1) + np.asarray(classes, np.int64)
        np.add.at(self._counts.reshape(-1), places, 1)
        self._occurs[bins] = True

    def collect(self) -> ScoreCounts:
        """Return the counts so far and start again from zero."""
        bins = np.flatnonzero(self._occurs)
        counts = self._counts[bins, :UNCERTAIN].T
        self._counts[bins] = self._occurs[bins] = 0
        scored = counts.any(axis=0)
        return ScoreCounts(bins[scored], counts[:, scored])
