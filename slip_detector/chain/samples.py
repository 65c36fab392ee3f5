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

"""Rows of volts with times, labels and names, from the source to chain, evaluation and page."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: The arrays of all rooms; stamps are in nanoseconds.
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Stamps = NDArray[np.int64]


class Samples(NamedTuple):
    """Consecutive samples, oldest first: the one container for rows of volts in all rooms.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (n,)
        Time at which each sample was taken; empty if unknown.
    truth : ndarray of bool, shape (n,), or None
        The label: whether there is slip; None if unknown.
    position_m : ndarray, shape (n,), or None
        Position of the platform or the object; None if unknown. Recordings have it, and in a bag
        it can be the label.
    moving : ndarray of bool, shape (n,), or None
        Whether the robot moves; None if unknown.
    certain : ndarray of bool, shape (n,), or None
        Whether the label is certain, that is, not within ``accuracy_s`` of one of its changes;
        None: in all rows.
    row_numbers : ndarray of int, shape (n,), or None
        Number of each row in its recording, from 0. A row that bridges a gap has the number of
        the last row before the gap.
    new_stretch : bool
        Whether the chain must be reset before these rows, as after a long gap.
    accuracy_s : float
        Largest error of the times at which the label changes; 0: exact.
    kind : str
        The kind of a recording in which nothing slides, see :mod:`.recordings.labels`.
    names : tuple of str
        Names of the channels; empty if unknown.
    frame_id : str
        Frame of the fingertip; empty if unknown.

    Examples
    --------
    >>> import numpy as np
    >>> samples = Samples(np.zeros((3, 16)), np.array([0, 10, 20]))
    >>> samples.take(slice(2)).then(samples.take(slice(2, None))).stamps_ns.tolist()
    [0, 10, 20]
    """

    volts: Floats
    stamps_ns: Stamps
    truth: Bools | None = None
    position_m: Floats | None = None
    moving: Bools | None = None
    certain: Bools | None = None
    row_numbers: Ints | None = None
    new_stretch: bool = False
    accuracy_s: float = 0.0
    kind: str = ''
    names: tuple[str, ...] = ()
    frame_id: str = ''

    @classmethod
    def evenly(
        cls, volts: ArrayLike, sample_rate_hz: float, truth: ArrayLike, **columns: Any
    ) -> 'Samples':
        """Return labelled rows of volts that are evenly spaced from the time 0 on."""
        rows = np.asarray(volts, np.float64)
        stamps_ns = np.rint(np.arange(len(rows)) * 1e9 / sample_rate_hz).astype(np.int64)
        return cls(rows, stamps_ns, np.asarray(truth, np.bool_), **columns)

    def take(self, which: 'NDArray[np.intp] | slice') -> 'Samples':
        """Return the samples at the given indices."""
        taken: dict[str, Any] = {
            name: column[which] for name, column in self._asdict().items() if _is_array(column)
        }
        return self._replace(**taken)

    def then(self, *more: 'Samples') -> 'Samples':
        """Return these samples followed by others; a column is kept if all have it."""
        joined: dict[str, Any] = {}
        for name, column in self._asdict().items():
            columns = [column, *(getattr(samples, name) for samples in more)]
            if _is_array(column):
                joined[name] = np.concatenate(columns) if all(map(_is_array, columns)) else None
        return self._replace(**joined)


def _is_array(column: object) -> bool:
    return isinstance(column, np.ndarray)
