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


"""Records rest, slips, taps and presses of the fingers, and tunes on them, as a page requests."""

import asyncio
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.parameters import quote, refuse
from slip_detector.view.detectors import Finger
from slip_detector.view.hand_labels import HandLabels
from slip_detector.view.recordings import KINDS, RecordedFolder, Recorder, RecordingSummary
from slip_detector.view.server import Server
from slip_detector.view.tuning import TuneRun, was_interrupted

#: Seconds of rest in the recording of a slip, before the key is pressed and after it is released.
#: If the chain has not settled in the rest before a slip, the slip is not scored.
BEFORE_S, AFTER_S = 2.0, 2.0

#: While the key is pressed, the page keeps reporting it. After so many seconds without a report
#: the page counts as gone, and the slip ends.
PRESSED_S = 2.0

#: After so many seconds without a sample the page shows a warning.
SILENT_S = 2.0

#: A recording ends by itself after so many seconds.
MOST_S = 600.0

#: Why a recording was ended without a request.
GONE = 'The detector is gone, has other channels or another rate, or its clock was set back'


class Teaching:
    """Makes and deletes recordings, one at a time, and tunes on them, as the pages request.

    What pages send is not trusted: fingers and recordings are looked up by name, and no path is
    made of anything else. A ValueError says what cannot be done.
    """

    def __init__(self, server: Server, folder: Path) -> None:
        self._server, self._detectors, self._folder = server, server.detectors, folder.resolve()
        self._folders: dict[str, RecordedFolder] = {}
        self._recorder: Recorder | None = None
        #: What happened last, for the page.
        self.words = ''
        self._run: TuneRun | None = None
        self._tuning: asyncio.Task[None] | None = None
        server.each_tick.append(self.tick)
        server.at_end.append(self.close)
        server.on_requests(self, 'recordings', 'trace')
        made = 'record', 'stop_recording', 'begin_slip', 'hold_slip', 'end_slip'
        changed = 'label', 'snap', 'undo_label', 'delete_recording', 'mark_recording'
        tuned = 'tune', 'stop_tuning', 'apply_tuning'
        server.on_requests(self, *made, *changed, *tuned, changes=True)

    async def close(self) -> None:
        """End the recording and the tuning."""
        await self.answer_stop_recording()
        if self._tuning is not None and not self._tuning.done():
            self._tuning.cancel()
            await asyncio.gather(self._tuning, return_exceptions=True)

    def tick(self) -> None:
        """Write new rows, end what is due to end, and report; called after each poll."""
        if self._recorder is not None:
            self._continue(self._recorder)
        recorder, tuning = self._recorder, self._run and self._run.describe()
        self._server.wanted['recording'] = {recorder.finger.name} if recorder else set()
        self._server.broadcast('recording', {'recording': recorder and self._state(recorder)})
        fingers = {
            name: {**folder.describe(), 'obeys': self._detectors.order(name)}
            for name, folder in self._folders.items()
        }
        content = {'fingers': fingers, 'words': self.words, 'tuning': tuning}
        self._server.broadcast('teaching', content)

    def folder_of(self, finger: Finger) -> RecordedFolder:
        """Return the recordings of a finger."""
        new = RecordedFolder(self._folder / finger.label)
        folder = self._folders.setdefault(finger.name, new)
        folder.sample_rate_hz = finger.config.sample_rate_hz
        return folder

    # The recording that is made.

    async def answer_record(self, finger: Finger, kind: str) -> None:
        """Begin to record a finger at rest, being tapped or pressed, until that is stopped."""
        if kind not in KINDS or kind == 'slip':
            refuse(f'kind is {quote(kind)}', 'rest, taps, press')
        self._make_free(finger)
        self._begin(finger, kind, finger.track.samples.appended)

    async def answer_stop_recording(self) -> None:
        """End the present recording, if any."""
        if self._recorder is not None:
            self._detectors.poll()
            self._end(self._recorder)

    async def answer_begin_slip(self, finger: Finger) -> None:
        """Label rows from now on as slip, while the key is held.

        The recording begins with the rest before the slip.
        """
        if self._slip_of(finger):
            return
        self._make_free(finger)
        self._detectors.poll()
        track, row = finger.track, finger.track.slip_ended
        # By stamps rather than by rows, as samples may be missing.
        stamps_ns = track.samples.stamps_ns(row)
        rest_ns = stamps_ns[stamps_ns >= stamps_ns[-1:] - round(BEFORE_S * 1e9)]
        self._begin(finger, 'slip', track.samples.appended - len(rest_ns)).label(True)
        before_s = np.ptp(rest_ns) * 1e-9 if len(rest_ns) else 0.0
        rest = f'{before_s:.1f} s of rest before: wait for {BEFORE_S:g} s between two slips'
        self.words += f': slip until the key is released. It has {rest}'

    async def answer_hold_slip(self) -> None:
        """Note that the key is still held."""
        if self._recorder is not None:
            self._recorder.held_s = time.monotonic()

    async def answer_end_slip(self, finger: Finger) -> None:
        """End the slip of a finger; its recording goes on for some rest."""
        if recorder := self._slip_of(finger):
            self._detectors.poll()
            self._end_slip(recorder)

    def _slip_of(self, finger: Finger) -> Recorder | None:
        """Return what records a slip of the finger now."""
        recorder = self._recorder
        slips = recorder is not None and recorder.slipping and recorder.finger is finger
        return recorder if slips else None

    def _continue(self, recorder: Recorder) -> None:
        now_s, finger = time.monotonic(), recorder.finger
        recorder.write()
        if recorder.failure:
            self._end(recorder)
        elif recorder.interrupted or self._detectors.fingers.get(finger.name) is not finger:
            self._end(recorder, GONE)
        elif recorder.slipping and now_s - recorder.held_s > PRESSED_S:
            self._end_slip(recorder)
            self.words = f'{recorder.path.name}: the page that held the slip is gone, so it ended'
        elif (finger.track.samples.stamps_ns()[-1:] >= recorder.ends_ns).any():
            self._end(recorder)
        elif now_s - recorder.begun_s > MOST_S:
            self._end(recorder, f'It was ended after {MOST_S / 60:.0f} minutes')

    def _state(self, recorder: Recorder) -> dict[str, Any]:
        """Return the present recording, for the page."""
        finger, ending = recorder.finger, recorder.ends_ns < math.inf
        words = f'{recorder.path.name} of {finger.label}: {recorder.duration_s:.1f} s'
        after = ', the rest after it: hold still' if ending else ''
        words += ', SLIP' if recorder.slipping else after
        if time.monotonic() - finger.sample_s > SILENT_S:
            words += '. No samples come: nothing is recorded until they do'
        state = {'slipping': recorder.slipping, 'ending': ending, 'words': words}
        return {'finger': finger.name, 'kind': recorder.kind, **state}

    def _make_free(self, finger: Finger) -> None:
        """End a slip of the finger that only waits for the rest after it; refuse all else."""
        recorder = self._recorder
        if finger.name in self._detectors.gone:
            raise ValueError(f'{finger.label} has no detector that runs')
        if recorder is not None:
            if recorder.ends_ns == math.inf or recorder.finger is not finger:
                present = f'{recorder.path.name} of {recorder.finger.label}'
                raise ValueError(f'{present} is being recorded: end it first')
            self._detectors.poll()
            self._end(recorder)

    def _begin(self, finger: Finger, kind: str, since: int) -> Recorder:
        folder = self.folder_of(finger)
        self._recorder = recorder = Recorder(folder.new_path(kind), finger, since)
        folder.writing = recorder.path.name
        self._detectors.order(finger.name, kind)
        self.words = f'recording {recorder.path.name}'
        return recorder

    def _end_slip(self, recorder: Recorder) -> None:
        recorder.label(False)
        self._detectors.order(recorder.finger.name, 'rest')
        track = recorder.finger.track
        track.slip_ended = track.samples.appended
        last_ns = max(track.samples.stamps_ns()[-1:], default=0)
        recorder.ends_ns = int(last_ns) + round(AFTER_S * 1e9)
        self.words = f'recording {recorder.path.name}: the rest after the slip'

    def _end(self, recorder: Recorder, why: str = '') -> None:
        """End the recording, list it, and say why it ended if nobody asked for that."""
        recorder.close()
        self._detectors.order(recorder.finger.name, 'rest')
        self._recorder = None
        name, note, folder = recorder.path.name, recorder.note, self._folders[recorder.finger.name]
        folder.writing = ''
        words = [f'{name} has no sample, so it is not kept', note and f'It {note}', why]
        if recorder.rows:
            duration_s = recorder.duration_s
            folder.add(RecordingSummary(name, duration_s, int(recorder.has_slip), note))
            words[0] = f'{name} has {duration_s:.1f} s'
            if off_rate := folder.off_rate(name):
                words.append(f'It {off_rate}, so it is not tuned on: record it again')
        self.words = '. '.join(filter(None, words))

    # The recordings that there are.

    async def answer_recordings(self, finger: Finger) -> None:
        """Update the list of a finger's recordings."""
        folder = self.folder_of(finger)
        await folder.refresh(self._server.work)
        folder.interrupted = self._run is None and was_interrupted(folder.folder, finger.config)

    async def answer_trace(self, finger: Finger, recording: str) -> dict[str, Any]:
        """Return what the detector as it is would decide in a recording."""
        folder = self.folder_of(finger)
        return await self._server.work(folder.trace, recording, finger.config)

    async def answer_label(self, finger: Finger, recording: str, slip_s: Any, pixel_s: Any) -> Any:
        """Take all labels as a page has them."""
        change = self.folder_of(finger).change_labels
        by_s = pixel_s or 0.0
        return await self._server.work(change, recording, HandLabels.change, slip_s, by_s)

    async def answer_snap(self, finger: Finger, recording: str) -> Any:
        """Move the ends of the labels to where the signal changes."""
        change = self.folder_of(finger).change_labels
        return await self._server.work(change, recording, HandLabels.snap)

    async def answer_undo_label(self, finger: Finger, recording: str) -> Any:
        """Take back the last change of the labels."""
        change = self.folder_of(finger).change_labels
        return await self._server.work(change, recording, HandLabels.undo)

    async def answer_delete_recording(self, finger: Finger, recording: str) -> None:
        """Delete a recording."""
        self._to_change(finger).delete(recording)
        self.words = f'{recording} is deleted'

    async def answer_mark_recording(self, finger: Finger, recording: str, mistaken: bool) -> None:
        """Mark the labels of a recording as a mistake, or take that back."""
        await self._server.work(self._to_change(finger).mark, recording, bool(mistaken))
        self.words = f'{recording} {"is marked as a mistake" if mistaken else "counts again"}'

    def _to_change(self, finger: Finger) -> RecordedFolder:
        """Return the folder of a finger, which no search reads now."""
        if self._run is not None and self._run.running:
            raise ValueError('recordings are being tuned on, allowed: to change one afterwards')
        return self.folder_of(finger)

    # The search on them.

    async def answer_tune(self, finger: Finger) -> None:
        """Begin to search on the recordings of a finger."""
        if self._run is not None and self._run.running:
            raise ValueError('tuning runs already, allowed: one at a time')
        folder = self.folder_of(finger)
        self.words, folder.interrupted = '', False
        self._run = TuneRun(folder, finger.name, finger.config)
        self._tuning = asyncio.create_task(self._run.run())

    async def answer_stop_tuning(self) -> None:
        """End the search; the best that it has found is kept."""
        if self._run is not None:
            self._run.stop()

    async def answer_apply_tuning(self, page: str) -> None:
        """Set the parameters that were found, all or none."""
        if self._run is None or self._run.found is None:
            raise ValueError('there is nothing to apply: tune first')
        finger = self._detectors.finger_of(self._run.finger)
        values = self._run.to_apply(finger.config)
        await self._server.change(finger, values, page)
        self.words = f'the detector runs with what was found: {len(values)} values set'
