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

"""Sets of parameters, and the ROS parameter files with a section for each node or command.

One field of a frozen dataclass is one ROS parameter, with a default, a unit, a range and a
meaning. The nodes, the command lines, the YAML files and the core all use its name. Checks that
need more than one parameter are in ``__post_init__``. An error is a ``ValueError`` of one line
with the parameter, its value and what is allowed.
"""

import dataclasses
import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from slip_detector.parameters.fields import converted, listed, refuse, shown, shown_name
from slip_detector.parameters.files import read_yaml, yaml_text

#: Parameters that rclpy itself declares and reads for every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service', 'qos_overrides')

#: Full name and parameters of a section of a parameter file; ``**`` in a name stands for any
#: namespaces, or for all nodes.
Section = tuple[str, dict[str, Any]]

ConfigType = TypeVar('ConfigType', bound='ParameterSet')


@dataclasses.dataclass(frozen=True)
class ParameterSet:
    """Base class of all sets of parameters: conversion, checks and YAML.

    Examples
    --------
    >>> from slip_detector.parameters import GraspConfig
    >>> GraspConfig(grip_n=2).grip_n
    2.0
    >>> GraspConfig.from_parameters({'grip': 2.0})
    Traceback (most recent call last):
    ValueError: unknown parameter grip = 2.0; did you mean grip_n?
    >>> GraspConfig().to_yaml().splitlines()[0]
    '/**/grasp_controller:'
    """

    #: Name of the node or command whose section of a parameter file has these parameters.
    NODE = ''

    def __init_subclass__(cls) -> None:
        """Make this class the parameter set of its node's section, if it defines ``NODE``."""
        if 'NODE' in cls.__dict__:
            SECTIONS[cls.NODE] = cls

    def __post_init__(self) -> None:
        """Convert and check every field on its own."""
        for field in dataclasses.fields(self):
            value = converted(getattr(self, field.name), field, f'parameter {field.name}')
            object.__setattr__(self, field.name, value)

    def refuse(self, name: str, allowed_text: str, what: str = '') -> NoReturn:
        """Raise the ValueError of a parameter that does not go with the others.

        Parameters
        ----------
        name, allowed_text
            The parameter, and what is allowed.
        what
            What is wrong with it; empty: its value.
        """
        value, unit = getattr(self, name), self.__dataclass_fields__[name].metadata['unit']
        text = f'{value:g} {unit}'.rstrip() if isinstance(value, (int, float)) else shown(value)
        refuse(f'parameter {name} {what or f"is {text}"}', allowed_text)

    @classmethod
    def from_parameters(
        cls: type[ConfigType], parameters: Mapping[str, Any], where: str = ''
    ) -> ConfigType:
        """Build a set from names and values in the form that ROS uses.

        Parameters
        ----------
        parameters
            Values by name; nested names are joined by a point (``groups.TP``).
        where
            Prefix of error messages, for example the path of a file.

        Raises
        ------
        ValueError
            For an unknown name or a value that is not allowed.
        """
        try:
            return cls(**cls._nested(parameters))
        except ValueError as error:
            raise ValueError(f'{where}: {error}' if where else str(error)) from None

    @classmethod
    def _nested(cls, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by the names of fields, whatever names ROS has for parts of them."""
        known = [field.name for field in dataclasses.fields(cls)]
        values: dict[str, Any] = {}
        nested: dict[str, dict[str, Any]] = {}
        for name, value in parameters.items():
            head, point, tail = str(name).partition('.')  # In YAML a name may be a number.
            if head not in known or (point and (head != 'groups' or not tail)):
                label = f'{shown_name(str(name))} = {shown(value)}'
                raise ValueError(f'unknown parameter {label}; {cls._hint(str(name), known)}')
            if point:
                nested.setdefault(head, {})[tail] = value
            else:
                values[head] = value
        for head in nested.keys() & values.keys():
            names = listed([f'{head}.{tail}' for tail in nested[head]])
            refuse(f'parameter {head} is given beside {names}', 'either')
        return values | nested

    @classmethod
    def _hint(cls, name: str, known: Sequence[str]) -> str:
        """Return a hint at what the user may have meant by an unknown name."""
        owners = nodes_that_know(name) if cls.NODE else []
        near = difflib.get_close_matches(name, known, 1)
        if owners and cls.NODE not in owners:
            return f'it is a parameter of {", ".join(owners)}'
        return f'did you mean {near[0]}?' if near else f'allowed: {", ".join(sorted(known))}'

    @classmethod
    def from_yaml(cls: type[ConfigType], path: str | Path) -> ConfigType:
        """Read the node's section of a ROS parameter file.

        The whole section is checked, also if this set has only some of the parameters.

        Raises
        ------
        ValueError
            When the file cannot be read or holds a value that is not allowed; names the file.
        """
        whole = SECTIONS[cls.NODE].from_parameters(read_parameter_file(path, cls.NODE), str(path))
        return cls(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(cls)})

    def to_parameters(self) -> dict[str, Any]:
        """Return names and values in the form that ROS uses: flat lists, ``groups.TP``."""
        return _flattened(self._as_in_yaml(), '')

    def to_yaml(self) -> str:
        """Return the text of a ROS parameter file that :meth:`from_yaml` and the node read."""
        return yaml_text(self.to_document())

    def to_document(self) -> dict[str, Any]:
        """Return the content of a ROS parameter file, with the section of the node."""
        return {f'/**/{self.NODE}': {'ros__parameters': self._as_in_yaml()}}

    def _as_in_yaml(self) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = values[field.name] = getattr(self, field.name)
            if isinstance(value, dict):
                values[field.name] = {key: list(item) for key, item in value.items()}
            elif isinstance(value, tuple):
                pairs = value and isinstance(value[0], tuple)
                values[field.name] = (
                    [edge for pair in value for edge in pair] if pairs else [*value]
                )
        return values


#: The parameter set of each section of a parameter file, by the name of its node or command. The
#: definition of a set's class enters it here, in place of a base class with the same node, as
#: ``DetectorConfig`` replaces ``ChainConfig``.
SECTIONS: dict[str, type[ParameterSet]] = {}


def nodes_that_know(name: str) -> list[str]:
    """Return the nodes and commands of this package that have a parameter.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> nodes_that_know('sample_rate_hz'), nodes_that_know('channels')
    (['slip_detector'], ['slip_detector', 'slip_driver'])
    """
    head = name.partition('.')[0]
    return [node for node, its in SECTIONS.items() if head in its.__dataclass_fields__]


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
    >>> from slip_detector.parameters.files import shared_folder
    >>> file = shared_folder() / 'config' / 'slip_detector.yaml'
    >>> read_parameter_file(file, 'slip_detector')['groups.TP']
    [14, 16, 11, 9]
    """
    sections = _sections_in(path) if running else our_sections(path)
    merged: dict[str, Any] = {}
    for section, parameters in sections:
        if matches(section, running) if running else node_of(section) in (node, '**'):
            merged.update(_flattened(parameters, f'{path}: section {section}'))
    named = [name for name, _ in sections if node_of(name) == node and '*' not in name]
    if len(named) > 1 and not running:
        raise ValueError(f'{path}: has sections for {", ".join(named)}, allowed: one namespace')
    left_out = names_for_others(path, node)
    return {
        name: value
        for name, value in merged.items()
        if name.split('.')[0] not in OF_RCLPY and name not in left_out
    }


def names_for_others(path: str | Path, node: str) -> set[str]:
    """Return the names in the section for all nodes that are parameters of other nodes only.

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
    named: dict[str, set[str]] = {'**': set(), node: set()}
    for section, parameters in _sections_in(path):
        if node_of(section) in named:
            flat = _flattened(parameters, f'{path}: section {section}')
            named[node_of(section)].update(flat)
    owners = {name: nodes_that_know(name) for name in named['**'] - named[node]}
    return {name for name, nodes in owners.items() if nodes and node not in nodes}


def our_sections(path: str | Path) -> list[Section]:
    """Return the sections of a ROS parameter file for nodes and commands of this package.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has no such section; names the
        file.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> from slip_detector.parameters.files import shared_folder
    >>> [name for name, _ in our_sections(shared_folder() / 'config' / 'grasp.yaml')]
    ['/**/slip_detector', '/**/grasp_controller', '/**/slip_driver']
    """
    ours = [each for each in _sections_in(path) if node_of(each[0]) in (*SECTIONS, '**')]
    if not ours:
        raise ValueError(f'{path}: has no section of this package, allowed: {", ".join(SECTIONS)}')
    return ours


def _sections_in(path: str | Path) -> list[Section]:
    return list(sections_of(read_yaml(path), str(path)))


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
    """
    names = [name for name, _ in _sections_in(path)]
    if any(matches(name, node) for name in names if node_of(name) != '**'):
        return
    ours = [name for name, _ in our_sections(path) if node_of(name) == executable]
    if ours:
        raise ValueError(
            f'{path}: has sections for {", ".join(ours)}, none for this node, {node}, allowed: '
            f'{node} or /**/{node_of(node)}'
        )


def node_of(section: str) -> str:
    """Return the node that a section is for, without namespace; ``**`` means all nodes."""
    return section.rsplit('/', 1)[-1]


def _flattened(values: Mapping[str, Any], where: str, prefix: str = '') -> dict[str, Any]:
    """Return values by their names with points; ``where`` says in an error what has them."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        nested = isinstance(value, Mapping)
        inner = _flattened(value, where, f'{name}.') if nested else {name: value}
        if flat.keys() & inner:
            refuse(f'{where} has {min(flat.keys() & inner)} again', 'once')
        flat.update(inner)
    return flat


def with_parameters(given: str | Path | None, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a parameter file with changed values for the detector.

    Parameters
    ----------
    given
        The file to start from; None: the defaults of the detector.
    changes
        New values by the name of the parameter, in the form that ROS uses (flat lists).

    Returns
    -------
    dict
        The whole document, with the sections of other nodes but without comments.

    Raises
    ------
    ValueError
        When the file cannot be read; names it.

    Examples
    --------
    >>> document = with_parameters(None, {'threshold': 0.25})
    >>> document['/**/slip_detector']['ros__parameters']['threshold']
    0.25
    """
    detector = SECTIONS['slip_detector']
    document = detector().to_document() if given is None else read_yaml(given)
    sections = list(sections_of(document, str(given)))
    own = [parameters for name, parameters in sections if node_of(name) == detector.NODE]
    if not own:
        own = [{}]
        document[f'/**/{detector.NODE}'] = {'ros__parameters': own[0]}
    for name, parameters in sections:
        # A section for all nodes that comes after the detector's would override it.
        if node_of(name) == '**':
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return document
