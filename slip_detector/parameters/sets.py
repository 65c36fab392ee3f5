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
import logging
import re
from collections import namedtuple
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from slip_detector.parameters.fields import Field, converted, refuse, shown, shown_name
from slip_detector.parameters.files import read_yaml, yaml_text

if TYPE_CHECKING:
    from typing_extensions import dataclass_transform
else:  # Python 3.10 has none.

    def dataclass_transform(**_):
        """Return a decorator that tells type checkers what the subclasses of a class are."""
        return lambda base: base


#: Parameters that rclpy itself declares and reads for every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service')

#: First part of the names by which other nodes of rclpy change the quality of service of topics.
OF_QOS = 'qos_overrides'

#: What stands in place of a node's name in a section for all nodes.
ALL = ('**', '*')

#: Full name and parameters of a section of a parameter file; ``**`` in a name stands for any
#: namespaces, or for all nodes.
Section = tuple[str, dict[str, Any]]

ConfigType = TypeVar('ConfigType', bound='ParameterSet')


@dataclass_transform(frozen_default=True)
class ParameterSet:
    """Base class of all sets of parameters, frozen dataclasses: conversion, checks and YAML.

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

    __dataclass_fields__: ClassVar[dict[str, Field]]

    def __init_subclass__(cls) -> None:
        """Make this class a dataclass, and the set of its node's section if it has ``NODE``."""
        dataclasses.dataclass(frozen=True)(cls)
        if 'NODE' in cls.__dict__:
            SECTIONS[cls.NODE] = cls

    def __post_init__(self) -> None:
        """Convert and check every field on its own."""
        for field in dataclasses.fields(self):
            value = converted(getattr(self, field.name), field, f'parameter {field.name}')
            object.__setattr__(self, field.name, value)

    def require(self, holds: bool, name: str, allowed_text: str, what: str = '') -> None:
        """Raise the ValueError of a parameter that does not go with the others.

        Parameters
        ----------
        holds
            Whether it does.
        name, allowed_text
            The parameter, and what is allowed.
        what
            What is wrong with it; empty: its value.
        """
        if not holds:
            value, unit = getattr(self, name), self.__dataclass_fields__[name].metadata['unit']
            text = (
                f'{value:g} {unit}'.rstrip() if isinstance(value, (int, float)) else shown(value)
            )
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
        known = [field.name for field in dataclasses.fields(cls)]
        values: dict[str, Any] = {}
        groups: dict[str, Any] = {}
        try:
            for name, value in parameters.items():
                head, _, tail = str(name).partition('.')  # In YAML a name may be a number.
                if name in known:
                    values[name] = value
                elif head == 'groups' and head in known and tail:
                    groups[tail] = value
                else:
                    label = f'{shown_name(str(name))} = {shown(value)}'
                    raise ValueError(f'unknown parameter {label}; {cls._hint(str(name), known)}')
            if groups and 'groups' in values:
                refuse('parameter groups is given beside groups.<name>', 'one of both')
            return cls(**values | ({'groups': groups} if groups else {}))
        except ValueError as error:
            raise ValueError(f'{where}: {error}' if where else str(error)) from None

    @classmethod
    def without_strangers(
        cls, parameters: Mapping[str, Any], own: Collection[str] = ()
    ) -> tuple[dict[str, Any], list[str]]:
        """Leave out what is given to all nodes and is none of these parameters.

        Parameters
        ----------
        parameters
            Flat names and values.
        own
            Names that are given to the node of this set itself; they stay.

        Returns
        -------
        tuple
            What stays, and a remark on each name left out that may have been meant for this set:
            one edit away from a name of it, or in most letters like one, or a quality of service.
        """
        known = [*cls.__dataclass_fields__]
        stay, remarks = {}, []
        for name, value in parameters.items():
            head, _, tail = name.partition('.')
            near = difflib.get_close_matches(head, known, cutoff=0.8)
            near += [other for other in known if _is_one_edit(head, other)]
            if name in (*known, *own) or (tail and head == 'groups' in known):
                stay[name] = value
            elif head == OF_QOS or (near and not nodes_that_know(name)):
                label = f'{shown_name(name)} = {shown(value)}'
                hint = cls._hint(name, known)
                remarks.append(f'left out: parameter {label}, given to all nodes; {hint}')
        return stay, remarks

    @classmethod
    def _hint(cls, name: str, known: Sequence[str]) -> str:
        """Return a hint at what the user may have meant by an unknown name."""
        if name.startswith(OF_QOS):
            return 'the quality of service of the topics cannot be changed'
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
        return _flattened(self._as_in_yaml())

    def to_yaml(self) -> str:
        """Return the text of a ROS parameter file that :meth:`from_yaml` and the node read."""
        return yaml_text(self.to_document())

    def to_document(self) -> dict[str, Any]:
        """Return the content of a ROS parameter file, with the section of the node."""
        return {f'/**/{self.NODE}': {'ros__parameters': self._as_in_yaml()}}

    def _as_in_yaml(self) -> dict[str, Any]:
        return {
            field.name: _plain(getattr(self, field.name)) for field in dataclasses.fields(self)
        }


class CompiledSet(ParameterSet):
    """A set whose values compiled code takes, as a named tuple, which Numba can take."""

    Numbers: ClassVar[Any]

    def __init_subclass__(cls) -> None:
        """Make the class of the named tuple."""
        super().__init_subclass__()
        numbers: Any = namedtuple('Numbers', [*cls.__annotations__], module=cls.__module__)  # type: ignore[misc]
        cls.Numbers = numbers
        # By this name Numba finds the tuple of a function that it has compiled in another process.
        cls.Numbers.__qualname__ = f'{cls.__qualname__}.Numbers'

    def numbers(self) -> Any:
        """Return the named tuple of the values."""
        return self.Numbers(*(getattr(self, name) for name in self.Numbers._fields))


def _plain(value: Any) -> Any:
    """Return a value with lists in place of tuples, and a flat one in place of pairs."""
    if isinstance(value, dict):
        return {name: [*items] for name, items in value.items()}
    if isinstance(value, tuple):
        return [n for item in value for n in (item if isinstance(item, tuple) else (item,))]
    return value


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


def _is_one_edit(a: str, b: str) -> bool:
    """Return whether one letter more, less, other, or changed with the next makes a name another.

    Examples
    --------
    >>> [_is_one_edit('seed', other) for other in ('sed', 'seeds', 'sEed', 'sede', 'seed', 'sd')]
    [True, True, True, True, False, False]
    """
    while a[:1] and a[:1] == b[:1]:
        a, b = a[1:], b[1:]
    swapped = a[1::-1] + a[2:]
    return a != b and (swapped == b or b in (a[1:], b[:1] + a[1:], b[:1] + a))


def read_parameter_file(path: str | Path, node: str, running: str = '') -> dict[str, Any]:
    """Read the parameters that a ROS parameter file has for a node.

    Read are the sections for all nodes (``/**``), for the node in any namespace (``/**/node``) and
    for the node in one namespace. Of the sections for all nodes only parameters of this node are
    taken; on what may have been meant for it there is a warning on the log.

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
        if matches(section, running) if running else node_of(section) in (node, *ALL):
            flat = _flattened(parameters)
            if node_of(section) in ALL:
                flat, remarks = SECTIONS[node].without_strangers(flat)
                for remark in remarks:
                    logging.getLogger(__name__).warning('%s: %s', path, remark)
            merged.update(flat)
    named = [name for name, _ in sections if node_of(name) == node and '*' not in name]
    if len(named) > 1 and not running:
        raise ValueError(f'{path}: has sections for {", ".join(named)}, allowed: one namespace')
    return {name: value for name, value in merged.items() if name.split('.')[0] not in OF_RCLPY}


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
    ours = [each for each in _sections_in(path) if node_of(each[0]) in (*SECTIONS, *ALL)]
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
        own = content.get('ros__parameters', content) if isinstance(content, dict) else None
        if not isinstance(own, dict) or not content:
            raise ValueError(f'{path}: section {section} has no names under ros__parameters')
        if own is content:
            yield from sections_of(content, path, section)
        else:
            yield section, own


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


def names_given_to(path: str | Path, executable: str, node: str) -> set[str]:
    """Return the names in the sections of a parameter file for a node itself, not for all nodes.

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
    sections = _sections_in(path)
    own = [its for name, its in sections if matches(name, node) and node_of(name) not in ALL]
    ours = [] if own else [name for name, _ in our_sections(path) if node_of(name) == executable]
    if ours:
        raise ValueError(
            f'{path}: has sections for {", ".join(ours)}, none for this node, {node}, allowed: '
            f'{node} or /**/{node_of(node)}'
        )
    return {name for its in own for name in _flattened(its)}


def sections_for_others(path: str | Path, executable: str, nodes: Collection[str]) -> list[str]:
    """Return the sections of a parameter file for nodes of an executable, but for none of these.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / 'hand.yaml'
    ...     _ = file.write_text('/ringg/slip_driver: {ros__parameters: {seed: 3}}')
    ...     sections_for_others(file, 'slip_driver', ['/ring/slip_driver'])
    ['/ringg/slip_driver']
    """
    kinds = {executable, *map(node_of, nodes)}
    names = [name for name, _ in _sections_in(path) if node_of(name) in kinds]
    return [name for name in names if not any(matches(name, node) for node in nodes)]


def node_of(section: str) -> str:
    """Return the node that a section is for, without namespace; one of :data:`ALL` means all."""
    return section.rsplit('/', 1)[-1]


def _flattened(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Return values by their names with points."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        flat |= _flattened(value, f'{name}.') if isinstance(value, Mapping) else {name: value}
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
        if node_of(name) in ALL:
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return document
