"""Rows of a recording as the chain gets them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Bools = NDArray[np.bool_]


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
