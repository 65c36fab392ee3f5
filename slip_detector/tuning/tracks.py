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

import dataclasses
import functools
import itertools
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Floats, Ints, Samples
from slip_detector.chain.stamps import missing_rows
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.matching import OnIntervals, RowInterval
from slip_detector.evaluation.scores import row_classes
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.fields import name_list, refuse
from slip_detector.recordings import RecordingCounts, recording_sets

#: Share of the time of a single recording that is tuned on; the rest is held out.
TUNED_SHARE = 2 / 3


class Stretch(NamedTuple):
    """Rows of a track without a gap, before which the chain is reset.

    Attributes
    ----------
    begin, end : int
        Indices of the first row and of the row after the last in the track's arrays.
    first_row : int
        Number of the first row in the recording, including the rows that are missing in gaps.

    Examples
    --------
    >>> Stretch(begin=380, end=760, first_row=400).interval  # after a gap of 20 rows
    RowInterval(start=400, end=780)
    """

    begin: int
    end: int
    first_row: int

    @property
    def interval(self) -> RowInterval:
        """Its rows, numbered like ``first_row``."""
        return RowInterval(self.first_row, self.first_row + self.end - self.begin)


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """A labelled recording, or a part of one, in memory.

    Attributes
    ----------
    name : str
    samples : Samples
        All n rows, with their labels.
    stretches : tuple of Stretch
    sample_rate_hz : float
        Rate of the recording, which turns rows into times.
    slips : tuple of RowInterval
        True slips, in rows that are numbered like ``first_row`` of a stretch.
    faults : str
        What is wrong with its file: bad samples, gaps and losses; empty if nothing is.
    channel_names : tuple of str
        Those of its file; empty: unknown.
    kinds : ndarray of int8, shape (n,)
        ``REST`` to ``UNCERTAIN``; see :mod:`slip_detector.evaluation.scores`.

    Examples
    --------
    >>> rows = Samples.evenly(np.full((760, 16), 4.3), 380.0, truth=np.arange(760) >= 380)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> track.duration_s, track.stretches, track.slips
    (2.0, (Stretch(begin=0, end=760, first_row=0),), (RowInterval(start=380, end=760),))
    """

    name: str
    samples: Samples
    stretches: tuple[Stretch, ...]
    sample_rate_hz: float
    faults: str = ''
    channel_names: tuple[str, ...] = ()

    @functools.cached_property
    def kinds(self) -> NDArray[np.int8]:
        """See above."""
        rows = self.samples
        return row_classes(np.asarray(rows.truth), rows.moving, rows.certain, rows.kind)

    @functools.cached_property
    def slips(self) -> tuple[RowInterval, ...]:
        """See above."""
        labels, truth = OnIntervals(), np.asarray(self.samples.truth)
        for stretch in self.stretches:
            labels.add(truth[stretch.begin : stretch.end], stretch.first_row)
            labels.close(stretch.interval.end)
        return tuple(labels.closed())

    @property
    def kind(self) -> str:
        """The kind of a recording in which nothing slides; '': none of them."""
        return self.samples.kind

    @property
    def volts(self) -> Floats:
        """Its rows of volts; shape (n, c)."""
        return self.samples.volts

    @property
    def duration_s(self) -> float:
        """Time of its rows, without gaps."""
        return len(self.volts) / self.sample_rate_hz

    def rows(self, first: int = 0, last: int = sys.maxsize) -> Iterator[Samples]:
        """Yield its stretches, or of these the rows from one index up to another."""
        for begin, end, _ in self.stretches:
            rows = slice(max(begin, first), min(end, last))
            yield self.samples.take(rows)._replace(new_stretch=True)


def track_of(name: str, pieces: Iterable[Samples], sample_rate_hz: float) -> Track:
    """Read a recording into memory.

    Parameters
    ----------
    name
        The name of the recording in errors and reports.
    pieces
        The whole recording with its labels, in pieces of any length.
    sample_rate_hz
        Rate of the recording.

    Raises
    ------
    ValueError
        When the recording has no rows; names it.

    Examples
    --------
    >>> rows = Samples.evenly(np.zeros((4, 1)), 2.0, truth=[False, True, True, False])
    >>> track_of('trial', [rows], sample_rate_hz=2.0).slips
    (RowInterval(start=1, end=3),)
    """
    filled = [piece for piece in pieces if len(piece.volts)]
    if not filled:
        raise ValueError(f'{name}: has no samples')
    samples = filled[0].then(*filled[1:])
    ends = itertools.accumulate(len(piece.volts) for piece in filled)
    later = itertools.zip_longest(ends, filled[1:])
    places = [0, *(end for end, piece in later if piece is None or piece.new_stretch)]
    stretches, missing = [], 0
    for begin, end in itertools.pairwise(places):
        if begin:
            last_ns, stamp_ns = samples.stamps_ns[begin - 1 : begin + 1].tolist()
            missing += missing_rows(last_ns, stamp_ns, sample_rate_hz)
        stretches.append(Stretch(begin, end, begin + missing))
    return Track(name, samples, tuple(stretches), sample_rate_hz)


def at_rest(tracks: Sequence[Track]) -> Sequence[Track]:
    """Return the recordings whose rows without slip are rest; all where there are none."""
    return [track for track in tracks if track.kind in ('', 'rest')] or tracks


def enabled(columns: Floats, chain: ChainConfig) -> Floats:
    """Return the columns of the channels that a chain has not disabled."""
    return np.delete(columns, [channel - 1 for channel in chain.disabled_channels], axis=1)


def edges_of(samples: Samples) -> Ints:
    """Return where each run of rows with slip begins and ends; shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.asarray(samples.truth), prepend=False, append=False))
    return edges.reshape(-1, 2)


def held_out(tracks: Sequence[Track]) -> tuple[list[Track], list[Track]]:
    """Divide recordings into those that are tuned on and those that are held out.

    Of several recordings with slip every third is held out, and likewise of each kind of those
    without slip; see :func:`hold_out`. A single one with slip is cut in two between two slips, as
    near to :data:`TUNED_SHARE` of its time as possible.

    Parameters
    ----------
    tracks
        The recordings in their order.

    Examples
    --------
    >>> rows = [Samples.evenly(np.zeros((4, 1)), 2.0, truth=[False, True, True, False])]
    >>> training, held = held_out([track_of(name, rows, 2.0) for name in 'abc'])
    >>> [track.name for track in training], [track.name for track in held]
    (['a', 'c'], ['b'])
    """
    with_slip = [track for track in tracks if track.slips]
    divide = _cut_in_two if len(with_slip) == 1 else hold_out
    training, held = divide(with_slip)
    quiet = [track for track in tracks if not track.slips]
    for kind in dict.fromkeys(track.kind for track in quiet):
        parts = hold_out([track for track in quiet if track.kind == kind])
        training, held = training + parts[0], held + parts[1]
    return training, held


def hold_out(items: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Divide items into those to tune on and those to hold out: every third from the second on.

    So one more moves no other to the other side.

    Examples
    --------
    >>> hold_out('abcde')
    (['a', 'c', 'd'], ['b', 'e'])
    """
    return [item for k, item in enumerate(items) if k % 3 != 1], [*items[1::3]]


def _cut_in_two(tracks: Sequence[Track]) -> tuple[list[Track], list[Track]]:
    """Cut the one recording between two slips; the later part is held out."""
    (track,) = tracks
    starts, ends = edges_of(track.samples).T
    cuts = (ends[:-1] + starts[1:]) // 2
    if not cuts.size:
        return [track], []
    wanted = TUNED_SHARE * len(track.volts)
    training, held = _parted(track, int(min(cuts, key=lambda cut: abs(cut - wanted))))
    return [training], [held]


def _parted(track: Track, cut: int) -> tuple[Track, Track]:
    """Return the rows of a recording before a place, and those from there on."""
    rate_hz, at = track.sample_rate_hz, f'{cut / track.sample_rate_hz:.1f} s'
    return (
        track_of(f'{track.name} to {at}', track.rows(0, cut), rate_hz),
        track_of(f'{track.name} from {at}', track.rows(cut), rate_hz),
    )


def load_tracks(
    paths: Sequence[str],
    loader: RecordingLoader,
    labelled: bool = True,
    left_out: Sequence[str] = (),
    kind: str = '',
    unusable: dict[str, list[str]] | None = None,
) -> list[Track]:
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
    kind
        The kind of all of them; '': what each says itself.
    unusable
        By why, recordings that cannot be read or do not suit the chain: they are left out, and
        added to this. None: such a recording is an error.

    Raises
    ------
    ValueError
        When a recording cannot be read, does not suit the chain, does not exist, or has slips that
        recordings of its kind do not have; names it.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     rows = {'volts': np.full((100, 16), 4.3), 'slip': np.zeros(100)}
    ...     np.savez(Path(folder) / 'rest.npz', sample_rate_hz=380.0, **rows)
    ...     tracks = load_tracks([folder], RecordingLoader())
    >>> [track.name for track in tracks]
    ['rest.npz']
    """
    sets = recording_sets(paths)
    unwanted = {file.resolve() for files in recording_sets(left_out).values() for file in files}
    tracks = []
    for name, files in sets.items():
        for file in (file for file in files if file.resolve() not in unwanted):
            shown = f'{name}/{file.name}' if len(sets) > 1 else file.name
            try:
                opened = loader.open(file, labelled)
                rows = (one._replace(kind=kind or one.kind) for one in opened.rows)
                track = track_of(shown, rows, opened.sample_rate_hz)
                if track.samples.accuracy_s and not track.slips:  # What a key was for is unknown.
                    refuse(f'{file}: has no slip', 'one at least where labels are by hand')
            except ValueError as error:
                if unusable is None or not file.exists():
                    raise
                why = str(error).removeprefix(f'{file}: ')
                unusable.setdefault(why, []).append(str(file))
                continue
            if track.kind and track.slips:
                refuse(f'{file}: has slips', f'none in a recording of the kind {track.kind}')
            faults, names = _faults(opened.recording.counts), opened.recording.channel_names
            tracks.append(dataclasses.replace(track, faults=faults, channel_names=names))
    return tracks


def faults_of(tracks: Iterable[Track]) -> list[str]:
    """Return a line for each recording with faults."""
    return [f'{track.name}: {track.faults}' for track in tracks if track.faults]


def _faults(counts: RecordingCounts) -> str:
    """Return a text on the faults of a recording; empty where there are none."""
    many = {
        'bad samples': counts.bad_samples,
        'rows bridged': counts.bridged_rows,
        'long gaps': counts.stretches - 1,
        'rows dropped': counts.dropped,
    }
    parts = [f'{number} {what}' for what, number in many.items() if number > 0]
    return ', '.join(filter(None, [*parts, counts.damage, counts.doubts]))


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
    of_kinds : sequence of (str, str)
        Kind and path of more recordings, which need no labels.
    """

    paths: Sequence[str]
    loader: RecordingLoader
    left_out: Sequence[str] = ()
    of_kinds: Sequence[tuple[str, str]] = ()

    def load(self) -> tuple[list[Track], list[Track], list[str]]:
        """Read the files.

        Returns
        -------
        training, held : list of Track
            The recordings to tune on and those that are held out; both have slips.
        notes : list of str
            Why recordings are left out that cannot be used, and see :func:`faults_of`.

        Raises
        ------
        ValueError
            When there are no recordings, or too few slips; names them and what is left out.
        """
        unusable: dict[str, list[str]] = {}
        load = functools.partial(load_tracks, loader=self.loader, unusable=unusable)
        named = [*self.left_out, *(path for _, path in self.of_kinds)]
        training = load(self.paths, left_out=named)
        for kind, path in self.of_kinds:
            training += load([path], labelled=False, kind=kind)
        held = load(self.left_out)
        left_out = [f'Left out: {name_list(of, 3)}: {why}' for why, of in unusable.items()]
        notes = left_out + faults_of(training + held)
        if not self.left_out:
            training, held = held_out(training)
        # Of a kind that is not held out the end of the last recording is.
        for kind in sorted({one.kind for one in training} - {'', *(one.kind for one in held)}):
            last = max(k for k, track in enumerate(training) if track.kind == kind)
            cut = round(TUNED_SHARE * len(training[last].volts))
            if 0 < cut < len(training[last].volts):
                training[last], part = _parted(training[last], cut)
                held.append(part)
        if not all(any(track.slips for track in part) for part in (training, held)):
            names = ', '.join(track.name for track in training + held) or 'no recording'
            what = 'some to tune on and others to hold out'
            refuse(f'{names}: too few slips', '. '.join([what, *left_out]))
        return training, held, notes
