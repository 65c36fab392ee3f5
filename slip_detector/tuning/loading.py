"""Recordings read into the memory for a search, here or in another process."""

from collections.abc import Sequence
from typing import NamedTuple

from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.recordings import RecordingCounts, recording_sets
from slip_detector.tuning.tracks import Track, held_out, track_of


def load_tracks(
    paths: Sequence[str],
    loader: RecordingLoader,
    labelled: bool = True,
    but: Sequence[str] = (),
) -> tuple[list[Track], list[str]]:
    """Read recordings, or folders of them, into the memory.

    Parameters
    ----------
    paths
        As they were given.
    loader
        Opens them for the chain that is tuned.
    labelled
        Whether they must have labels.
    but
        Recordings, or folders of them, that are left out where they are among those.

    Returns
    -------
    tracks : list of Track
    notes : list of str
        A line for each recording that is not as it should be: what is missing, bad or lost.

    Raises
    ------
    ValueError
        When one cannot be read or does not suit the chain; names it.
    """
    sets = recording_sets(paths)
    left_out = {file.resolve() for files in recording_sets(but).values() for file in files}
    tracks, notes = [], []
    for name, files in sets.items():
        for file in files:
            if file.resolve() in left_out:
                continue
            opened = loader.open(file, labelled)
            shown = f'{name}/{file.name}' if len(sets) > 1 else file.name
            tracks.append(track_of(shown, opened.rows, opened.sample_rate_hz))
            faults = _faults(opened.recording.counts)
            notes += [f'{shown}: {faults}'] if faults else []
    return tracks, notes


def _faults(counts: RecordingCounts) -> str:
    """Say what was wrong with a recording; empty when nothing was."""
    many = {
        'values that are no number': counts.bad_samples,
        'rows bridged': counts.bridged_rows,
        'long gaps': counts.stretches - 1,
        'rows dropped': counts.dropped,
    }
    parts = [f'{number} {what}' for what, number in many.items() if number > 0]
    return ', '.join(parts + ([counts.lost] if counts.lost else []))


class TrainingFiles(NamedTuple):
    """The recordings that are tuned on, by their paths.

    Attributes
    ----------
    paths : sequence of str
        Recordings, or folders of them.
    loader : RecordingLoader
        Opens them.
    left_out : sequence of str
        Those of them that are held out by name.
    share : float or None
        Of the recordings to hold out; None: only those that are left out by name are.
    """

    paths: Sequence[str]
    loader: RecordingLoader
    left_out: Sequence[str] = ()
    share: float | None = None

    def load(self) -> tuple[list[Track], list[Track], list[str]]:
        """Read them.

        Returns
        -------
        training, held : list of Track
            The second is empty where they are held out by name.
        notes : list of str
            See :func:`load_tracks`.

        Raises
        ------
        ValueError
            When one cannot be read or they have not slips enough; names it.
        """
        tracks, notes = load_tracks(self.paths, self.loader, but=self.left_out)
        training, held = (tracks, []) if self.share is None else held_out(tracks, self.share)
        return training, held, notes
