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

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Floats, Ints, Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.matching import RowInterval
from slip_detector.evaluation.scores import SLIP, row_classes
from slip_detector.parameters import ChainConfig, name_list, refuse
from slip_detector.recordings import RecordingCounts, group_recordings

#: Share of the time of a single recording that is tuned on; the rest is held out.
TUNED_SHARE = 2 / 3


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """A labelled recording, or a part of one, in memory.

    Attributes
    ----------
    name : str
    samples : Samples
        All n rows, with their labels.
    stretches : tuple of RowInterval
        Rows without a gap, in order; the chain is reset before each.
    sample_rate_hz : float
        Rate of the recording, which turns rows into times.
    faults : str
        What is wrong with its file: bad samples, gaps and losses; empty if nothing is.

    Examples
    --------
    >>> rows = Samples.evenly(np.full((760, 16), 4.3), 380.0, truth=np.arange(760) >= 380)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> track.duration_s, track.stretches, track.slips
    (2.0, (RowInterval(start=0, end=760),), (RowInterval(start=380, end=760),))
    """

    name: str
    samples: Samples
    stretches: tuple[RowInterval, ...]
    sample_rate_hz: float
    faults: str = ''

    @functools.cached_property
    def row_classes(self) -> NDArray[np.int8]:
        """Class of each row, ``REST`` to ``UNCERTAIN``, see :mod:`.scores`; shape (n,)."""
        rows = self.samples
        return row_classes(np.asarray(rows.truth), rows.moving, rows.certain, rows.kind)

    @functools.cached_property
    def slips(self) -> tuple[RowInterval, ...]:
        """The true slips, each within a stretch."""
        parts = [(begin, self.samples.take(slice(begin, end))) for begin, end in self.stretches]
        edges = np.concatenate([begin + edges_of(part) for begin, part in parts])
        return tuple(RowInterval(*each) for each in edges.tolist())

    @property
    def kind(self) -> str:
        """The kind of a recording in which nothing slides; empty: none of them."""
        return self.samples.kind

    @property
    def volts(self) -> Floats:
        """Its rows of volts; shape (n, c)."""
        return self.samples.volts

    @property
    def duration_s(self) -> float:
        """Time of its rows, without gaps."""
        return len(self.volts) / self.sample_rate_hz

    @property
    def without_slip_s(self) -> float:
        """Time of its rows that certainly have no slip."""
        return float(np.count_nonzero(self.row_classes < SLIP)) / self.sample_rate_hz

    def rows(self, first: int = 0, last: int = sys.maxsize) -> Iterator[Samples]:
        """Yield its stretches, or of these the rows from one index up to another."""
        for begin, end in self.stretches:
            rows = slice(max(begin, first), min(end, last))
            yield self.samples.take(rows)._replace(new_stretch=True)


def track_of(name: str, pieces: Iterable[Samples], sample_rate_hz: float) -> Track:
    """Return a recording as a track.

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
    ends = [*itertools.accumulate(len(piece.volts) for piece in filled)]
    later = zip(ends[:-1], filled[1:], strict=True)
    cuts = [0, *(end for end, piece in later if piece.new_stretch), ends[-1]]
    stretches = tuple(itertools.starmap(RowInterval, itertools.pairwise(cuts)))
    return Track(name, filled[0].then(*filled[1:]), stretches, sample_rate_hz)


def at_rest(tracks: Sequence[Track]) -> Sequence[Track]:
    """Return the recordings whose rows without slip are rest; all where there are none."""
    return [track for track in tracks if track.kind in ('', 'rest')] or tracks


def drop_disabled(columns: Floats, chain: ChainConfig) -> Floats:
    """Return the columns of the channels that a chain has not disabled."""
    return np.delete(columns, [channel - 1 for channel in chain.disabled_channels], axis=1)


def edges_of(samples: Samples) -> Ints:
    """Return where each run of rows with slip begins and ends; shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.asarray(samples.truth), prepend=False, append=False))
    return edges.reshape(-1, 2)


def envelopes(chain: ChainConfig, track: Track, most_rows: int | None = None) -> Floats:
    """Return the envelope of the first rows of a recording, or of all; shape (n, c).

    It is NaN where a channel is not valid, and while the chain settles.
    """
    settling, runner = settling_rows(chain), SlipChain(chain)
    found = np.full(track.volts[:most_rows].shape, np.nan)
    for begin, end in track.stretches:
        part = found[begin:end]
        runner.reset()
        result = runner.update(track.volts[begin : begin + len(part)], level=False)
        part[settling:] = np.where(result.valid, result.envelope, np.nan)[settling:]
    return found


def hold_out_tracks(tracks: Sequence[Track]) -> tuple[list[Track], list[Track]]:
    """Divide recordings into those that are tuned on and those that are held out.

    Of several recordings with slip every third is held out, and likewise of each kind of those
    without slip; see :func:`hold_out`. A single one with slip is cut in two between two slips, as
    near to :data:`TUNED_SHARE` of its time as possible.

    Examples
    --------
    >>> rows = [Samples.evenly(np.zeros((4, 1)), 2.0, truth=[False, True, True, False])]
    >>> training, held = hold_out_tracks([track_of(name, rows, 2.0) for name in 'abc'])
    >>> [track.name for track in training], [track.name for track in held]
    (['a', 'c'], ['b'])
    """
    with_slip = [track for track in tracks if track.slips]
    training, held = hold_out(with_slip)
    if len(with_slip) == 1:
        starts, ends = edges_of(with_slip[0].samples).T
        cuts = (ends[:-1] + starts[1:]) // 2
        wanted = TUNED_SHARE * len(with_slip[0].volts)
        if cuts.size:
            training, held = _cut(with_slip[0], int(min(cuts, key=lambda cut: abs(cut - wanted))))
    quiet = [track for track in tracks if not track.slips]
    for kind in dict.fromkeys(track.kind for track in quiet):
        parts = hold_out([track for track in quiet if track.kind == kind])
        training, held = training + parts[0], held + parts[1]
    return training, held


def hold_out(items: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Divide items into those to tune on and those to hold out: every third from the second on.

    So a further item moves no other item to the other side.

    Examples
    --------
    >>> hold_out('abcde')
    (['a', 'c', 'd'], ['b', 'e'])
    """
    return [item for k, item in enumerate(items) if k % 3 != 1], [*items[1::3]]


def _cut(track: Track, row: int) -> tuple[list[Track], list[Track]]:
    """Return the part of a recording before a row, and that from there on."""
    rate_hz, at = track.sample_rate_hz, f'{row / track.sample_rate_hz:.1f} s'
    parts = (f'{track.name} to {at}', 0, row), (f'{track.name} from {at}', row, sys.maxsize)
    before, after = (track_of(name, track.rows(*rows), rate_hz) for name, *rows in parts)
    return [before], [after]


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
        The kind of all of them; empty: what each says itself.
    unusable
        Receives, by the reason, recordings that cannot be read or do not suit the chain. None:
        such a recording is an error.

    Raises
    ------
    ValueError
        When a recording cannot be read, does not suit the chain, does not exist, or has slips that
        recordings of its kind do not have; names it.
    """
    sets = group_recordings(paths)
    unwanted = {file.resolve() for files in group_recordings(left_out).values() for file in files}
    tracks = []
    for folder, files in sets.items():
        for file in (file for file in files if file.resolve() not in unwanted):
            name = f'{folder}/{file.name}' if len(sets) > 1 else file.name
            try:
                opened = loader.open(file, labelled)
                names = opened.recording.channel_names
                pieces = (
                    piece._replace(kind=kind or piece.kind, names=names) for piece in opened.rows
                )
                track = track_of(name, pieces, opened.sample_rate_hz)
                # A key was pressed, but not for slips.
                if track.samples.accuracy_s and not track.slips:
                    refuse(f'{file}: has no slip', 'one at least where labels are by hand')
            except ValueError as error:
                if unusable is None or not file.exists():
                    raise
                why = str(error).removeprefix(f'{file}: ')
                unusable.setdefault(why, []).append(str(file))
                continue
            if track.kind and track.slips:
                refuse(f'{file}: has slips', f'none in a recording of the kind {track.kind}')
            faults = _name_faults(opened.recording.counts)
            tracks.append(dataclasses.replace(track, faults=faults))
    return tracks


def faults_of(tracks: Iterable[Track]) -> list[str]:
    """Return a line for each recording with faults."""
    return [f'{track.name}: {track.faults}' for track in tracks if track.faults]


def _name_faults(counts: RecordingCounts) -> str:
    """Return a text on the faults of a recording; empty where there are none."""
    numbers = {
        'bad samples': counts.bad_samples,
        'rows bridged': counts.bridged_rows,
        'long gaps': counts.stretches - 1,
        'rows dropped': counts.dropped,
    }
    parts = [f'{number} {what}' for what, number in numbers.items() if number > 0]
    return ', '.join(filter(None, [*parts, counts.damage]))


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
        left_out = [f'Left out: {name_list(files, 3)}: {why}' for why, files in unusable.items()]
        notes = left_out + faults_of(training + held)
        if not self.left_out:
            training, held = hold_out_tracks(training)
        # Of a kind without a held-out recording the end of the last recording is held out.
        lacking = {track.kind for track in training} - {track.kind for track in held}
        for kind in sorted(lacking - {''}):
            last = max(k for k, track in enumerate(training) if track.kind == kind)
            row = round(TUNED_SHARE * len(training[last].volts))
            if 0 < row < len(training[last].volts):
                training[last : last + 1], end = _cut(training[last], row)
                held += end
        if not all(any(track.slips for track in part) for part in (training, held)):
            names = ', '.join(track.name for track in training + held) or 'no recording'
            what = 'some to tune on and others to hold out'
            refuse(f'{names}: too few slips', '. '.join([what, *left_out]))
        return training, held, notes
