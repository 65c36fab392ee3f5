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

"""Records rest, slips and taps of the fingers, as the user of a page commands."""

import contextlib
import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from slip_detector.view.detectors import Detectors, Finger
from slip_detector.view.recorded_folder import (
    KINDS,
    NO_SLIP,
    RecordedFolder,
    Recorder,
    RecordingSummary,
)

#: Seconds of rest in the recording of a slip, before the key is pressed and after it is released.
#: If the chain has not settled in the rest before a slip, the slip is not scored.
BEFORE_S, AFTER_S = 2.0, 1.0

#: With fewer seconds of rest before a slip than this, the page shows a warning.
LEAST_BEFORE_S = 1.0

#: While the key is held, the page keeps reporting it. After so many seconds without a report the
#: page counts as gone, and the slip ends.
HELD_S = 2.0

#: After so many seconds without a sample the page shows a warning, and the recording of a slip
#: ends without waiting longer for the rest after it.
SILENT_S = 2.0

#: A recording ends by itself after so many seconds.
MOST_S = 600.0

#: Why a recording was ended without a request.
GONE = 'The detector is gone'
INTERRUPTED = (
    'The detector has other channels or another rate now, or the clock of the samples was set back'
)

#: Labels become folders: only what ROS allows in names is accepted.
_LABEL = re.compile('[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*')


class Teaching:
    """Makes and deletes the recordings of all fingers, one recording at a time.

    What pages send is not trusted: fingers and recordings are looked up by name, and no path is
    made of anything else.

    Parameters
    ----------
    detectors
        Those of the fingers.
    folder
        Where the recordings are: each finger has a folder in it, named by its label.

    Attributes
    ----------
    words : str
        What happened last, for the page.
    """

    def __init__(self, detectors: Detectors, folder: Path) -> None:
        self._detectors, self.folder = detectors, folder
        self._folders: dict[str, RecordedFolder] = {}
        self._recorder: Recorder | None = None
        self._begun_at_s = self._held_at_s = 0.0
        # The stamp, and the time of this computer, at which the recording of a slip ends.
        self._ends_ns: int | None = None
        self._ends_at_s = 0.0
        self.words = ''

    @property
    def finger(self) -> str:
        """Name of the finger that is recorded, or ''."""
        return self._recorder.finger.name if self._recorder else ''

    def finger_of(self, name: object) -> Finger:
        """Return a finger, by the name that a page has sent.

        Raises
        ------
        ValueError
            When there is no such finger.
        """
        finger = self._detectors.fingers.get(name) if isinstance(name, str) else None
        if finger is None:
            raise ValueError(f'there is no finger {str(name)[:40]!r}')
        return finger

    def folder_of(self, name: object) -> RecordedFolder:
        """Return the recordings of a finger, by the name that a page has sent.

        Raises
        ------
        ValueError
            When there is no such finger.
        """
        finger = self.finger_of(name)
        if finger.name not in self._folders:
            if not _LABEL.fullmatch(finger.label):
                raise ValueError(
                    f'{finger.label!r} is no name in ROS, allowed: letters, digits, _'
                )
            self._folders[finger.name] = RecordedFolder(self.folder / finger.label)
        return self._folders[finger.name]

    def start(self, name: object, kind: object) -> None:
        """Begin to record a finger at rest, or being tapped, until :meth:`stop`.

        Raises
        ------
        ValueError
            When a recording is under way already, or cannot be made.
        """
        if kind not in KINDS or kind == 'slip':
            raise ValueError(f'{str(kind)[:40]} is not recorded so, allowed: rest, taps')
        self._end_what_ends(name)
        finger = self.finger_of(name)
        recorder = self._begin(finger, str(kind), finger.track.samples.appended)
        self.words = f'recording {recorder.path.name}'

    def stop(self) -> None:
        """End the present recording, if any.

        Raises
        ------
        ValueError
            When its end cannot be written.
        """
        if self._recorder is not None:
            self._detectors.poll()
            self._guarded(self._recorder, self._recorder.write)
            self._end(self._recorder)

    def press(self, name: object) -> None:
        """Begin a slip: rows from now on are labelled as slip, until :meth:`release`.

        The recording begins with the rest before the slip.

        Raises
        ------
        ValueError
            When another recording is under way, or this one cannot be made.
        """
        if self._holds_slip(name):
            self.hold()
            return
        self._end_what_ends(name)
        finger = self.finger_of(name)
        self._detectors.poll()
        since, before_s = self._rest_before(finger)
        recorder = self._begin(finger, 'slip', since)
        self._guarded(recorder, lambda: recorder.label(True))
        self.hold()
        self.words = f'recording {recorder.path.name}: slip until the key is released'
        if before_s < LEAST_BEFORE_S:
            self.words += (
                f'. There are only {before_s:.1f} s of rest before it: wait for '
                f'{BEFORE_S:g} s between two slips'
            )

    def _rest_before(self, finger: Finger) -> tuple[int, float]:
        """Return the number of the first row of the rest up to now, and its length in seconds."""
        rows = finger.track.samples
        stamps_ns = rows.stamps_ns(since=finger.track.slip_ended)
        if not len(stamps_ns):
            return rows.appended, 0.0
        # By stamps rather than by rows, as samples may be missing.
        rest_ns = stamps_ns[stamps_ns >= stamps_ns[-1] - round(BEFORE_S * 1e9)]
        return rows.appended - len(rest_ns), (rest_ns[-1] - rest_ns[0]) * 1e-9

    def hold(self) -> None:
        """Note that the key is still held."""
        self._held_at_s = time.monotonic()

    def release(self, name: object) -> None:
        """End the slip of a finger; its recording goes on for some rest."""
        if self._recorder is not None and self._holds_slip(name):
            self._detectors.poll()
            self._let_go(self._recorder)

    def _holds_slip(self, name: object) -> bool:
        return self._recorder is not None and self._recorder.slipping and name == self.finger

    def tick(self) -> None:
        """Write new rows, and end a recording that is due to end; called after each poll.

        Errors are reported in ``words``.
        """
        if self._recorder is not None:
            with contextlib.suppress(ValueError):
                self._tick(self._recorder)

    def _tick(self, recorder: Recorder) -> None:
        now_s = time.monotonic()
        finger, rows = recorder.finger, recorder.finger.track.samples
        gone = self._detectors.fingers.get(finger.name) is not finger
        if gone or recorder.interrupted:
            self._end(recorder)
            self.words += f'. {GONE if gone else INTERRUPTED}'
            return
        self._guarded(recorder, recorder.write)
        if recorder.slipping and now_s - self._held_at_s > HELD_S:
            self._let_go(recorder)
            self.words = (
                f'{recorder.path.name}: the page that held the slip is gone, so the slip was ended'
            )
        elif self._ends_ns is not None:
            came = len(rows) and int(rows.stamps_ns()[-1]) >= self._ends_ns
            if came or now_s > self._ends_at_s:
                self._end(recorder)
        elif now_s - self._begun_at_s > MOST_S:
            self._end(recorder)
            self.words += f'. It was ended after {MOST_S / 60:.0f} minutes'

    def close(self) -> None:
        """End the present recording; called when the server ends."""
        with contextlib.suppress(ValueError):
            self.stop()

    def recording(self) -> dict[str, Any] | None:
        """Return the present recording, for the page; None if there is none."""
        recorder = self._recorder
        if recorder is None:
            return None
        silent = time.monotonic() - recorder.finger.sample_s > SILENT_S
        return {
            'finger': self.finger,
            'kind': recorder.kind,
            'name': recorder.path.name,
            'seconds': round(recorder.duration_s, 1),
            'slipping': recorder.slipping,
            'ending': self._ends_ns is not None,
            'silent': 'no samples come: nothing is recorded until they do' if silent else '',
        }

    def described(self) -> Mapping[str, Any]:
        """Return folder and recordings of each finger that a page has asked about."""
        writing = self._recorder.path if self._recorder else None
        return {
            name: {
                'folder': str(folder.folder),
                'recordings': [
                    {
                        **one._asdict(),
                        'duration_s': round(one.duration_s, 1),
                        'kind': one.kind,
                        'usable': one.usable,
                        'held_out': one.name in held_out,
                    }
                    for one in folder.recordings.values()
                    if folder.folder / one.name != writing
                ],
            }
            for name, folder in self._folders.items()
            for held_out in [set(folder.held_out())]
        }

    def delete(self, name: object, recording: object) -> None:
        """Delete a recording of a finger.

        Raises
        ------
        ValueError
            When there is no such recording, or it is being written.
        """
        folder = self.folder_of(name)
        if self._recorder is not None and folder.folder / str(recording) == self._recorder.path:
            raise ValueError(f'{recording}: is being recorded, allowed: once it has ended')
        folder.delete(recording)
        self.words = f'{recording} is deleted'

    def _begin(self, finger: Finger, kind: str, since: int) -> Recorder:
        self._recorder = Recorder(self.folder_of(finger.name).new_path(kind), finger, since)
        self._ends_ns, self._begun_at_s = None, time.monotonic()
        return self._recorder

    def _end_what_ends(self, name: object) -> None:
        """End a slip that only waits for the rest after it; refuse any other recording."""
        recorder = self._recorder
        if recorder is None:
            return
        if self._ends_ns is None or name != self.finger:
            raise ValueError(
                f'{recorder.path.name} of {recorder.finger.label} is being recorded: end it first'
            )
        self.stop()

    def _let_go(self, recorder: Recorder) -> None:
        self._guarded(recorder, lambda: recorder.label(False))
        track = recorder.finger.track
        track.slip_ended = track.samples.appended
        last_ns = int(track.samples.stamps_ns()[-1]) if len(track.samples) else 0
        self._ends_ns = last_ns + round(AFTER_S * 1e9)
        self._ends_at_s = time.monotonic() + AFTER_S + SILENT_S
        self.words = f'recording {recorder.path.name}: the rest after the slip'

    def _guarded(self, recorder: Recorder, write: Callable[[], None]) -> None:
        """Write; if that fails, end the recording and say what is kept."""
        try:
            write()
        except ValueError as error:
            self._list(recorder, f'was cut off: {error}')
            raise ValueError(self.words) from None

    def _end(self, recorder: Recorder) -> None:
        self._guarded(recorder, recorder.close)
        lost = recorder.lost_rows
        note = f'{lost} rows are missing: this computer was too slow' if lost else ''
        if recorder.kind == 'slip' and not recorder.slips:
            note = f'{NO_SLIP}: no sample came while the key was held'
        self._list(recorder, note)

    def _list(self, recorder: Recorder, note: str) -> None:
        """Note that the recording has ended, and list it with this note."""
        self._recorder, self._ends_ns = None, None
        name = recorder.path.name
        if not recorder.kept:
            self.words = f'{name}: no sample came, so there is no recording'
            if note:
                self.words = f'{name} {note}; nothing of it is left'
            return
        recorded = RecordingSummary(name, recorder.duration_s, recorder.slips, note)
        self._folders[recorder.finger.name].put(recorded)
        self.words = f'{name} has {recorded.duration_s:.1f} s'
        if note:
            self.words += f', which are kept; it {note}'
