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


"""Writes the samples of a finger into a bag as they arrive."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters.files import write_errors_of
from slip_detector.recordings.bag_writer import BagWriter
from slip_detector.view.hand import Finger


class Recorder:
    """A recording that grows with the track of a finger.

    Each call of :meth:`take` writes all rows that have arrived, with the present label: whatever
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
        self._slipping = self._slipped = False
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

    def take(self) -> None:
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
        slip = np.full(len(stamps_ns), self._slipping)
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
        self.slips += self._slipping and not self._slipped
        self._slipped = self._slipping

    def label(self, slipping: bool) -> None:
        """Set whether the rows from now on are labelled as slip."""
        self.take()
        self._slipping = slipping

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
