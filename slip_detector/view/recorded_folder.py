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

"""The recordings made on the live page: a folder for each finger."""

import errno
import os
import re
import shutil
import threading
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters.files import write_errors_of
from slip_detector.recordings import open_recording
from slip_detector.recordings.bag_storage import METADATA
from slip_detector.recordings.bag_writer import BagWriter
from slip_detector.recordings.labels import labels_name
from slip_detector.tuning.tracks import hold_out_evenly
from slip_detector.view.detectors import Finger

#: Kinds of recordings. The name of a recording is its kind and a number.
KINDS = ('rest', 'slip', 'taps')
_NAME = re.compile(rf'({"|".join(KINDS)})_([1-9][0-9]{{0,8}})')

#: Note on a recording of kind ``slip`` that contains none.
NO_SLIP = 'has no slip'

#: Share of the recordings of each kind that is held out of the search.
HELD_OUT = 1 / 3


class RecordingSummary(NamedTuple):
    """A recording made on the live page.

    Attributes
    ----------
    name : str
    duration_s : float
        Time of its rows, without gaps.
    slips : int
    note : str
        What is wrong with it; empty if nothing is.

    Examples
    --------
    >>> taught = RecordingSummary('slip_1', duration_s=20.0, slips=0)
    >>> taught.kind, taught.usable
    ('slip', False)
    """

    name: str
    duration_s: float
    slips: int
    note: str = ''

    @property
    def kind(self) -> str:
        """One of :data:`KINDS`."""
        return self.name.partition('_')[0]

    @property
    def usable(self) -> bool:
        """Whether a search can use it: one of kind ``slip`` must contain a slip."""
        return self.duration_s > 0.0 and (self.kind != 'slip' or self.slips > 0)


class RecordedFolder:
    """The recordings of one finger, in a folder of their own.

    Parameters
    ----------
    folder
        The folder; it need not exist.

    Attributes
    ----------
    recordings : dict
        Each :class:`RecordingSummary` by its name; within a kind in the order of recording.

    Examples
    --------
    >>> RecordedFolder(Path('recordings/index')).path_of('../../etc')
    Traceback (most recent call last):
    ValueError: there is no recording '../../etc', allowed: those of the list
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.recordings: dict[str, RecordingSummary] = {}
        self._changing = threading.Lock()

    def look(self) -> None:
        """Update the list from the folder; recordings in the list are not read again.

        As this may take long, it may run in a thread while recordings are added or deleted.
        """
        names = [*filter(self._is_bag, self._names())]
        new = {name: self._read(name) for name in names if name not in self.recordings}
        with self._changing:
            # A recording that was put meanwhile may have been read above before it had ended.
            every = {**new, **self.recordings}
            self._list({name: one for name, one in every.items() if self._is_bag(name)})

    def new_path(self, kind: str) -> Path:
        """Return an unused path for a recording of this kind."""
        numbers = [_order(name)[1] for name in self._names() if name.startswith(f'{kind}_')]
        return self.folder / f'{kind}_{max(numbers, default=0) + 1}'

    def put(self, recorded: RecordingSummary) -> None:
        """Add a recording that has just been made, which need not be read."""
        with self._changing:
            self._list({**self.recordings, recorded.name: recorded})

    def path_of(self, name: object) -> Path:
        """Return the folder of a recording, by the name that a page has sent.

        Raises
        ------
        ValueError
            When no recording has this name.
        """
        # The folder may have been replaced by a link.
        if not isinstance(name, str) or name not in self.recordings or not self._is_bag(name):
            raise ValueError(
                f'there is no recording {str(name)[:40]!r}, allowed: those of the list'
            )
        return self.folder / name

    def delete(self, name: object) -> None:
        """Delete a recording with its labels, and no other file.

        Raises
        ------
        ValueError
            When no recording has this name, or it cannot be deleted.
        """
        path = self.path_of(name)
        own = {path / METADATA, path / f'{path.name}.mcap'}
        try:
            if {*path.iterdir()} - own:
                raise OSError(errno.ENOTEMPTY, 'there is something else in it')
            for file in (*own, path.parent / labels_name(path)):
                file.unlink(missing_ok=True)
            path.rmdir()
        except OSError as error:
            raise ValueError(f'{path}: cannot be deleted ({error.strerror})') from None
        with self._changing:
            self._list({n: one for n, one in self.recordings.items() if n != path.name})

    def of_kind(self, kind: str) -> list[str]:
        """Return the names of the usable recordings of a kind, the oldest first."""
        return [n for n, one in self.recordings.items() if one.kind == kind and one.usable]

    def held_out(self) -> list[str]:
        """Return the names of the recordings that are held out of a search and judge its result.

        They are every third one of each kind; of only two, the second.
        """
        by_kind = [hold_out_evenly(self.of_kind(kind), HELD_OUT)[1] for kind in KINDS]
        return [name for held_out in by_kind for name in held_out]

    def _list(self, every: dict[str, RecordingSummary]) -> None:
        self.recordings = {name: every[name] for name in sorted(every, key=_order)}

    def _names(self) -> list[str]:
        try:
            return [path.name for path in self.folder.iterdir() if _NAME.fullmatch(path.name)]
        except OSError:  # Nothing has been recorded yet.
            return []

    def _is_bag(self, name: str) -> bool:
        path = self.folder / name
        return not path.is_symlink() and (path / f'{name}.mcap').is_file()

    def _read(self, name: str) -> RecordingSummary:
        """Read how long a recording is, and how many slips it has."""
        rows = slips = 0
        slipping = False
        try:
            recording = open_recording(self.folder / name)
            for piece in recording.rows():
                rows += len(piece.stamps_ns)
                for slip in [] if piece.truth is None else piece.truth.tolist():
                    slips += slip and not slipping
                    slipping = slip
        except ValueError as error:
            return RecordingSummary(name, 0.0, 0, str(error))
        note = f'was not ended: {recording.counts.damage}' if recording.counts.damage else ''
        if not slips and name.startswith('slip_'):
            note = note or NO_SLIP
        return RecordingSummary(name, rows / recording.sample_rate_hz, slips, note)


def _order(name: str) -> tuple[int, int]:
    kind, _, number = name.partition('_')
    return KINDS.index(kind), int(number)


class Recorder:
    """A recording that grows with the track of a finger.

    Each call of :meth:`write` writes all rows that have arrived, with the present label: whatever
    happens to this process, the recording is complete up to the last call.

    Parameters
    ----------
    path
        The folder of the new bag.
    finger
        Whose samples are recorded.
    since
        Number of the first row to record, counted over all rows that the track ever had.

    Attributes
    ----------
    slipping : bool
        Whether the rows from now on are labelled as slip.
    slips : int
        Number of slips in the recording.
    rows : int
        Number of rows in the recording.
    lost_rows : int
        Number of rows that the track no longer had when they were to be written.

    Raises
    ------
    ValueError
        When the bag cannot be created; names it.
    """

    def __init__(self, path: Path, finger: Finger, since: int) -> None:
        self.path, self.finger = path, finger
        self._beginnings = finger.track.beginnings
        self._taken = since
        self.slipping = self._slipped = False
        self._rate_hz = finger.config.sample_rate_hz
        self.slips = self.rows = self.lost_rows = 0
        with write_errors_of(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                self._bag = BagWriter(path, finger.config.names, finger.frame_id or 'fingertip')
            except FileExistsError:  # Another program has just created it.
                raise
            except OSError:
                shutil.rmtree(path, ignore_errors=True)  # It is empty.
                raise

    @property
    def kind(self) -> str:
        """One of :data:`KINDS`."""
        return self.path.name.partition('_')[0]

    @property
    def duration_s(self) -> float:
        """Length of the recording so far, without gaps."""
        return self.rows / self._rate_hz

    @property
    def interrupted(self) -> bool:
        """Whether the track was begun again, so that new rows do not belong to this recording."""
        return self.finger.track.beginnings != self._beginnings

    @property
    def kept(self) -> bool:
        """Whether there is a file with rows, which another program may have removed."""
        return self.rows > 0 and self._bag.path.exists()

    def write(self) -> None:
        """Write the rows that have arrived, with the present label.

        Raises
        ------
        ValueError
            When they cannot be written: the disk is full or the file was removed, for example.
            What was written before is kept.
        """
        if self.interrupted:
            return
        rows = self.finger.track.samples
        stamps_ns = rows.stamps_ns(since=self._taken)
        self.lost_rows += rows.appended - self._taken - len(stamps_ns)
        if not len(stamps_ns):
            return
        slip = np.full(len(stamps_ns), self.slipping)
        with write_errors_of(self.path):
            try:
                volts = rows.field('volts', since=self._taken).astype(np.float64)
                self._bag.write(Samples(volts, stamps_ns, slip))
                self._bag.flush()
                if not self._bag.path.exists():
                    raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
            except OSError:
                self._abort()
                raise
        self._taken = rows.appended
        self.rows += len(stamps_ns)
        # A slip during which no row came is not in the file.
        self.slips += self.slipping and not self._slipped
        self._slipped = self.slipping

    def label(self, slipping: bool) -> None:
        """Set whether the rows from now on are labelled as slip."""
        self.write()
        self.slipping = slipping

    def close(self) -> None:
        """End the recording; one without rows is removed.

        Raises
        ------
        ValueError
            When its end cannot be written; what was written before is kept.
        """
        if not self.rows:
            self._abort()
            return
        with write_errors_of(self.path):
            self._bag.close()

    def _abort(self) -> None:
        """Close the file as it is, and remove it if it has no rows."""
        self._bag.abort()
        if not self.rows:
            shutil.rmtree(self.path, ignore_errors=True)
