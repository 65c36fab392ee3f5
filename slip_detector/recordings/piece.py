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

"""A piece of a recording, ready for the chain."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Piece(NamedTuple):
    """Consecutive rows, ready for the chain: evenly spaced within a stretch.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (n,)
    truth : ndarray of bool, shape (n,), or None
    new_stretch : bool
        Whether the chain must be reset before these rows: in the first piece and after a long gap.
    row_numbers : ndarray of int, shape (n,)
        Number of each row in the recording, from 0; a row that bridges a gap has the number of
        the last row before the gap.

    Examples
    --------
    >>> stamps_ns, numbers = np.array([0, 10, 20]), np.array([0, 0, 1])
    >>> piece = Piece(np.ones((3, 2)), stamps_ns, None, new_stretch=True, row_numbers=numbers)
    >>> (np.diff(piece.row_numbers) == 0).tolist()  # the second row bridges a gap
    [True, False]
    """

    volts: Floats
    stamps_ns: Stamps
    truth: 'Bools | None'
    new_stretch: bool
    row_numbers: Stamps
