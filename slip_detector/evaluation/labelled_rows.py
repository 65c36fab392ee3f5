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

"""Rows of a recording with their labels: whether there is slip, and whether the robot moves."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.stamps import missing_rows

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Kinds = NDArray[np.int8]
Stamps = NDArray[np.int64]

#: Kinds of rows: the robot rests, or its motion is not known; the robot moves; there is slip.
REST, MOTION, SLIP = range(3)


class LabelledRows(NamedTuple):
    """A piece of a recording: n rows of c channels.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    truth : ndarray of bool, shape (n,)
        The label: whether there is slip.
    stamps_ns : ndarray of int, shape (n,), or None
        Stamps of the rows. They are used only for the length of the gap before a new stretch.
    new_stretch : bool
        Whether a long gap comes before these rows, so that the chain is reset.
    moving : ndarray of bool, shape (n,), or None
        Whether the robot moves, where that is known.
    """

    volts: Floats
    truth: Bools
    stamps_ns: Stamps | None = None
    new_stretch: bool = False
    moving: Bools | None = None

    @property
    def kinds(self) -> Kinds:
        """The kind of each row: :data:`REST`, :data:`MOTION` or :data:`SLIP`; shape (n,).

        A row with slip is of the kind :data:`SLIP` whether the robot moves or not.

        Examples
        --------
        >>> truth, moving = np.array([False, False, True]), np.array([False, True, True])
        >>> LabelledRows(np.zeros((3, 1)), truth, moving=moving).kinds
        array([0, 1, 2], dtype=int8)
        """
        kinds = np.full(len(self.truth), REST, np.int8)
        if self.moving is not None:
            kinds[self.moving] = MOTION
        kinds[self.truth] = SLIP
        return kinds


def rows_in_gap(
    last_stamps_ns: Stamps | None, stamps_ns: Stamps | None, sample_rate_hz: float
) -> int:
    """Return how many rows are missing in the gap between two stretches; 0 without stamps.

    Parameters
    ----------
    last_stamps_ns, stamps_ns : ndarray of int, or None
        Stamps of the last rows before the gap and of the first rows after it.
    sample_rate_hz
        Rate of the recording.

    Examples
    --------
    >>> rows_in_gap(np.array([0, 10_000_000]), np.array([50_000_000]), sample_rate_hz=100.0)
    3
    """
    if last_stamps_ns is None or stamps_ns is None:
        return 0
    return missing_rows(int(last_stamps_ns[-1]), int(stamps_ns[0]), sample_rate_hz)
