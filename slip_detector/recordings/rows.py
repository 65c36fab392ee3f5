"""Rows of a recording, as they were recorded and as the chain gets them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Bools = NDArray[np.bool_]


class RecordedRows(NamedTuple):
    """Rows as they were recorded.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (n,)
        When each was taken.
    truth : ndarray of bool, shape (n,), or None
        Whether there is slip, where it is known.
    position_m : ndarray, shape (n,), or None
        Position of the platform. It is written; what is read back of it is the truth.
    """

    volts: Floats
    stamps_ns: Stamps
    truth: 'Bools | None' = None
    position_m: 'Floats | None' = None

    def take(self, which: 'NDArray[np.intp] | slice') -> 'RecordedRows':
        """Return some of the rows."""
        truth = None if self.truth is None else self.truth[which]
        return RecordedRows(self.volts[which], self.stamps_ns[which], truth)

    def then(self, more: 'RecordedRows') -> 'RecordedRows':
        """Return these rows and, after them, those of ``more``.

        Examples
        --------
        >>> import numpy as np
        >>> from slip_detector.recordings import RecordedRows
        >>> one = RecordedRows(np.ones((2, 3)), np.array([0, 1_000_000]))
        >>> two = RecordedRows(np.zeros((1, 3)), np.array([2_000_000]))
        >>> one.then(two).stamps_ns
        array([      0, 1000000, 2000000])
        """
        truth = None
        if self.truth is not None and more.truth is not None:
            truth = np.concatenate([self.truth, more.truth])
        return RecordedRows(
            np.concatenate([self.volts, more.volts]),
            np.concatenate([self.stamps_ns, more.stamps_ns]),
            truth,
        )


class Piece(NamedTuple):
    """Rows as the chain gets them, evenly spaced within a stretch.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (n,)
    truth : ndarray of bool, shape (n,), or None
    new_stretch : bool
        Whether the chain is reset before it: the first piece, one after a long gap.
    rows : ndarray of int, shape (n,)
        Which row of the recording each is, counted from 0; a bridged row is the one before it.
    """

    volts: Floats
    stamps_ns: Stamps
    truth: 'Bools | None'
    new_stretch: bool
    rows: Stamps
