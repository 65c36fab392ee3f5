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
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.view.detectors import Finger
from slip_detector.view.hand_labels import HandLabels
from slip_detector.view.recordings import RecordedFolder, Recorder, RecordingSummary
from slip_detector.view.server import MOST_NAME, Server
from slip_detector.view.tuning import TuneRun, was_interrupted
from slip_detector.view.view_request import Message, number

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
        self._begun_at_s = self._pressed_at_s = 0.0
        # The stamp at which the recording of a slip ends.
        self._ends_ns: int | None = None
        #: What happened last, for the page.
        self.words = ''
        self._run: TuneRun | None = None
        self._tuning: asyncio.Task[None] | None = None
        server.each_tick.append(self.tick)
        server.at_end.append(self.close)
        server.on_request('recordings', self._recordings, latest_only=True)
        server.on_request('trace', self._trace, latest_only=True)
        for name in ('label', 'snap', 'undo_label'):
            server.on_request(name, self._change_label, changes=True)
        server.on_request('teach', self._teach, changes=True)
        server.on_request('delete_recording', self._delete, changes=True)
        server.on_request('mark_recording', self._mark, changes=True)
        server.on_request('tune', self._tune, changes=True)
        server.on_request('stop_tuning', self._stop_tuning, changes=True)
        server.on_request('apply_tuning', self._apply, changes=True)

    async def close(self) -> None:
        """End the recording and the tuning."""
        self.stop()
        if self._tuning is not None and not self._tuning.done():
            self._tuning.cancel()
            await asyncio.gather(self._tuning, return_exceptions=True)

    def tick(self) -> None:
        """Write new rows, end what is due to end, and report; called after each poll."""
        if self._recorder is not None:
            self._continue(self._recorder)
        recorder, tuning = self._recorder, self._run and self._run.described()
        self._server.wanted['recording'] = {recorder.finger.name} if recorder else set()
        self._server.broadcast('recording', {'recording': self.recording()})
        fingers = {name: self._listed(name, folder) for name, folder in self._folders.items()}
        content = {'fingers': fingers, 'words': self.words, 'tuning': tuning}
        self._server.broadcast('teaching', content)

    # Recordings.

    def folder_of(self, name: object) -> RecordedFolder:
        """Return the recordings of a finger, by the name that a page has sent."""
        finger = self._detectors.finger_of(name)
        new = RecordedFolder(self._folder / finger.label)
        folder = self._folders.setdefault(finger.name, new)
        folder.sample_rate_hz = finger.config.sample_rate_hz
        return folder

    def start(self, name: object, kind: object) -> None:
        """Begin to record a finger at rest, being tapped or pressed, until :meth:`stop`."""
        if kind not in ('rest', 'taps', 'press'):
            raise ValueError(f'{str(kind)[:40]} is not recorded so, allowed: rest, taps, press')
        finger = self._free(name)
        self._begin(finger, str(kind), finger.track.samples.appended)

    def stop(self) -> None:
        """End the present recording, if any."""
        if self._recorder is not None:
            self._detectors.poll()
            self._end(self._recorder)

    def press(self, name: object) -> None:
        """Begin a slip: rows from now on are labelled as slip, until :meth:`release`.

        The recording begins with the rest before the slip.
        """
        self.still_pressed()
        if self._slipping(name):
            return
        finger = self._free(name)
        self._detectors.poll()
        track, row = finger.track, finger.track.slip_ended
        # By stamps rather than by rows, as samples may be missing.
        stamps_ns = track.samples.stamps_ns(row)
        rest_ns = stamps_ns[stamps_ns >= stamps_ns[-1:] - round(BEFORE_S * 1e9)]
        recorder = self._begin(finger, 'slip', track.samples.appended - len(rest_ns))
        recorder.label(True)
        before_s = np.ptp(rest_ns) * 1e-9 if len(rest_ns) else 0.0
        rest = f'{before_s:.1f} s of rest before: wait for {BEFORE_S:g} s between two slips'
        self.words += f': slip until the key is released. It has {rest}'

    def still_pressed(self) -> None:
        """Note that the key is still pressed."""
        self._pressed_at_s = time.monotonic()

    def release(self, name: object) -> None:
        """End the slip of a finger; its recording goes on for some rest."""
        if recorder := self._slipping(name):
            self._detectors.poll()
            self._end_slip(recorder)

    def _slipping(self, name: object) -> Recorder | None:
        """Return what records a slip of the finger now."""
        recorder = self._recorder
        slips = recorder is not None and recorder.slipping and name == recorder.finger.name
        return recorder if slips else None

    def _continue(self, recorder: Recorder) -> None:
        now_s, finger = time.monotonic(), recorder.finger
        recorder.write()
        if recorder.failure:
            self._end(recorder)
        elif recorder.interrupted or self._detectors.fingers.get(finger.name) is not finger:
            self._end(recorder, GONE)
        elif recorder.slipping and now_s - self._pressed_at_s > PRESSED_S:
            self._end_slip(recorder)
            self.words = f'{recorder.path.name}: the page that held the slip is gone, so it ended'
        elif self._ends_ns and (finger.track.samples.stamps_ns()[-1:] >= self._ends_ns).any():
            self._end(recorder)
        elif now_s - self._begun_at_s > MOST_S:
            self._end(recorder, f'It was ended after {MOST_S / 60:.0f} minutes')

    def recording(self) -> dict[str, Any] | None:
        """Return the present recording, for the page; None if there is none."""
        recorder = self._recorder
        if recorder is None:
            return None
        finger, ending = recorder.finger, self._ends_ns is not None
        words = f'{recorder.path.name} of {finger.label}: {recorder.duration_s:.1f} s'
        after = ', the rest after it: hold still' if ending else ''
        words += ', SLIP' if recorder.slipping else after
        if time.monotonic() - finger.sample_s > SILENT_S:
            words += '. No samples come: nothing is recorded until they do'
        state = {'slipping': recorder.slipping, 'ending': ending, 'words': words}
        return {'finger': finger.name, 'kind': recorder.kind, **state}

    def _listed(self, finger: str, folder: RecordedFolder) -> Mapping[str, Any]:
        writing = self._recorder and self._recorder.path
        all_there = folder.described()
        return {
            'folder': str(folder.folder),
            'recordings': [each for each in all_there if folder.folder / each['name'] != writing],
            'held_out': folder.held_out(),
            'obeys': self._detectors.order(finger),
            'interrupted': folder.interrupted,
        }

    def _free(self, name: object) -> Finger:
        """Return the finger to record; a slip that only waits for the rest after it is ended."""
        finger, recorder = self._detectors.finger_of(name), self._recorder
        if recorder is not None and (self._ends_ns is None or recorder.finger is not finger):
            present = f'{recorder.path.name} of {recorder.finger.label}'
            raise ValueError(f'{present} is being recorded: end it first')
        self.stop()
        return finger

    def _begin(self, finger: Finger, kind: str, since: int) -> Recorder:
        self._recorder = Recorder(self.folder_of(finger.name).new_path(kind), finger, since)
        self._detectors.order(finger.name, kind)
        self._ends_ns, self._begun_at_s = None, time.monotonic()
        self.words = f'recording {self._recorder.path.name}'
        return self._recorder

    def _end_slip(self, recorder: Recorder) -> None:
        recorder.label(False)
        self._detectors.order(recorder.finger.name, 'rest')
        track = recorder.finger.track
        track.slip_ended = track.samples.appended
        last_ns = max(track.samples.stamps_ns()[-1:], default=0)
        self._ends_ns = int(last_ns) + round(AFTER_S * 1e9)
        self.words = f'recording {recorder.path.name}: the rest after the slip'

    def _end(self, recorder: Recorder, why: str = '') -> None:
        """End the recording, list it, and say why it ended if nobody asked for that."""
        recorder.close()
        self._detectors.order(recorder.finger.name, 'rest')
        self._recorder, self._ends_ns = None, None
        name, note = recorder.path.name, recorder.note
        words = [f'{name} has no sample, so it is not kept', note and f'It {note}', why]
        if recorder.rows:
            folder, duration_s = self._folders[recorder.finger.name], recorder.duration_s
            folder.add(RecordingSummary(name, duration_s, int(recorder.has_slip), note))
            words[0] = f'{name} has {duration_s:.1f} s'
            if off_rate := folder.off_rate(name):
                words.append(f'It {off_rate}, so it is not tuned on: record it again')
        self.words = '. '.join(filter(None, words))

    # What pages request.

    async def _recordings(self, message: Message) -> None:
        """Update the list of a finger's recordings."""
        finger = self._detectors.finger_of(message.get('finger'))
        folder = self.folder_of(finger.name)
        await folder.refresh(self._server.work)
        folder.interrupted = self._run is None and was_interrupted(folder.folder, finger.config)

    async def _trace(self, message: Message) -> dict[str, Any]:
        """Return what the detector as it is would decide in a recording."""
        finger, name = message.get('finger'), message.get('recording')
        folder, config = self.folder_of(finger), self._detectors.finger_of(finger).config
        return await self._server.work(folder.trace, name, config)

    async def _change_label(self, message: Message) -> Any:
        folder, name = self.folder_of(message.get('finger')), message.get('recording')
        pixel_s = number('pixel_s', message, 0.0, 1e9) or 0.0
        changes: dict[str, Callable[[HandLabels], Any]] = {
            'label': lambda known: known.change(message.get('slip_s'), pixel_s),
            'snap': HandLabels.snap,
            'undo_label': HandLabels.undo,
        }
        return await self._server.work(folder.change_labels, name, changes[message['type']])

    async def _teach(self, message: Message) -> None:
        finger, what = message.get('finger'), message.get('do')
        acts: dict[str, Callable[[], None]] = {
            'slip': lambda: self.press(finger),
            'release': lambda: self.release(finger),
            'still_pressed': self.still_pressed,
            'stop': self.stop,
        }
        acts.get(str(what), lambda: self.start(finger, what))()

    def _to_change(self, message: Message) -> RecordedFolder:
        """Return the folder of a finger, which no search reads now."""
        if self._run is not None and self._run.running:
            raise ValueError('recordings are being tuned on, allowed: to change one afterwards')
        return self.folder_of(message.get('finger'))

    async def _delete(self, message: Message) -> None:
        self._to_change(message).delete(message.get('recording'))
        self.words = f'{message["recording"]} is deleted'

    async def _mark(self, message: Message) -> None:
        name, mistaken = message.get('recording'), message.get('mistaken') is True
        await self._server.work(self._to_change(message).mark, name, mistaken)
        self.words = f'{name} {"is marked as a mistake" if mistaken else "counts again"}'

    async def _tune(self, message: Message) -> None:
        name = message.get('finger')
        folder, finger = self.folder_of(name), self._detectors.finger_of(name)
        if self._run is not None and self._run.running:
            raise ValueError('tuning runs already, allowed: one at a time')
        self.words, folder.interrupted = '', False
        self._run = TuneRun(folder, finger.name, finger.config)
        self._tuning = asyncio.create_task(self._run.run())

    async def _stop_tuning(self, message: Message) -> None:
        if self._run is not None:
            self._run.stop()

    async def _apply(self, message: Message) -> None:
        """Set the parameters that were found, all or none."""
        if self._run is None or self._run.found is None:
            raise ValueError('there is nothing to apply: tune first')
        if values := self._run.to_apply(self._detectors.finger_of(self._run.finger).config):
            page = f'page {message.get("page")}'[:MOST_NAME]
            await self._detectors.change(self._run.finger, values, page)
        self.words = f'the detector runs with what was found: {len(values)} values set'
