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

"""Saves the parameters of running detectors in a file that the launch files accept."""

import re
import shlex
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from slip_detector.parameters.conversion import shown
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.files import writable_folder
from slip_detector.parameters.reading import (
    OF_RCLPY,
    matches,
    node_of,
    nodes_that_know,
    sections_of,
)
from slip_detector.parameters.writing import write_file
from slip_detector.parameters.yaml_files import read_yaml

#: Names that a page may give to a file. Of several parameter files, the launch files use the names
#: as namespaces.
FILE_NAME = re.compile('(?!.*__)[A-Za-z][A-Za-z0-9_]{0,63}')
ALLOWED_NAME = 'a letter, then letters (a-z), digits, single _, at most 64'


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
    write_file(path, document, comments)
    return path
