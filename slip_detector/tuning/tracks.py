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

"""Labelled recordings in memory, as each trial of a search replays all of them."""

import hashlib
import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import SLIP, LabelledRows, rows_in_gap
from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.evaluation.matching import OnIntervals, RowInterval
from slip_detector.recordings import RecordingCounts, recording_sets

Floats = NDArray[np.float64]

T = TypeVar('T')

#: Time between the two parts of a recording that is cut in two; it is in neither part.
MARGIN_S = 1.0


class TrackPiece(NamedTuple):
    """Consecutive rows of a track.

    Attributes
    ----------
    begin, end : int
        Indices of the first row and of the row after the last in the track's arrays.
    first_row : int
        Number of the first row in the recording, including the rows that are missing in gaps.
    new_stretch : bool
        Whether the chain is reset before these rows.

    Examples
    --------
    >>> piece = TrackPiece(begin=380, end=760, first_row=400, new_stretch=True)
    >>> piece.first_row + piece.end - piece.begin  # the row after it, gaps counted
    780
    """

    begin: int
    end: int
    first_row: int
    new_stretch: bool


class Track(NamedTuple):
    """A labelled recording, or a part of one, in memory.

    Attributes
    ----------
    name : str
    volts : ndarray, shape (n, c)
    kinds : ndarray of int8, shape (n,)
        ``REST``, ``MOTION`` or ``SLIP``; see :mod:`slip_detector.evaluation.labelled_rows`.
    moving : ndarray of bool, shape (n,), or None
        Whether the robot moves, also in rows with slip; None where that is not recorded.
    pieces : tuple of TrackPiece
    slips : tuple of RowInterval
        True slips, in rows that are counted like ``first_row``.
    sample_rate_hz : float
        Rate of the recording, which turns rows into times.

    Examples
    --------
    >>> rows = LabelledRows(np.full((760, 16), 4.3), truth=np.arange(760) >= 380)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> track.duration_s, len(track.stretches), track.slips
    (2.0, 1, (RowInterval(start=380, end=760),))
    """

    name: str
    volts: Floats
    kinds: NDArray[np.int8]
    moving: NDArray[np.bool_] | None
    pieces: tuple[TrackPiece, ...]
    slips: tuple[RowInterval, ...]
    sample_rate_hz: float

    @property
    def duration_s(self) -> float:
        """Time of its rows, without gaps."""
        return len(self.volts) / self.sample_rate_hz

    @property
    def stretches(self) -> list[RowInterval]:
        """Its stretches, in rows that are counted like ``first_row``; between them are gaps."""
        begins = [k for k, piece in enumerate(self.pieces) if piece.new_stretch]
        lasts = [*(k - 1 for k in begins[1:]), len(self.pieces) - 1]
        return [
            RowInterval(self.pieces[k].first_row, last.first_row + last.end - last.begin)
            for k, last in zip(begins, (self.pieces[k] for k in lasts), strict=True)
        ]

    @property
    def rows_of_stretches(self) -> list[slice]:
        """Where each stretch is in the track's arrays."""
        begins = [piece.begin for piece in self.pieces if piece.new_stretch]
        return [slice(*cut) for cut in itertools.pairwise([*begins, len(self.volts)])]

    def rows(self) -> Iterator[LabelledRows]:
        """Yield its pieces, for a replay."""
        period_ns = 1e9 / self.sample_rate_hz
        for begin, end, first_row, new_stretch in self.pieces:
            stamps_ns = np.round((first_row + np.arange(end - begin)) * period_ns)
            yield self._rows(slice(begin, end), stamps_ns.astype(np.int64), new_stretch)

    def part(self, name: str, first: int, last: int) -> 'Track':
        """Return the rows from index ``first`` up to, but not including, ``last`` as a track."""
        rows = [
            self._rows(slice(max(begin, first), min(end, last)), None, new_stretch)
            for begin, end, _, new_stretch in self.pieces
            if begin < last and end > first
        ]
        return track_of(name, rows, self.sample_rate_hz)

    def _rows(
        self, rows: slice, stamps_ns: NDArray[np.int64] | None, new_stretch: bool
    ) -> LabelledRows:
        moving = None if self.moving is None else self.moving[rows]
        return LabelledRows(
            self.volts[rows], self.kinds[rows] == SLIP, stamps_ns, new_stretch, moving
        )


def track_of(name: str, pieces: Iterable[LabelledRows], sample_rate_hz: float) -> Track:
    """Read a recording into memory.

    Parameters
    ----------
    name
        The name of the recording in errors and reports.
    pieces
        The whole recording, in pieces of any length.
    sample_rate_hz
        Rate of the recording.

    Raises
    ------
    ValueError
        When the recording has no rows; names it.

    Examples
    --------
    >>> truth = np.array([False, True, True, False])
    >>> track = track_of('trial', [LabelledRows(np.zeros((4, 1)), truth)], sample_rate_hz=2.0)
    >>> track.duration_s, track.slips, track.stretches
    (2.0, (RowInterval(start=1, end=3),), [RowInterval(start=0, end=4)])
    """
    labels, kinds, moving, volts, track_pieces = OnIntervals(), [], [], [], []
    place = row = 0
    last_stamps_ns = None
    for piece in pieces:
        n = len(piece.volts)
        if not n:
            continue
        if piece.new_stretch and place:
            labels.close(row)
            row += rows_in_gap(last_stamps_ns, piece.stamps_ns, sample_rate_hz)
        labels.add(piece.truth, row)
        volts.append(np.asarray(piece.volts, np.float64))
        kinds.append(piece.kinds)
        moving.append(piece.moving)
        track_pieces.append(TrackPiece(place, place + n, row, piece.new_stretch or not place))
        place, row = place + n, row + n
        last_stamps_ns = piece.stamps_ns
    if not place:
        raise ValueError(f'{name}: has no samples')
    labels.close(row)
    return Track(
        name,
        np.ascontiguousarray(np.concatenate(volts)),
        np.concatenate(kinds),
        _joined(moving),
        tuple(track_pieces),
        tuple(labels.closed()),
        sample_rate_hz,
    )


def _joined(moving: Sequence[NDArray[np.bool_] | None]) -> NDArray[np.bool_] | None:
    """Join the motion of all pieces; None where the recording has no velocities."""
    known = [part for part in moving if part is not None]
    return np.concatenate(known) if known else None


def fingerprint(tracks: Sequence[Track]) -> str:
    """Return a hash of the content of tracks, which does not depend on their names.

    Examples
    --------
    >>> rows = [LabelledRows(np.zeros((4, 1)), truth=np.zeros(4, bool))]
    >>> fingerprint([track_of('a', rows, 2.0)]) == fingerprint([track_of('b', rows, 2.0)])
    True
    """
    digest = hashlib.sha256()
    for track in tracks:
        digest.update(repr((track.volts.shape, track.pieces, track.sample_rate_hz)).encode())
        digest.update(track.volts.data)
        digest.update(track.kinds.data)
    return digest.hexdigest()[:16]


def held_out(tracks: Sequence[Track], share: float) -> tuple[list[Track], list[Track]]:
    """Divide recordings into those that are tuned on and those that are held out.

    Of several recordings with slip every n-th is held out, and likewise of those without slip. A
    single one with slip is cut in two between two slips, as near to the share as possible; the
    ``MARGIN_S`` after the cut are in neither part.

    Parameters
    ----------
    tracks
        The recordings in their order.
    share
        Share of the recordings, or of the time of a single one, to hold out: above 0, below 1.

    Returns
    -------
    training, held : list of Track
        Both have slips.

    Raises
    ------
    ValueError
        When there are too few slips for both; names the recordings.

    Examples
    --------
    >>> rows = [LabelledRows(np.zeros((4, 1)), truth=np.array([False, True, True, False]))]
    >>> training, held = held_out([track_of(name, rows, 2.0) for name in 'abc'], share=1 / 3)
    >>> [track.name for track in training], [track.name for track in held]
    (['a', 'b'], ['c'])
    """
    with_slip = [track for track in tracks if track.slips]
    if not with_slip:
        raise ValueError(
            f'{", ".join(track.name for track in tracks)}: has no slip, allowed: recordings with '
            'slips, to tune on and to hold out'
        )
    if len(with_slip) == 1:
        training, held = _cut_in_two(with_slip[0], share)
    else:
        training, held = hold_out_evenly(with_slip, share)
    quiet, quiet_held = hold_out_evenly([track for track in tracks if not track.slips], share)
    return training + quiet, held + quiet_held


def hold_out_evenly(items: Sequence[T], share: float) -> tuple[list[T], list[T]]:
    """Divide items into those to tune on and those to hold out, which are evenly spread.

    Of two or more at least one is held out, and not all.

    Examples
    --------
    >>> hold_out_evenly(['a', 'b', 'c', 'd'], share=1 / 3)
    (['a', 'b', 'c'], ['d'])
    """
    n = len(items)
    many = min(max(round(share * n), 1), n - 1) if n > 1 else 0
    places = {round((k + 1) * n / many) - 1 for k in range(many)}
    held = [item for i, item in enumerate(items) if i in places]
    return [item for i, item in enumerate(items) if i not in places], held


def _cut_in_two(track: Track, share: float) -> tuple[list[Track], list[Track]]:
    """Cut a recording between two slips; the later part is held out."""
    slipping = np.flatnonzero(np.diff(np.concatenate([[0], track.kinds == SLIP, [0]]).astype(int)))
    starts, ends = slipping[::2], slipping[1::2]
    if len(starts) < 2:
        raise ValueError(
            f'{track.name}: has one slip, allowed: two or more, to tune on and to hold out'
        )
    margin = round(MARGIN_S * track.sample_rate_hz)
    wanted = (1.0 - share) * len(track.volts)
    # The margin is centred between the two slips; it is shorter where they are close together.
    cuts = [
        (int(end) + int(start)) // 2 - min(margin, (int(start) - int(end)) // 2) // 2
        for end, start in zip(ends[:-1], starts[1:], strict=True)
    ]
    k = int(np.argmin([abs(cut - wanted) for cut in cuts]))
    after = cuts[k] + min(margin, (int(starts[k + 1]) - int(ends[k])) // 2)
    n = len(track.volts)
    rate = track.sample_rate_hz
    training = track.part(f'{track.name} to {cuts[k] / rate:.1f} s', 0, cuts[k])
    held = track.part(f'{track.name} from {after / rate:.1f} s', after, n)
    return [training], [held]


def load_tracks(
    paths: Sequence[str],
    loader: RecordingLoader,
    labelled: bool = True,
    left_out: Sequence[str] = (),
) -> tuple[list[Track], list[str]]:
    """Read recordings into memory.

    Parameters
    ----------
    paths
        Recordings and folders of recordings.
    loader
        Opens them for the chain that is tuned.
    labelled
        Whether they must have labels.
    left_out
        Recordings and folders of recordings to leave out.

    Returns
    -------
    tracks : list of Track
    notes : list of str
        A line for each recording with faults: bad samples, gaps and losses.

    Raises
    ------
    ValueError
        When a recording cannot be read or does not suit the chain; names it.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from slip_detector.parameters import ChainConfig, EvaluationConfig, RecordingConfig
    >>> loader = RecordingLoader(ChainConfig(), RecordingConfig(), EvaluationConfig())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     rows = {'volts': np.full((100, 16), 4.3), 'slip': np.zeros(100)}
    ...     np.savez(Path(folder) / 'rest.npz', sample_rate_hz=380.0, **rows)
    ...     tracks, notes = load_tracks([folder], loader)
    >>> [track.name for track in tracks], notes
    (['rest.npz'], [])
    """
    sets = recording_sets(paths)
    unwanted = {file.resolve() for files in recording_sets(left_out).values() for file in files}
    tracks, notes = [], []
    for name, files in sets.items():
        for file in files:
            if file.resolve() in unwanted:
                continue
            opened = loader.open(file, labelled)
            shown = f'{name}/{file.name}' if len(sets) > 1 else file.name
            tracks.append(track_of(shown, opened.rows, opened.sample_rate_hz))
            faults = _faults(opened.recording.counts)
            notes += [f'{shown}: {faults}'] if faults else []
    return tracks, notes


def _faults(counts: RecordingCounts) -> str:
    """Return a text on the faults of a recording; empty where there are none."""
    many = {
        'values that are not numbers': counts.bad_samples,
        'rows bridged': counts.bridged_rows,
        'long gaps': counts.stretches - 1,
        'rows dropped': counts.dropped,
    }
    parts = [f'{number} {what}' for what, number in many.items() if number > 0]
    return ', '.join([*parts, *filter(None, (counts.damage, counts.warnings))])


class TrainingFiles(NamedTuple):
    """The recordings to tune on, and which of them are held out.

    Attributes
    ----------
    paths : sequence of str
        Recordings and folders of recordings.
    loader : RecordingLoader
        Opens them.
    left_out : sequence of str
        Recordings and folders of recordings that are held out by name.
    share : float
        Share of the recordings to hold out where none are held out by name.
    """

    paths: Sequence[str]
    loader: RecordingLoader
    left_out: Sequence[str] = ()
    share: float = 1 / 3

    def load(self) -> tuple[list[Track], list[Track], list[str]]:
        """Read the files.

        Returns
        -------
        training, held : list of Track
            ``held`` is empty where recordings are held out by name.
        notes : list of str
            See :func:`load_tracks`.

        Raises
        ------
        ValueError
            When a recording cannot be read or there are too few slips; names the recordings.
        """
        tracks, notes = load_tracks(self.paths, self.loader, left_out=self.left_out)
        training, held = (tracks, []) if self.left_out else held_out(tracks, self.share)
        return training, held, notes

    def load_and_check(self) -> tuple[list[Track], list[Track], list[str]]:
        """Read the files and those that are held out by name.

        Raises
        ------
        ValueError
            As :meth:`load`; also when a held-out recording is tuned on under another name.
        """
        training, held, notes = self.load()
        if self.left_out:
            held, more_notes = load_tracks(self.left_out, self.loader)
            notes += more_notes
            for part, what in ((training, 'to tune on'), (held, 'held out')):
                if not any(track.slips for track in part):
                    names = ', '.join(track.name for track in part)
                    none = f'{names}: has no slip' if names else 'no recording is left'
                    raise ValueError(f'{none}, allowed: some with slips {what}')
        tuned_on = {fingerprint([track]): track.name for track in training}
        for track in held:
            same = tuned_on.get(fingerprint([track]))
            if same is not None:
                raise ValueError(
                    f'{track.name}: is held out and holds the same as {same}, which is tuned on, '
                    'allowed: each recording once'
                )
        return training, held, notes
