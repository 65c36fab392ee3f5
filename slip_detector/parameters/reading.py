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

"""Reads ROS parameter files."""

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from slip_detector.parameters.yaml_files import read_yaml

#: Parameters that rclpy itself declares and reads for every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service', 'qos_overrides')

#: The parameter set of each section of a parameter file, by the name of its node or command. The
#: definition of a set's class enters it here, in place of a base class with the same node, as
#: ``DetectorConfig`` replaces ``ChainConfig``.
SECTIONS: dict[str, type[Any]] = {}

#: Full name and parameters of a section.
Section = tuple[str, dict[str, Any]]


def read_parameter_file(path: str | Path, node: str, running: str = '') -> dict[str, Any]:
    """Read the parameters that a ROS parameter file has for a node.

    Read are the sections for all nodes (``/**``), for the node in any namespace (``/**/node``) and
    for the node in one namespace. From the section for all nodes, parameters that only other
    nodes of this package have are left out.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node, without namespace.
    running
        Full name of a running node: only the sections that match it are read.

    Returns
    -------
    dict
        Flat names (``groups.TP``) and values, without the parameters of rclpy; empty when the file
        has no section for the node.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has sections for the node in
        several namespaces and ``running`` does not tell the namespace.

    Examples
    --------
    >>> from slip_detector.parameters.shared_folder import shared_folder
    >>> file = shared_folder() / 'config' / 'slip_detector.yaml'
    >>> read_parameter_file(file, 'slip_detector')['groups.TP']
    [14, 16, 11, 9]
    """
    sections = list(sections_of(read_yaml(path), str(path)))
    if not running:
        _ours_of(sections, path)
    left_out = _names_for_others(sections, path, node)
    merged: dict[str, Any] = {}
    of_namespaces: list[str] = []
    for section, parameters in sections:
        if not running and node_of(section) == node and '*' not in section:
            of_namespaces.append(section)
        if matches(section, running) if running else node_of(section) in (node, '**'):
            merged.update(_flattened(parameters, f'{path}: section {section}'))
    if len(of_namespaces) > 1:
        raise ValueError(
            f'{path}: has sections for {", ".join(of_namespaces)}, allowed: one namespace'
        )
    return {
        name: value
        for name, value in merged.items()
        if name.split('.')[0] not in OF_RCLPY and name not in left_out
    }


def names_for_others(path: str | Path, node: str) -> set[str]:
    """Return the names in the section for all nodes that are parameters of other nodes only.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node, without namespace.

    Raises
    ------
    ValueError
        When the file is missing or is not a ROS parameter file.

    Examples
    --------
    >>> import tempfile
    >>> import slip_detector.parameters
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / 'all.yaml'
    ...     _ = file.write_text('/**: {ros__parameters: {grip_n: 2.0, threshold: 0.4}}')
    ...     names_for_others(file, 'slip_detector')
    {'grip_n'}
    """
    return _names_for_others(sections_of(read_yaml(path), str(path)), path, node)


def _names_for_others(sections: Iterable[Section], path: str | Path, node: str) -> set[str]:
    """Return what :func:`names_for_others` returns, from the sections of the file."""
    for_all: set[str] = set()
    for_node: set[str] = set()
    for section, parameters in sections:
        if node_of(section) == '**':
            for_all.update(_flattened(parameters, f'{path}: section {section}'))
        elif node_of(section) == node:
            for_node.update(_flattened(parameters, f'{path}: section {section}'))
    return {
        name
        for name in for_all - for_node
        if (known := nodes_that_know(name)) and node not in known
    }


def nodes_that_know(name: str) -> list[str]:
    """Return the nodes and commands of this package that have a parameter.

    Parameters
    ----------
    name
        Name of the parameter; of ``groups.TP`` only ``groups`` is looked up.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> nodes_that_know('sample_rate_hz'), nodes_that_know('channels')
    (['slip_detector'], ['slip_detector', 'slip_driver'])
    """
    head = name.partition('.')[0]
    return [
        node
        for node, parameters in SECTIONS.items()
        if head in {field.name for field in dataclasses.fields(parameters)}
    ]


def our_sections(path: str | Path) -> list[Section]:
    """Read the sections of a ROS parameter file that are for nodes and commands of this package.

    Returns
    -------
    list
        Full name and parameters of each section.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has no such section; names the
        file.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> from slip_detector.parameters.shared_folder import shared_folder
    >>> [name for name, _ in our_sections(shared_folder() / 'config' / 'grasp.yaml')]
    ['/**/slip_detector', '/**/grasp_controller', '/**/slip_driver']
    """
    return _ours_of(sections_of(read_yaml(path), str(path)), path)


def _ours_of(sections: Iterable[Section], path: str | Path) -> list[Section]:
    """Return what :func:`our_sections` returns, from the sections of the file."""
    ours = [section for section in sections if node_of(section[0]) in (*SECTIONS, '**')]
    if not ours:
        raise ValueError(f'{path}: has no section of this package, allowed: {", ".join(SECTIONS)}')
    return ours


def sections_of(document: Mapping[str, Any], path: str, namespace: str = '') -> Iterator[Section]:
    """Yield the full name and the parameters of each section of a ROS parameter file.

    Parameters
    ----------
    document
        The content of the file.
    path
        The file, for messages.
    namespace
        Names of the mappings around the document, joined by ``/``.

    Raises
    ------
    ValueError
        When a section has no parameters; names the file and the section.

    Examples
    --------
    >>> document = {'hand': {'slip_driver': {'ros__parameters': {'seed': 3}}}}
    >>> list(sections_of(document, 'hand.yaml'))
    [('hand/slip_driver', {'seed': 3})]
    """
    for name, content in document.items():
        section = f'{namespace}/{name}' if namespace else str(name)
        if not isinstance(content, Mapping) or not content:
            raise ValueError(f'{path}: section {section} has no ros__parameters')
        if 'ros__parameters' not in content:
            yield from sections_of(content, path, section)
        elif isinstance(content['ros__parameters'], dict):
            yield section, content['ros__parameters']
        else:
            raise ValueError(f'{path}: section {section} has no names under ros__parameters')


def matches(section: str, node: str) -> bool:
    """Return whether a section of a parameter file is for a node, by the rules of ROS.

    Parameters
    ----------
    section
        Name of the section; ``*`` stands for one name and ``**`` for any number of names.
    node
        Full name of the node.

    Examples
    --------
    >>> node = '/index/slip_driver'
    >>> [matches(name, node) for name in ('/**/slip_driver', '/*/slip_driver', '/**')]
    [True, True, True]
    >>> [matches(name, node) for name in ('slip_driver', '/thumb/slip_driver')]
    [False, False]
    """
    pattern = re.escape(f'/{section.lstrip("/")}')
    pattern = pattern.replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'(/\w+)')
    return re.fullmatch(pattern, node) is not None


def check_sections(path: str | Path, executable: str, node: str) -> None:
    """Check that a parameter file with sections for an executable has one for this node.

    ROS ignores sections that do not match, so that the node would run with its defaults.

    Parameters
    ----------
    path
        The YAML file.
    executable
        Default name of the node.
    node
        Full name of the node.

    Raises
    ------
    ValueError
        When all sections for the executable are for nodes of other names, or no section is for
        this package.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = Path(folder.name) / 'finger.yaml'
    >>> _ = file.write_text('/thumb/slip_driver: {ros__parameters: {source: scene}}')
    >>> check_sections(file, 'slip_driver', '/thumb/slip_driver')
    >>> check_sections(file, 'slip_driver', '/index/slip_driver')  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ValueError: ...finger.yaml: has sections for /thumb/slip_driver, none for this node, ...
    >>> folder.cleanup()
    """
    sections = list(sections_of(read_yaml(path), str(path)))
    if any(matches(name, node) for name, _ in sections if node_of(name) != '**'):
        return
    _ours_of(sections, path)
    ours = [name for name, _ in sections if node_of(name) == executable]
    if ours:
        raise ValueError(
            f'{path}: has sections for {", ".join(ours)}, none for this node, {node}, allowed: '
            f'{node} or /**/{node_of(node)}'
        )


def node_of(section: str) -> str:
    """Return the node that a section is for, without namespace; ``**`` means all nodes.

    Examples
    --------
    >>> node_of('/**/slip_detector'), node_of('/**')
    ('slip_detector', '**')
    """
    return section.rsplit('/', 1)[-1]


def _flattened(values: Mapping[str, Any], where: str, prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        inner = {name: value}
        if isinstance(value, Mapping):
            inner = _flattened(value, where, f'{name}.')
        again = flat.keys() & inner
        if again:
            raise ValueError(f'{where} has {min(again)} again, allowed: once')
        flat.update(inner)
    return flat
