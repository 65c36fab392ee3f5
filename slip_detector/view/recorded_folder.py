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
import re
import threading
from pathlib import Path
from typing import NamedTuple

from slip_detector.recordings import open_recording
from slip_detector.recordings.bag_storage import METADATA
from slip_detector.recordings.labels import labels_name
from slip_detector.tuning.tracks import hold_out_evenly

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
        note = f'was not ended: {recording.counts.lost}' if recording.counts.lost else ''
        if not slips and name.startswith('slip_'):
            note = note or NO_SLIP
        return RecordingSummary(name, rows / recording.sample_rate_hz, slips, note)


def _order(name: str) -> tuple[int, int]:
    kind, _, number = name.partition('_')
    return KINDS.index(kind), int(number)
