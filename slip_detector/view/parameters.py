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


"""The parameters of running detectors: how pages show, set, undo and save them.

A page sends text that was typed, or numbers from a line that was dragged in a plot. The detector
decides whether a value is allowed; its message is shown. Parameters are saved in a file that the
launch files accept.
"""

import asyncio
import contextlib
import dataclasses
import functools
import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from slip_detector.parameters import (
    FIXED_PARAMETERS,
    NODE_PARAMETERS,
    DetectorConfig,
    allowed,
    parameter_file,
    parsed_yaml,
    quote,
    refuse,
    shared_folder,
    shortened,
    under_headings,
    writable_folder,
    write_yaml,
)
from slip_detector.view.detectors import Finger, Values
from slip_detector.view.server import Server

#: Names that a page may give to a file. Of several parameter files, the launch files use the names
#: as namespaces.
FILE_NAME = re.compile('(?!.*__)[A-Za-z][A-Za-z0-9_]{0,63}')
ALLOWED_NAME = 'a letter, then letters (a-z), digits, single _, at most 64'

#: The presets that a page offers, each with the name of its file in ``config``.
PRESETS = {'paper': 'slip_detector', 'onset': 'onset', 'sure': 'sure', 'grasp': 'grasp'}

#: Parameters that describe the sensor: no preset changes them.
_SENSOR_PARAMETERS = {field.name for field in under_headings(DetectorConfig)['Samples']}


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
    overridden
        Parameters with which the detectors were started otherwise than the file says. They are
        not restored from the file; those of the file are saved.
    """

    def __init__(
        self,
        server: Server,
        folder: Path,
        files: Sequence[Path] = (),
        overridden: Collection[str] = (),
    ) -> None:
        self._server, self._detectors = server, server.detectors
        self._folder, self._files, self._overridden = folder.resolve(), files, overridden
        #: By detector, a state that changes whenever its description for the pages does.
        self._states: dict[str, tuple[Any, ...]] = {}
        server.each_tick.append(self._broadcast)
        names = 'set', 'undo', 'as_in_file', 'take_input', 'preset', 'save'
        server.on_requests(self, *names, changes=True)

    def _broadcast(self) -> None:
        """Send the pages the parameters if something has changed."""
        fingers, gone = self._detectors.with_gone(), self._detectors.gone
        states = {n: (each.count, each.in_file, n in gone) for n, each in fingers.items()}
        if states == self._states:
            return
        for name in states.keys() - self._states.keys():
            # A file that cannot be read is reported when it is needed.
            with contextlib.suppress(ValueError):
                self._read_file(fingers[name])
        self._states = states
        described = {n: {'gone': n in gone, **self._describe(fingers[n])} for n in fingers}
        self._server.broadcast('parameters', {'folder': str(self._folder), 'fingers': described})

    def _describe(self, finger: Finger) -> dict[str, Any]:
        last = finger.history[-1] if finger.history else None
        latest = enumerate(reversed(finger.changes))
        return {
            'headings': describe_parameters(finger),
            'file': str(self._file_of(finger.name) or ''),
            'differs': sorted(finger.as_in_file(self._overridden)),
            'preset': _preset_of(finger.config),
            'undo': words_of(last.after, last.before) if last else '',
            'changes': [
                (finger.count - i, each.by, words_of(each.before, each.after))
                for i, each in latest
            ],
        }

    def _file_of(self, name: str) -> Path | None:
        namespace = name.split('/')[-2]
        only = len(self._files) == 1
        return next((file for file in self._files if only or file.stem == namespace), None)

    def _read_file(self, finger: Finger) -> None:
        """Read the present content of a detector's file."""
        if file := self._file_of(finger.name):
            finger.in_file = DetectorConfig.from_yaml(file, finger.name)

    async def answer_set(self, finger: Finger, values: Values, page: str) -> None:
        """Set values that were typed or dragged."""
        if not values:
            refuse(f'values is {quote(values)}', 'a value for each name')
        typed = {n: read_text(n, v) if isinstance(v, str) else v for n, v in values.items()}
        await self._server.change(finger, typed, page)

    async def answer_undo(self, finger: Finger, page: str) -> None:
        """Revert the last change."""
        await self._server.change(finger, finger.to_undo(), page)

    async def answer_as_in_file(self, finger: Finger, page: str) -> None:
        """Set what the file has."""
        self._read_file(finger)
        await self._server.change(finger, finger.as_in_file(self._overridden), page)

    async def answer_take_input(self, finger: Finger, page: str) -> None:
        """Set what makes the detector take what comes."""
        await self._server.change(finger, finger.to_fit, page)

    async def answer_preset(self, finger: Finger, preset: str, page: str) -> None:
        """Set the decision of a preset."""
        await self._server.change(finger, to_preset(preset, finger.config), page)

    async def answer_save(self, fingers: list[str], name: str, replace: bool) -> dict[str, Any]:
        """Save the detectors' parameters; return how to launch with them, or which file exists.

        The page gives the name of the file, without ``.yaml``.
        """
        if not fingers:
            refuse(f'fingers is {quote(fingers)}', 'a list of those that are shown')
        if not FILE_NAME.fullmatch(name or ''):
            refuse(f'name is {quote(name)}', ALLOWED_NAME)
        configs = {}
        for finger in map(self._detectors.finger_of, fingers):
            kept = {name: getattr(finger.in_file, name) for name in self._overridden}
            configs[finger.name] = dataclasses.replace(finger.config, **kept)
        path = writable_folder(self._folder) / f'{name}.yaml'
        if path.exists() and not replace:
            return {'taken': f'{path}: already exists'}
        comments = [f'Saved by slip_view: what {" and ".join(configs)} ran with.']
        document = parameter_file(configs, self._file_of(fingers[0]))
        await asyncio.to_thread(write_yaml, path, document, comments)
        return {'launch': launch_arguments(configs, path)}


@functools.cache
def preset(name: str) -> DetectorConfig:
    """Return the configuration in the file of a preset."""
    if name not in PRESETS:
        refuse(f'preset is {quote(name)}', ', '.join(PRESETS))
    return DetectorConfig.from_yaml(shared_folder() / 'config' / f'{PRESETS[name]}.yaml')


def to_preset(name: str, config: DetectorConfig) -> dict[str, Any]:
    """Return the values to set so that a detector decides as with a preset; None deletes a group.

    The values that describe the sensor stay. The groups stay too if the preset is for another
    number of channels.

    Examples
    --------
    >>> to_preset('paper', DetectorConfig(sample_rate_hz=500.0, threshold=0.25))
    {'threshold': 0.5}
    """
    wanted = preset(name)
    groups = {'groups'} if config.channels != wanted.channels else set()
    return config.changes_to(wanted, NODE_PARAMETERS | _SENSOR_PARAMETERS | groups)


def _preset_of(config: DetectorConfig) -> str:
    """Return the preset with which a detector decides; empty for none."""
    with contextlib.suppress(ValueError):  # The package may be installed without its files.
        return next((name for name in PRESETS if not to_preset(name, config)), '')
    return ''


def describe_parameters(finger: Finger) -> list[dict[str, Any]]:
    """Return what a page shows of the parameters: headings, each with those below in order."""
    config, limits, in_file = finger.config, finger.config.limits(), finger.in_file.to_parameters()
    parts: dict[str, list[dict[str, Any]]] = {}
    heading = ''
    for name, value in config.to_parameters().items():
        field = DetectorConfig.__dataclass_fields__[name.partition('.')[0]]
        heading, unit = field.metadata['heading'] or heading, field.metadata['unit']
        limit, always = limits.get(field.name, ''), allowed(field).removesuffix(f' {unit}')
        row = {
            'name': name,
            'text': text_of(value),
            'in_file': text_of(in_file[name]) if name in in_file else None,
            'unit': unit,
            'meaning': field.metadata['meaning'],
            'allowed': always if limit in always else f'{always}; now {limit}',
            'choices': ['true', 'false'] if isinstance(value, bool) else field.metadata['choices'],
            'read_only': name in FIXED_PARAMETERS,
        }
        parts.setdefault(heading, []).append(row)
    return [{'heading': heading, 'parameters': rows} for heading, rows in parts.items()]


def words_of(before: DetectorConfig, after: DetectorConfig) -> str:
    """Return a change in words.

    Examples
    --------
    >>> one, other = DetectorConfig(channels=1), DetectorConfig(channels=1, groups={'a': [1]})
    >>> words_of(one, other)
    'groups.all from 1 to nothing, groups.a from nothing to 1'
    """

    def words(values: Mapping[str, Any], name: str) -> str:
        return shortened(text_of(values[name])) or 'empty' if name in values else 'nothing'

    old, new = before.to_parameters(), after.to_parameters()
    names = before.changes_to(after)
    return ', '.join(f'{n} from {words(old, n)} to {words(new, n)}' for n in names)


def text_of(value: Any) -> str:
    """Return a value as a user types it: a list without brackets.

    Examples
    --------
    >>> text_of([7.0, 50.0]), text_of(True), text_of(0.1)
    ('7, 50', 'true', '0.1')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value).removesuffix('.0')
    if isinstance(value, (list, tuple)):
        return ', '.join(map(text_of, value))
    return str(value)


def read_text(name: str, text: str) -> Any:
    """Return the value of a text that was typed, as a parameter file would have it.

    The detector decides if the value is allowed. Brackets around lists can be left out.

    Raises
    ------
    ValueError
        When no value is written so.

    Examples
    --------
    >>> read_text('stopbands_hz', '[0.5, 7], [50, 180]'), read_text('vote', ' 2')
    ([0.5, 7, 50, 180], 2)
    >>> read_text('threshold', 'low')
    'low'
    """
    field = DetectorConfig.__dataclass_fields__.get(name.partition('.')[0])
    default = field.metadata['default'] if field else None
    if field and isinstance(default, (tuple, dict)):
        items = re.sub(r'[\[\]()]', ' ', text).strip()
        if isinstance(default, tuple) and str in get_args(field.type):
            return [item.strip() for item in items.split(',')] if items else []
        return parsed_yaml(f'[{items}]'.encode(), name)
    text = text.strip()
    is_text = not text or (isinstance(default, str) and name != 'vote')
    return text if is_text else parsed_yaml(text.encode(), name)


def launch_arguments(names: Collection[str], path: Path) -> str:
    """Return the arguments of ``slip_detector.launch.py`` that start detectors with a saved file.

    The file of a single detector can start any finger; of several detectors each is started with
    its name.

    Examples
    --------
    >>> launch_arguments(['/thumb/slip_detector'], Path('my hand/thumb.yaml'))
    "'config:=my hand/thumb.yaml'"
    >>> both = '/left/thumb/slip_detector', '/left/index/slip_detector'
    >>> launch_arguments(both, Path('left.yaml'))
    'namespace:=left fingers:=thumb,index config:=left.yaml'
    """
    parts = [name.split('/') for name in names]  # '', namespaces, the finger, the node
    namespaces = {'/'.join(each[1:-2]) for each in parts}
    words = [f'config:={path}']
    usual = all(each[-2] and each[-1] == DetectorConfig.NODE for each in parts)
    if usual and len(parts) > len(namespaces) == 1:
        words.insert(0, f'fingers:={",".join(each[-2] for each in parts)}')
        words[:0] = [f'namespace:={namespace}' for namespace in namespaces if namespace]
    return shlex.join(words)
