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

"""Reads recordings into memory for a search, in this process or in another."""

from collections.abc import Sequence
from typing import NamedTuple

from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.recordings import RecordingCounts, recording_sets
from slip_detector.tuning.tracks import Track, held_out, track_of


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
    return ', '.join([*parts, *filter(None, (counts.lost, counts.doubts))])


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
    share : float or None
        Share of the recordings to hold out; None where they are held out by name.
    """

    paths: Sequence[str]
    loader: RecordingLoader
    left_out: Sequence[str] = ()
    share: float | None = None

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
        training, held = (tracks, []) if self.share is None else held_out(tracks, self.share)
        return training, held, notes
