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

"""Requests of pages about parameters: set, undo, restore those of the file, save."""

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from slip_detector.parameters.conversion import shown
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.reading import read_parameter_file
from slip_detector.view.parameter_panel import Change, ParameterPanel, typed, words_of
from slip_detector.view.saving import launch_arguments, parameter_file, save
from slip_detector.view.server import Server


class ParameterRequests:
    """Answers the pages' requests about parameters, and sends them the present values.

    Parameters
    ----------
    server
        The server of the pages.
    folder
        Where files are saved.
    files
        The parameter files that the detectors were started with: one for all, or one for each
        namespace, named after it.
    """

    def __init__(self, server: Server, folder: Path, files: Sequence[Path] = ()) -> None:
        self._server, self._folder, self._files = server, folder.resolve(), files
        self._told: dict[str, tuple[int, bool]] = {}
        #: By detector, why its file cannot be read.
        self._file_errors: dict[str, str] = {}
        server.each_tick.append(self.tell)
        for kind, answer in (
            ('set', self._set),
            ('undo', self._undo),
            ('as_in_file', self._as_in_file),
            ('save', self._save),
        ):
            server.on_request(kind, answer, changes=True)

    def tell(self) -> None:
        """Send the pages the parameters if something has changed."""
        hand = self._server.hand
        versions = {
            name: (panel.version, name in hand.fingers) for name, panel in hand.panels.items()
        }
        if versions == self._told:
            return
        for name in versions.keys() - self._told.keys():
            self._read_file(name)
        self._told = versions
        self._server.tell(
            'parameters',
            {
                'folder': str(self._folder),
                'fingers': {n: self._described(n, panel) for n, panel in hand.panels.items()},
            },
        )

    def _described(self, name: str, panel: ParameterPanel) -> dict[str, Any]:
        file = self._file_of(name)
        return {
            'gone': name not in self._server.hand.fingers,
            'headings': panel.shown(),
            'file': '' if file is None else str(file),
            'file_error': self._file_errors.get(name, ''),
            'differs': sorted(panel.as_in_file()),
            'undo': words_of(_inverse(panel.history[-1])) if panel.history else '',
            'changes': [
                {
                    'number': panel.count - i,
                    'by': change.by,
                    'names': list(change.after),
                    'words': words_of(change),
                }
                for i, change in enumerate(reversed(panel.changes))
            ],
        }

    def _file_of(self, name: str) -> Path | None:
        if len(self._files) < 2:
            return next(iter(self._files), None)
        namespace = name.split('/')[-2]
        return next((file for file in self._files if file.stem == namespace), None)

    def _read_file(self, name: str) -> None:
        """Read the present content of a detector's file."""
        file = self._file_of(name)
        if file is None:
            return
        panel = self._server.hand.panel(name)
        try:
            values = read_parameter_file(file, DetectorConfig.NODE, running=name)
            config = DetectorConfig.from_parameters(values, str(file))
        except ValueError as error:
            self._file_errors[name] = str(error)
            return
        self._file_errors.pop(name, None)
        panel.file_values = config.to_parameters()
        panel.version += 1

    def _panel(self, name: object) -> ParameterPanel:
        panel = self._server.hand.panels.get(name) if isinstance(name, str) else None
        if panel is None:
            raise ValueError(f'finger is {shown(name)}, allowed: one that is shown')
        return panel

    async def _change(
        self, message: Mapping[str, Any], values: Mapping[str, Any]
    ) -> dict[str, Any]:
        await self._server.hand.change(message['finger'], values, f'page {message.get("page")}')
        return {}

    async def _set(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Set values that were typed or dragged."""
        self._panel(message.get('finger'))
        values = message.get('values')
        if not isinstance(values, dict) or not values:
            raise ValueError(f'values is {shown(values)}, allowed: a value for each name')
        return await self._change(
            message,
            {
                n: typed(n, value) if isinstance(value, str) else value
                for n, value in values.items()
            },
        )

    async def _undo(self, message: Mapping[str, Any]) -> dict[str, Any]:
        values = self._panel(message.get('finger')).to_undo()
        if not values:
            raise ValueError('there is nothing to undo')
        return await self._change(message, values)

    async def _as_in_file(self, message: Mapping[str, Any]) -> dict[str, Any]:
        panel = self._panel(message.get('finger'))
        self._read_file(message['finger'])
        if message['finger'] in self._file_errors:
            raise ValueError(self._file_errors[message['finger']])
        values = panel.as_in_file()
        return await self._change(message, values) if values else {}

    async def _save(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Save the detectors' parameters; return how to launch with them, or why it cannot."""
        names = message.get('fingers')
        if not isinstance(names, list) or not names:
            raise ValueError(f'fingers is {shown(names)}, allowed: a list of those that are shown')
        configs = {name: self._panel(name).config for name in names}
        given = self._file_of(names[0])
        comments = [f'Saved by slip_view: what {" and ".join(configs)} ran with.']
        lost = ''
        try:
            document = parameter_file(configs, given)
        except ValueError as error:
            lost = f'It lacks the parameters of other nodes: {error}'
            document = parameter_file(configs)
            comments.append(lost)
        name, replace = message.get('name'), message.get('replace') is True
        if not isinstance(name, str):
            raise ValueError(f'name is {shown(name)}, allowed: a name for the file')
        try:
            path = await asyncio.to_thread(
                save, self._folder, name, document, comments, replace=replace
            )
        except FileExistsError as error:
            return {'taken': str(error)}
        return {'launch': launch_arguments(configs, path), 'lost': lost}


def _inverse(change: Change) -> Change:
    return Change(change.after, change.before, change.by)
