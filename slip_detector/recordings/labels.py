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

"""The true slip in a recording: from intervals written by hand, labels, states or positions."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats, Samples, Stamps
from slip_detector.parameters.files import read_yaml

#: Ending of a file of labels beside its recording: ``trial.labels.yaml`` for ``trial.mcap``.
ENDING = '.labels.yaml'

#: Name of the list of intervals in a file of labels.
KEY = 'slip_s'


class Labels(NamedTuple):
    """Intervals of slip from a file.

    Attributes
    ----------
    path : Path
    edges_s : ndarray, shape (k, 2)
        Start and end of each, in order of time, without overlap; seconds from the first sample.

    Examples
    --------
    >>> labels = Labels(Path('trial.labels.yaml'), np.array([[1.0, 2.5]]))
    >>> labels.at(np.array([999_999_999, 1_000_000_000, 2_500_000_000]))
    array([False,  True, False])
    """

    path: Path
    edges_s: Floats

    def at(self, after_ns: Stamps) -> Bools:
        """Return whether there is slip at each time; an interval excludes its end.

        Parameters
        ----------
        after_ns : ndarray of int, shape (n,)
            Times since the first sample, in nanoseconds.
        """
        edges_ns = np.rint(1e9 * self.edges_s.ravel())
        return np.asarray(np.searchsorted(edges_ns, after_ns, side='right') % 2 == 1)

    def check_end(self, end_s: float, recording: Path) -> None:
        """Raise an error if an interval ends after the recording."""
        for start_s, last_s in self.edges_s[-1:]:
            if last_s > end_s:
                raise ValueError(
                    f'{self.path}: the slip [{start_s:g}, {last_s:g}] s is outside the recording '
                    f'{recording.name}, allowed: 0 to {end_s:.6g} s'
                )


def labels_name(recording: Path) -> str:
    """Return the name of the file with the labels of a recording.

    Examples
    --------
    >>> labels_name(Path('recordings/trial.mcap'))
    'trial.labels.yaml'
    """
    # A dot in the name of a folder does not begin an ending.
    return f'{recording.name if recording.is_dir() else recording.stem}{ENDING}'


def find_labels(setting: str, recording: Path) -> 'Path | None':
    """Return the path of the labels of a recording.

    Parameters
    ----------
    setting
        A file or a folder of such files; '': the file beside the recording.
    recording
        Path of the recording.

    Returns
    -------
    Path or None
        None if no file is configured and none is beside the recording.

    Examples
    --------
    >>> find_labels('by_hand.yaml', Path('trial.mcap')).name
    'by_hand.yaml'
    """
    path = Path(setting) if setting else recording.parent
    if path.is_dir():
        path /= labels_name(recording)
    return path if setting or path.is_file() else None


def read_labels(path: Path) -> Labels:
    """Read a file of labels.

    Parameters
    ----------
    path
        A YAML file with a list ``slip_s`` of pairs of seconds from the first sample.

    Raises
    ------
    ValueError
        When the file cannot be read or has no such list or more, or an interval is empty, begins
        before the recording or overlaps another; names the file and the interval.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from slip_detector.recordings.labels import read_labels
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.labels.yaml'
    ...     _ = path.write_text('slip_s: [[1.0, 2.5]]')
    ...     labels = read_labels(path)
    >>> labels.at(np.array([0, 1_000_000_000, 2_500_000_000]))
    array([False,  True, False])
    """
    document = read_yaml(path)
    try:
        edges_s = np.array(document.pop(KEY), np.float64).reshape(-1, 2)
    except (KeyError, TypeError, ValueError, ArithmeticError):
        document = {'no': KEY}
    if document:
        raise ValueError(f'{path}: has more or less than {KEY}: [[start, end]] in seconds')
    edges_s = edges_s[np.argsort(edges_s[:, 0])]
    steps_s = np.diff(edges_s.ravel(), prepend=0.0).reshape(-1, 2)
    wrong = ~((steps_s[:, 0] >= 0.0) & (steps_s[:, 1] > 0.0))
    if wrong.any():
        start_s, end_s = edges_s[wrong][0]
        raise ValueError(
            f'{path}: the slip [{start_s:g}, {end_s:g}] s is not allowed: it begins before 0 s '
            'or the end of another, or ends before it begins'
        )
    return Labels(path, edges_s)


def as_truth(label: NDArray[Any], key: str) -> Bools:
    """Convert labels to bool, shape (n,).

    Parameters
    ----------
    label : ndarray, shape (n,) or (n, 1)
        Bools, or numbers that are 0 or 1.
    key
        Name of the array or column.

    Raises
    ------
    ValueError
        When a label is neither, such as NaN or a text; names the key and the label.

    Examples
    --------
    >>> as_truth(np.array([0.0, 1.0]), 'slip')
    array([False,  True])
    """
    flat = label.reshape(-1)
    wrong = flat[~np.isin(flat, (0, 1))] if label.dtype.kind in 'biuf' else flat
    if wrong.size:
        raise ValueError(f'{key} has {wrong.tolist()[0]!r}, allowed: 0 and 1')
    return flat.astype(bool)


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
    >>> from slip_detector.recordings.labels import states_at
    >>> states_at(np.array([10, 20]), np.array([True, False]), np.array([5, 10, 19, 20]))
    array([False,  True,  True, False])
    """
    from_none_on = np.concatenate([[False], states])
    return np.asarray(from_none_on[np.searchsorted(changed_at, at, side='right')])


def moving_at(positions: Samples, still_m: float, at_ns: Stamps) -> Bools:
    """Return whether a position changes at each time (the paper's Eq. 9).

    There is motion between two rows with different positions, including both of their times: the
    last sample at which the platform still stood is the first sample of the slip.

    Parameters
    ----------
    positions
        Stamps and positions in m, (n, axes).
    still_m
        A step of the position up to this counts as rest.
    at_ns : ndarray of int, shape (n,)
        The times.

    Examples
    --------
    >>> positions = Samples(np.array([[0.0], [0.0], [0.1], [0.1]]), np.array([0, 10, 20, 30]))
    >>> moving_at(positions, 1e-6, np.array([5, 10, 20, 25]))
    array([False,  True,  True, False])
    """
    moves = (np.abs(np.diff(positions.volts, axis=0)) > still_m).any(axis=1)
    moves = np.concatenate([[False], moves, [False]])
    # The steps that end at or after each time, and those that begin at or before it.
    ending = np.searchsorted(positions.stamps_ns, at_ns, side='left')
    beginning = np.searchsorted(positions.stamps_ns, at_ns, side='right')
    return np.asarray(moves[ending] | moves[beginning])
