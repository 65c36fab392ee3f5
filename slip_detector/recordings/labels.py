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

"""The true slip in a recording: from intervals written by hand, or labels of rows."""

import contextlib
import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats, Samples, Stamps
from slip_detector.parameters import (
    file_errors_of,
    name_list,
    quote,
    read_yaml,
    refuse,
    write_yaml,
)

#: Ending of a file of labels beside its recording: ``trial.labels.yaml`` for ``trial.mcap``.
ENDING = '.labels.yaml'

#: Names in a file of labels: of the intervals, of how exact their ends are, of the kind, and of
#: whether a person has found that all of this is wrong.
KEY, ACCURACY, KIND, MISTAKEN = 'slip_s', 'accuracy_s', 'kind', 'mistaken'

#: Kinds of recordings in which nothing slides: an object held still; knocks; pressed, squeezed and
#: let go; rolled; a finger that touches nothing. Other recordings have none.
KINDS = ('rest', 'taps', 'press', 'roll', 'idle')

#: Accuracy in seconds of a label that was given by a key or a button while a finger slid: people
#: press 0.12 to 0.35 s late, and let go 0.08 to 0.3 s late.
BY_HAND_S = 0.35

#: Accuracy in seconds of an end that was moved by hand over a trace, or by :func:`snap`, which is
#: at most 0.07 s off on simulated plates with hum, tremor, taps and drift.
BY_EYE_S = 0.1

#: :func:`snap` removes frequencies below this one, or below this share of the sample rate if that
#: is lower.
LOW_HZ, LOW_SHARE = 20.0, 0.2

#: Fewest rows on either side of a change.
SIDE_ROWS = 8

#: Smallest gain in log-likelihood by a change, per row (a change of 3 dB in the middle has that)
#: and in all.
LEAST_GAIN, LEAST_GAIN_IN_ALL = 0.05, 25.0

#: With one channel, a place is ruled out if its log-likelihood is this much below that of the best
#: place. With four or more channels half of this is enough, as the errors of channels differ.
UNLIKELY = 12.0

#: Largest distance at which an end is searched for, as a multiple of its reach.
FARTHEST = 2.0

#: Quantile of the power to which louder rows are limited, as knocks are short.
LOUDEST = 0.95

#: Largest accuracy that is allowed, in seconds.
MOST_S = 10.0


class Labels(NamedTuple):
    """Intervals of slip from a file.

    Attributes
    ----------
    path : Path
    edges_s : ndarray, shape (k, 2)
        Start and end of each, in order of time, without overlap; seconds from the first sample.
    accuracy_s : float
        How far each of them may be from the true one; 0: exact.
    kind : str
        One of :data:`KINDS`; '': none of them.
    mistaken : bool
        Whether what was recorded is not what its labels, here or in the recording, say.

    Examples
    --------
    >>> labels = Labels(Path('trial.labels.yaml'), np.array([[1.0, 2.5]]))
    >>> labels.edges_ns
    array([1000000000, 2500000000])
    """

    path: Path
    edges_s: Floats
    accuracy_s: float = 0.0
    kind: str = ''
    mistaken: bool = False

    @property
    def edges_ns(self) -> Stamps:
        """All starts and ends, in nanoseconds."""
        return np.rint(1e9 * self.edges_s.ravel()).astype(np.int64)


def labels_name(recording: Path) -> str:
    """Return the name of the file with the labels of a recording."""
    # A dot in the name of a folder does not begin an ending.
    return f'{recording.name if recording.is_dir() else recording.stem}{ENDING}'


def find_labels(setting: str, recording: Path) -> 'Path | None':
    """Return the labels of a recording: the file, or that in the folder, of ``setting``.

    With the setting '' it is the file beside the recording, or None if there is none.
    """
    path = Path(setting) if setting else recording.parent
    if path.is_dir():
        path /= labels_name(recording)
    # A pipe or a broken link in its place is refused when it is read.
    return path if setting or os.path.lexists(path) else None


def mark_mistaken(recording: Path, mistaken: bool) -> None:
    """Note beside a recording that its labels are a mistake, or take that back.

    Raises
    ------
    ValueError
        When its file of labels cannot be read or written; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     mark_mistaken(Path(folder) / 'slip_1', True)
    ...     read_labels(Path(folder) / 'slip_1.labels.yaml').mistaken
    True
    """
    file = recording.parent / labels_name(recording)
    document = {**(read_yaml(file) if os.path.lexists(file) else {}), MISTAKEN: mistaken}
    if mistaken or len(document) > 1:
        write_yaml(file, document, ['Changed by slip_view: whether the labels are a mistake.'])
    else:
        with file_errors_of(file, 'deleted'):
            file.unlink(missing_ok=True)


def read_labels(path: Path) -> Labels:
    """Read a file of labels.

    Parameters
    ----------
    path
        A YAML file with a list ``slip_s`` of pairs of seconds from the first sample, and perhaps
        ``accuracy_s``, how far they may be from the true ones; or with a ``kind``, one of
        :data:`KINDS`, that has no slip. ``mistaken: true`` may stand beside these, or alone.

    Raises
    ------
    ValueError
        When the file cannot be read or has no such list or more, accuracy or kind are not
        allowed, or an interval is empty, begins before the recording or overlaps another; names
        the file and the interval.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from slip_detector.recordings.labels import read_labels
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.labels.yaml'
    ...     _ = path.write_text('slip_s: [[1.0, 2.5]]')
    ...     labels = read_labels(path)
    >>> labels.edges_s
    array([[1. , 2.5]])
    """
    return parse_labels(path, read_yaml(path))


def parse_labels(path: Path, document: dict[str, Any]) -> Labels:
    """Return the labels of a document that is, or will be, in a file; see :func:`read_labels`."""
    accuracy_s, kind = take_accuracy_and_kind(document, f'{path}: ')
    mistaken = document.pop(MISTAKEN, False)
    if not isinstance(mistaken, bool):
        refuse(f'{path}: {MISTAKEN} is {quote(mistaken)}', 'true, false')
    slips = document.pop(KEY, [] if kind or mistaken else None)
    if document:
        allowed = ', '.join((KEY, ACCURACY, KIND, MISTAKEN))
        refuse(f'{path}: has the key {name_list([*map(str, document)])}', allowed)
    try:
        edges_s = np.array(slips, np.float64).reshape(-1, 2)
    except (TypeError, ValueError, ArithmeticError):
        what = f'{path}: has no {KEY}' if slips is None else f'{path}: {KEY} is {quote(slips)}'
        refuse(what, f'{KEY}: [[start, end], ...] in seconds, or {KIND}')
    if kind and edges_s.size:
        raise ValueError(f'{path}: has slips, allowed: none in a recording of the kind {kind}')
    edges_s = edges_s[np.argsort(edges_s[:, 0])]
    steps_s = np.diff(edges_s.ravel(), prepend=0.0).reshape(-1, 2)
    wrong = ~((steps_s[:, 0] >= 0.0) & (steps_s[:, 1] > 0.0))
    if wrong.any():
        start_s, end_s = edges_s[wrong][0]
        why = 'it begins before 0 s or the end of another, or ends before it begins'
        raise ValueError(f'{path}: the slip [{start_s:g}, {end_s:g}] s is not allowed: {why}')
    return Labels(path, edges_s, accuracy_s, kind, mistaken)


def take_accuracy_and_kind(document: dict[str, Any], where: str = '') -> tuple[float, str]:
    """Take out of a document how exact its labels are, and the kind of its recording.

    Raises
    ------
    ValueError
        When the accuracy is no number from 0 to 10 s, or the kind is neither of :data:`KINDS` nor
        ''; begins with ``where``.

    Examples
    --------
    >>> take_accuracy_and_kind({'accuracy_s': '0.35'})
    (0.35, '')
    """
    accuracy, kind = document.pop(ACCURACY, 0.0), document.pop(KIND, '')
    accuracy_s = math.nan
    with contextlib.suppress(TypeError, ValueError, ArithmeticError):
        accuracy_s = float(accuracy)
    if not 0.0 <= accuracy_s <= MOST_S:
        refuse(f'{where}{ACCURACY} is {quote(accuracy)}', f'0 to {MOST_S:g} s')
    if kind not in ('', *KINDS):
        refuse(f'{where}{KIND} is {quote(kind)}', ', '.join(KINDS))
    return accuracy_s, kind


def label_times(at_ns: Stamps, edges_ns: Stamps, accuracy_s: float) -> dict[str, Any]:
    """Return whether there is slip at each time, and whether that is certain.

    Parameters
    ----------
    at_ns : ndarray of int, shape (n,)
        The times.
    edges_ns : ndarray of int, shape (k,)
        Starts and ends of the slips, in rising order; a slip excludes its end.
    accuracy_s
        How exact they are; 0: exact.

    Returns
    -------
    dict
        ``truth`` and ``certain`` of :class:`.Samples`. Times within the accuracy of an end are not
        certain.

    Examples
    --------
    >>> label = label_times(np.array([0, 300_000_000, 500_000_000]), np.array([400_000_000]), 0.1)
    >>> label['truth'], label['certain']
    (array([False, False,  True]), array([ True, False,  True]))
    """
    off_ns = round(accuracy_s * 1e9) * np.array([[-1], [0], [1]])
    first, now, last = np.searchsorted(edges_ns, at_ns + off_ns, side='right')
    return {'truth': now % 2 == 1, 'certain': first == last if accuracy_s else None}


def snap(
    samples: Samples, edges_s: Floats, rate_hz: float, within_s: float
) -> tuple[Floats, Bools, str]:
    """Return the ends of labels, moved to where the power of the signal changes most.

    That is the change point of largest likelihood for a Gaussian signal whose variance, of each
    channel, rises at the start of a slip and falls at its end. Where the likelihood still rises at
    the limit of the search, the search goes on, up to :data:`FARTHEST` times as far, but no
    farther than half way to the next end.

    Parameters
    ----------
    samples : Samples
        A recording, of which the part above :data:`LOW_HZ` counts.
    edges_s : ndarray, shape (k, 2)
        Starts and ends, in order of time, in seconds from the first sample.
    rate_hz
        Rate of the samples.
    within_s
        How far an end may be off.

    Returns
    -------
    edges_s : ndarray, shape (k, 2)
        The ends that were found, where they belong; the others unchanged.
    found : ndarray of bool, shape (k, 2)
        Whether each was found: all places farther off than :data:`BY_EYE_S` are unlikely.
    said : str
        The result in words.

    Examples
    --------
    >>> volts = np.random.default_rng(1).normal(size=(1000, 4)) * 1e-3
    >>> volts[400:] *= 5.0
    >>> samples = Samples.evenly(volts, 100.0, np.zeros(1000))
    >>> edges_s, found, said = snap(samples, np.array([[4.25, 6.2]]), 100.0, 0.35)
    >>> edges_s.round(1), found
    (array([[4. , 6.2]]), array([[ True, False]]))
    >>> said
    'start 4.25 -> 4.00 s, end 6.20 s not known'
    """
    from scipy import signal  # takes a while, and only who labels by hand needs it

    n, reach = len(samples.volts), round(within_s * rate_hz)
    sections = signal.butter(2, min(LOW_HZ, LOW_SHARE * rate_hz), 'high', fs=rate_hz, output='sos')
    volts = np.nan_to_num(samples.volts - samples.volts[:1], posinf=0.0, neginf=0.0)
    power = signal.sosfiltfilt(sections, volts, axis=0, padlen=min(n - 1, 15)) ** 2
    power += 1e-9 * power.max() + np.finfo(float).tiny
    after_ns = samples.stamps_ns - samples.stamps_ns[0]
    rows = np.searchsorted(after_ns, np.rint(1e9 * edges_s.ravel()).astype(np.int64))
    moved_s, found, words = edges_s.ravel().copy(), np.zeros(edges_s.size, bool), list[str]()
    for i, row in enumerate(rows.tolist()):
        # Beyond half way to the next end, the change of that end would be found.
        first = max((rows[i - 1] + row) // 2 if i else 0, row - 3 * reach)
        last = min((row + rows[i + 1]) // 2 if i + 1 < rows.size else n, row + 3 * reach)
        at = _find_change(power[first:last], row - first, reach, BY_EYE_S * rate_hz, i % 2 == 0)
        words.append(f'{"end" if i % 2 else "start"} {moved_s[i]:.2f} s not known')
        if at is not None:
            rows[i], moved_s[i], found[i] = first + at, after_ns[first + at] * 1e-9, True
            words[i] = words[i].replace('s not known', f'-> {moved_s[i]:.2f} s')
    said = name_list(words) if found.any() else f'none of {found.size} ends is known'
    return np.reshape(moved_s, (-1, 2)), np.reshape(found, (-1, 2)), said


def _find_change(power: Floats, row: int, reach: int, exact: float, rises: bool) -> int | None:
    """Return the row near ``row`` where power changes; None if that is not exact enough."""
    (n, channels), below, above = power.shape, reach, reach
    if n < 2 * SIDE_ROWS:
        return None
    row = min(max(row, SIDE_ROWS), n - SIDE_ROWS)
    energy = np.cumsum(np.minimum(power, np.quantile(power, LOUDEST, axis=0)), axis=0)
    while max(below, above) <= FARTHEST * reach:
        at = np.arange(max(row - below, SIDE_ROWS), min(row + above, n - SIDE_ROWS) + 1)
        before = np.log(energy[at - 1] / at[:, np.newaxis]).mean(axis=1)
        after = np.log((energy[-1] - energy[at - 1]) / (n - at)[:, np.newaxis]).mean(axis=1)
        gain = n * np.log(energy[-1] / n).mean() - at * before - (n - at) * after
        gain[(after > before) != rises] = 0.0
        likely = at[gain >= gain.max() - UNLIKELY / math.sqrt(min(channels, 4))]
        if at[0] < likely[0] and likely[-1] < at[-1]:
            sure = gain.max() > max(LEAST_GAIN * n, LEAST_GAIN_IN_ALL) and np.ptp(likely) <= exact
            return int(at[gain.argmax()]) if sure else None
        below += (at[0] == likely[0]) * max(reach // 2, 1)
        above += (at[-1] == likely[-1]) * max(reach // 2, 1)
    return None


def read_truth(label: NDArray[Any], key: str) -> Bools:
    """Convert bools, or numbers that are 0 or 1, to bools of shape (n,); ``key`` names them."""
    flat = label.reshape(-1)
    wrong = flat[~np.isin(flat, (0, 1))] if label.dtype.kind in 'biuf' else flat
    if wrong.size:
        raise ValueError(f'{key} has {wrong.tolist()[0]!r}, allowed: 0 and 1')
    return flat.astype(bool)
