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


"""Requests of pages for teaching: record, delete, tune, apply."""

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slip_detector.view.server import Server
from slip_detector.view.teaching import Teaching
from slip_detector.view.tune_run import TuneRun


class TeachingRequests:
    """Answers the pages' requests about recordings and tuning, and reports the progress.

    Parameters
    ----------
    server
        The server of the pages.
    folder
        Where the recordings are.
    """

    def __init__(self, server: Server, folder: Path) -> None:
        self._server = server
        self._teaching = Teaching(server.detectors, folder.resolve())
        self._run: TuneRun | None = None
        self._tuned = ''
        self._task: asyncio.Task[None] | None = None
        server.each_tick.append(self._tick)
        server.at_end.append(self.close)
        server.on_request('recordings', self._recordings)
        for kind, answer in (
            ('teach', self._teach),
            ('delete_recording', self._delete),
            ('tune', self._tune),
            ('stop_tuning', self._stop_tuning),
            ('apply_tuning', self._apply),
        ):
            server.on_request(kind, answer, changes=True)

    async def close(self) -> None:
        """End the recording and the tuning."""
        self._teaching.close()
        if self._run is not None and self._task is not None:
            self._run.kill()
            await self._task

    @property
    def _tunes(self) -> bool:
        return self._task is not None and not self._task.done()

    def _tick(self) -> None:
        self._teaching.tick()
        self._server.wanted['recording'] = {self._teaching.finger} - {''}
        self._broadcast()

    def _broadcast(self) -> None:
        self._server.broadcast('recording', {'recording': self._teaching.recording()})
        self._server.broadcast(
            'teaching',
            {
                'fingers': self._teaching.described(),
                'words': self._teaching.words,
                'tuning': self._run and {'finger': self._tuned, **self._run.described()},
            },
        )

    async def _recordings(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Update the list of a finger's recordings."""
        folder = self._teaching.folder_of(message.get('finger'))
        await asyncio.to_thread(folder.look)
        return {}

    async def _teach(self, message: Mapping[str, Any]) -> dict[str, Any]:
        teaching, finger, what = self._teaching, message.get('finger'), message.get('do')
        if what == 'press':
            teaching.press(finger)
        elif what == 'hold':
            teaching.hold()
        elif what == 'release':
            teaching.release(finger)
        elif what == 'stop':
            teaching.stop()
        else:
            teaching.start(finger, what)
        return {}

    async def _delete(self, message: Mapping[str, Any]) -> dict[str, Any]:
        if self._tunes:
            raise ValueError('recordings are being tuned on, allowed: to delete one afterwards')
        self._teaching.delete(message.get('finger'), message.get('recording'))
        return {}

    async def _tune(self, message: Mapping[str, Any]) -> dict[str, Any]:
        name = message.get('finger')
        folder = self._teaching.folder_of(name)
        await asyncio.to_thread(folder.look)
        # Meanwhile another page may have begun to tune, or the finger may have gone.
        finger = self._teaching.finger_of(name)
        if self._tunes:
            raise ValueError('tuning runs already, allowed: one at a time')
        self._run, self._tuned = TuneRun(folder, finger.config), finger.name
        self._task = asyncio.create_task(self._run.run())
        return {}

    async def _stop_tuning(self, message: Mapping[str, Any]) -> dict[str, Any]:
        if self._run is not None:
            self._run.stop()
        return {}

    async def _apply(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Set the parameters that were found, all or none."""
        if self._run is None or self._run.found is None:
            raise ValueError('there is nothing to apply: tune first')
        values = self._run.to_apply(self._teaching.finger_of(self._tuned).config)
        if values:
            await self._server.detectors.change(self._tuned, values, f'page {message.get("page")}')
        self._teaching.words = f'the detector runs with what was found: {len(values)} values set'
        return {}
