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

"""The true slip in a recording: from labels, from published states, or from positions."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Bools = NDArray[np.bool_]


def as_truth(label: NDArray[Any], key: str, path: Path) -> NDArray[np.bool_]:
    """Convert labels to bool, shape (n,).

    Parameters
    ----------
    label : ndarray, shape (n,) or (n, 1)
        Bools, or numbers that are 0 or 1.
    key
        Name of the array or column.
    path
        The recording.

    Raises
    ------
    ValueError
        When a label is neither, such as NaN or a text; names the file, the key and the label.

    Examples
    --------
    >>> as_truth(np.array([0.0, 1.0]), 'slip', Path('trial.npz'))
    array([False,  True])
    """
    if label.dtype.kind == 'b':
        return label.reshape(-1)
    wrong = label[~np.isin(label, (0, 1))] if label.dtype.kind in 'iuf' else label.reshape(-1)
    if wrong.size:
        raise ValueError(f'{path}: {key} has {wrong.tolist()[0]!r}, allowed: 0 and 1')
    return np.asarray(label, dtype=bool).reshape(-1)


def states_at(changed_at: NDArray[Any], states: Bools, at: NDArray[Any]) -> Bools:
    """Return the state at each time: that of the last change at or before it.

    Parameters
    ----------
    changed_at : ndarray of int or float, shape (k,)
        Times at which the state was published, in rising order.
    states : ndarray of bool, shape (k,)
        The states.
    at : ndarray of int or float, shape (n,)
        The times for which the state is wanted, in the same unit.

    Returns
    -------
    ndarray of bool, shape (n,)
        False before the first change.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.recordings.truth import states_at
    >>> states_at(np.array([10, 20]), np.array([True, False]), np.array([5, 10, 19, 20]))
    array([False,  True,  True, False])
    """
    from_none_on = np.concatenate([[False], states])
    return np.asarray(from_none_on[np.searchsorted(changed_at, at, side='right')])


class PlatformMotion:
    """Finds the times at which a position changes (the paper's Eq. 9).

    There is motion between two messages with different positions, including both of their times:
    the last sample at which the platform still stood is the first sample of the slip.

    Parameters
    ----------
    still_m
        A step of the position up to this counts as rest.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.recordings.truth import PlatformMotion
    >>> motion = PlatformMotion(still_m=1e-6)
    >>> motion.add(np.array([0, 10, 20, 30]), np.array([[0.0], [0.0], [0.1], [0.1]]))
    >>> motion.at(np.array([5, 10, 20, 25]))
    array([False,  True,  True, False])
    """

    def __init__(self, still_m: float) -> None:
        self._still_m = still_m
        self._last: tuple[Stamps, Floats] | None = None
        self._edges_ns: list[int] = []

    def add(self, stamps_ns: Stamps, positions_m: Floats) -> None:
        """Add the next stamps, (n,), and positions, (n, axes)."""
        if self._last is not None:
            stamps_ns = np.concatenate([self._last[0], stamps_ns])
            positions_m = np.concatenate([self._last[1], positions_m])
        moves = (np.abs(np.diff(positions_m, axis=0)) > self._still_m).any(axis=1)
        edges = np.diff(np.concatenate([[False], moves, [False]]).astype(np.int8))
        starts = stamps_ns[np.flatnonzero(edges == 1)].tolist()
        ends = stamps_ns[np.flatnonzero(edges == -1)].tolist()
        if starts and self._edges_ns and starts[0] <= self._edges_ns[-1]:
            # The motion at the end of the previous call continues.
            del starts[0], self._edges_ns[-1]
            self._edges_ns.append(ends.pop(0))
        for start, end in zip(starts, ends, strict=True):
            self._edges_ns += [start, end]
        self._last = stamps_ns[-1:], positions_m[-1:]

    def at(self, at_ns: Stamps) -> Bools:
        """Return whether there is motion at each time, (n,)."""
        edges = np.array(self._edges_ns, dtype=np.int64)
        began = np.searchsorted(edges[::2], at_ns, side='right')
        over = np.searchsorted(edges[1::2], at_ns, side='left')
        return np.asarray(began > over)
