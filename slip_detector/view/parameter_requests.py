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

"""Requests of pages about parameters: set, undo, restore those of the file, save.

They are saved in a file that the launch files accept.
"""

import asyncio
import re
import shlex
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fields import shown
from slip_detector.parameters.files import read_yaml, writable_folder, write_yaml
from slip_detector.parameters.sets import (
    OF_RCLPY,
    matches,
    node_of,
    nodes_that_know,
    read_parameter_file,
    sections_of,
)
from slip_detector.view.parameter_panel import Change, ParameterPanel, typed, words_of
from slip_detector.view.server import Server

#: Names that a page may give to a file. Of several parameter files, the launch files use the names
#: as namespaces.
FILE_NAME = re.compile('(?!.*__)[A-Za-z][A-Za-z0-9_]{0,63}')
ALLOWED_NAME = 'a letter, then letters (a-z), digits, single _, at most 64'


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
        self._versions: dict[str, tuple[int, bool]] = {}
        #: By detector, why its file cannot be read.
        self._file_errors: dict[str, str] = {}
        server.each_tick.append(self.broadcast)
        server.on_request('set', self._set, changes=True)
        server.on_request('undo', self._undo, changes=True)
        server.on_request('as_in_file', self._as_in_file, changes=True)
        server.on_request('save', self._save, changes=True)

    def broadcast(self) -> None:
        """Send the pages the parameters if something has changed."""
        detectors = self._server.detectors
        panels = detectors.panels.items()
        versions = {name: (panel.version, name in detectors.fingers) for name, panel in panels}
        if versions == self._versions:
            return
        for name in versions.keys() - self._versions.keys():
            self._read_file(name)
        self._versions = versions
        described = {name: self._described(name, panel) for name, panel in panels}
        self._server.broadcast('parameters', {'folder': str(self._folder), 'fingers': described})

    def _described(self, name: str, panel: ParameterPanel) -> dict[str, Any]:
        file = self._file_of(name)
        return {
            'gone': name not in self._server.detectors.fingers,
            'headings': panel.shown(),
            'file': '' if file is None else str(file),
            'file_error': self._file_errors.get(name, ''),
            'differs': sorted(panel.as_in_file()),
            'undo': _undone(panel.history[-1]) if panel.history else '',
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
        panel = self._server.detectors.panel(name)
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
        panel = self._server.detectors.panels.get(name) if isinstance(name, str) else None
        if panel is None:
            raise ValueError(f'finger is {shown(name)}, allowed: one that is shown')
        return panel

    async def _change(
        self, message: Mapping[str, Any], values: Mapping[str, Any]
    ) -> dict[str, Any]:
        await self._server.detectors.change(
            message['finger'], values, f'page {message.get("page")}'
        )
        return {}

    async def _set(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Set values that were typed or dragged."""
        self._panel(message.get('finger'))
        values = message.get('values')
        if not isinstance(values, dict) or not values:
            raise ValueError(f'values is {shown(values)}, allowed: a value for each name')
        texts = {name: value for name, value in values.items() if isinstance(value, str)}
        read = {name: typed(name, text) for name, text in texts.items()}
        return await self._change(message, {**values, **read})

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


def _undone(change: Change) -> str:
    return words_of(Change(change.after, change.before, change.by))


def parameter_file(
    configs: Mapping[str, DetectorConfig], given: str | Path | None = None
) -> dict[str, Any]:
    """Return the content of a parameter file for detectors with these configurations.

    Parameters
    ----------
    configs
        By the full names of the detectors. A single one is written for a detector in any
        namespace; several are written each for the detector of that name.
    given
        The file they were started with, if any: its sections for other nodes are copied.

    Raises
    ------
    ValueError
        When that file cannot be read; names it.

    Examples
    --------
    >>> document = parameter_file({'/thumb/slip_detector': DetectorConfig(threshold=0.25)})
    >>> list(document), document['/**/slip_detector']['ros__parameters']['threshold']
    (['/**/slip_detector'], 0.25)
    """
    document: dict[str, Any] = {}
    # Parameters that rclpy itself reads, such as use_sim_time, are kept for the detectors.
    of_rclpy: dict[str, dict[str, Any]] = {name: {} for name in configs}
    for section, parameters in sections_of(read_yaml(given) if given else {}, str(given)):
        for name, kept in of_rclpy.items():
            if matches(section, name):
                kept.update({key: parameters[key] for key in OF_RCLPY if key in parameters})
        if node_of(section) in {node_of(name) for name in configs}:
            continue
        if node_of(section) == '**':
            parameters = {  # noqa: PLW2901
                key: value
                for key, value in parameters.items()
                if nodes_that_know(key) != [DetectorConfig.NODE]
            }
        if parameters:
            document[section] = {'ros__parameters': parameters}
    # Last, because of two sections for a node the later one holds.
    for name, config in configs.items():
        section = name if len(configs) > 1 else f'/**/{node_of(name)}'
        document[section] = {'ros__parameters': {**of_rclpy[name], **_nested(config)}}
    return document


def _nested(config: DetectorConfig) -> dict[str, Any]:
    values = {**config.to_parameters(), 'groups': {n: [*m] for n, m in config.groups.items()}}
    return {name: value for name, value in values.items() if '.' not in name}


def launch_arguments(names: Collection[str], path: Path) -> str:
    """Return the arguments of ``slip_detector.launch.py`` that start detectors with a saved file.

    Parameters
    ----------
    names
        Full names of the saved detectors. One alone can be started as any finger; several are
        started with their names.
    path
        The file.

    Examples
    --------
    >>> launch_arguments(['/thumb/slip_detector'], Path('my hand/thumb.yaml'))
    "'config:=my hand/thumb.yaml'"
    >>> both = '/left/thumb/slip_detector', '/left/index/slip_detector'
    >>> launch_arguments(both, Path('left.yaml'))
    'namespace:=left fingers:=thumb,index config:=left.yaml'
    """
    words = [f'config:={path}']
    found = [re.fullmatch(f'(/.*|)/([^/]+)/{DetectorConfig.NODE}', name) for name in names]
    fingers = [match.groups() for match in found if match]
    namespaces = {namespace for namespace, _ in fingers}
    if 1 < len(fingers) == len(names) and len(namespaces) == 1:
        words.insert(0, f'fingers:={",".join(finger for _, finger in fingers)}')
        words[:0] = [f'namespace:={namespace[1:]}' for namespace in namespaces if namespace]
    return shlex.join(words)


def save(
    folder: Path,
    name: str,
    document: Mapping[str, Any],
    comments: Iterable[str],
    *,
    replace: bool = False,
) -> Path:
    """Write a parameter file into a folder, under a name that a user typed.

    Parameters
    ----------
    folder, name
        The folder, created if missing, and the name of the file without ``.yaml``.
    document, comments
        The content of the file, and the comments above it.
    replace
        Whether a file of that name may be replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ValueError
        When the name is not allowed, or the file cannot be written.
    FileExistsError
        When a file of that name exists, and it may not be replaced.

    Examples
    --------
    >>> save(Path('recordings'), '..', {}, [])
    Traceback (most recent call last):
    ValueError: name is '..', allowed: a letter, then letters (a-z), digits, single _, at most 64
    """
    if not FILE_NAME.fullmatch(name):
        raise ValueError(f'name is {shown(name)}, allowed: {ALLOWED_NAME}')
    path = writable_folder(folder) / f'{name}.yaml'
    if path.is_symlink():
        raise ValueError(f'{path}: is a link to another file, allowed: a name of its own')
    if path.exists() and not replace:
        raise FileExistsError(f'{path}: already exists')
    write_yaml(path, document, comments)
    return path
