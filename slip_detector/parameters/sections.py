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

"""ROS parameter files: which of their sections are for which node or command."""

import pkgutil
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.parameters.fields import quote, quote_name, refuse
from slip_detector.parameters.yaml_files import read_yaml

#: The parameter set of each section of a parameter file, by the name of its node or command.
SECTIONS = {
    'slip_detector': 'slip_detector.parameters.detector:DetectorConfig',
    'slip_driver': 'slip_detector.parameters.driver:DriverConfig',
    'slip_evaluate': 'slip_detector.parameters.evaluation:EvaluationConfig',
    'slip_tune': 'slip_detector.parameters.evaluation:TuneConfig',
    'grasp_controller': 'slip_detector.parameters.grasp:GraspConfig',
}

#: What ROS takes for the full name of a node, with ``*`` for any name and ``**`` for any names.
_NAME = r'(\*\*?|[A-Za-z_][A-Za-z0-9_]{0,254})'
SECTION = re.compile(f'/?{_NAME}(/{_NAME})*')

#: Full name and parameters of a section. ``**`` in the name stands for any namespaces, or for all
#: nodes; names of parameters may be nested.
Section = tuple[str, dict[str, Any]]

#: Parameters that rclpy itself declares and reads for every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service')


def is_of_rclpy(name: str) -> bool:
    """Return whether rclpy itself has a parameter, by its flat name."""
    return name.partition('.')[0] in OF_RCLPY


#: What stands in place of a node's name in a section for all nodes.
ALL = ('**', '*')


def set_of(node: str) -> Any:
    """Return the parameter set of a node or command of this package."""
    return pkgutil.resolve_name(SECTIONS[node])


def node_of(section: str) -> str:
    """Return the node that a section is for, without namespace; one of :data:`ALL` means all."""
    return section.rsplit('/', 1)[-1]


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


def sections_of(document: Mapping[str, Any], path: object, above: str = '') -> Iterator[Section]:
    """Yield the sections of the content of a ROS parameter file.

    Parameters
    ----------
    document
        The content of the file.
    path
        The file, for messages.
    above
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
        section = f'{above}/{name}' if above else name
        below = dict(content) if isinstance(content, dict) else {}
        own = below.pop('ros__parameters', {} if below else None)
        if not isinstance(own, dict):
            raise ValueError(f'{path}: section {section} has no names under ros__parameters')
        yield from sections_of(below, path, section)
        if 'ros__parameters' in content:
            if not SECTION.fullmatch(section):
                text = 'letters, digits, _, as in /finger/slip_detector or /**/slip_detector'
                refuse(f'{path}: section {quote(section)} is no name of a node', text)
            check_values(own, path)
            yield section, own


def check_values(parameters: Mapping[str, Any], where: object) -> None:
    """Check that ROS reads these values too; a ValueError begins with ``where``.

    Examples
    --------
    >>> check_values({'passband_hz': [10, 100.0]}, 'a.yaml')
    Traceback (most recent call last):
    ValueError: a.yaml: passband_hz is [10, 100.0], allowed: numbers of one kind: write 10.0
    """
    for name, value in flattened(parameters).items():
        items = value if isinstance(value, list) else [value]
        kinds = {type(item) for item in items}
        if len(kinds) > 1 or not kinds <= {bool, int, float, str}:
            text = 'a number, a text, true or false, or a list of one of these kinds'
            if kinds == {int, float}:
                whole = next(item for item in items if isinstance(item, int))
                text = f'numbers of one kind: write {float(whole)}'
            said = 'nothing' if value is None else quote(value)
            refuse(f'{where}: {quote_name(name)} is {said}', text)


class FileParameters(NamedTuple):
    """What a ROS parameter file has for a node of this package."""

    #: Values by flat names (``groups.TP``), without the parameters of rclpy.
    values: dict[str, Any]
    #: Those that are given to this node, and not to all nodes.
    own: dict[str, Any]
    #: Sections for other nodes that end with the name of the node or of its executable.
    unmatched: list[str]


def parameters_for(path: str | Path, executable: str, node: str = '') -> FileParameters:
    """Return what a ROS parameter file has for a node.

    ROS ignores sections that do not match, and the node would run with its defaults. A node with
    another name than its executable is given the values for the executable, unless the file has
    values for the node.

    Parameters
    ----------
    path
        The YAML file.
    executable
        Name of the node's executable, which is its default name.
    node
        Full name of the node; empty: the default name, in any namespace.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has no section of this package;
        without a full name, when there are sections for several namespaces; for a node, when all
        sections for its name or its executable's are for other nodes, or when it would be given
        a value for its executable that the file has for all nodes too, as ROS gives it that.

    Examples
    --------
    >>> from slip_detector.parameters.files import shared_folder
    >>> file = shared_folder() / 'config' / 'slip_detector.yaml'
    >>> parameters_for(file, 'slip_detector').values['groups.TP']
    [14, 16, 11, 9]
    """
    sections = [
        (section, {n: value for n, value in flattened(values).items() if not is_of_rclpy(n)})
        for section, values in sections_of(read_yaml(path), path)
    ]
    names = [name for name, _ in sections]
    candidates = [name for name in names if node_of(name) in (executable, node_of(node))]
    if not candidates and not any(node_of(name) in (*SECTIONS, *ALL) for name in names):
        refuse(f'{path}: has no section of this package', ', '.join(SECTIONS))
    full_names = [name for name in candidates if '*' not in name]
    if not node and len(full_names) > 1:
        refuse(f'{path}: has sections for {", ".join(full_names)}', 'one namespace')
    default = f'{node.rpartition("/")[0]}/{executable}'
    matching = [name for name in names if not node or matches(name, node)]
    for_node = [name for name in candidates if name in matching]
    for_default = [name for name in candidates if matches(name, default)]
    unmatched = [name for name in candidates if name not in for_node + for_default]
    if unmatched and not for_node + for_default:
        what = f'{path}: has sections for {", ".join(unmatched)}, none for this node, {node}'
        refuse(what, f'{node} or /**/{node_of(node)}')

    def values_in(chosen: Collection[str]) -> dict[str, Any]:
        """Return the values in some sections; of two the later one holds."""
        return {n: v for name, values in sections if name in chosen for n, v in values.items()}

    for_all = [name for name in matching if node_of(name) in ALL]
    own = values_in(for_node or for_default)
    twice = own.keys() & values_in(for_all).keys()
    if twice and not for_node:
        what = f'{path}: has {", ".join(sorted(twice))} for {executable} and for all nodes'
        refuse(what, f'a section for this node, {node}')
    return FileParameters(values_in([*for_all, *(for_node or for_default)]), own, unmatched)


def parameter_file(configs: Mapping[str, Any], file: str | Path | None = None) -> dict[str, Any]:
    """Return the content of a parameter file for nodes with these configurations.

    Parameters
    ----------
    configs
        By the full names of the nodes, all of one kind. A single one is written for a node in any
        namespace; several are written each for the node of that name.
    file
        The file with which the nodes were started, if any: its sections for other nodes are
        copied, and so is what rclpy reads for these nodes, such as use_sim_time.

    Raises
    ------
    ValueError
        When that file cannot be read; names it.

    Examples
    --------
    >>> from slip_detector.parameters import DetectorConfig
    >>> document = parameter_file({'/thumb/slip_detector': DetectorConfig(threshold=0.25)})
    >>> list(document), document['/**/slip_detector']['ros__parameters']['threshold']
    (['/**/slip_detector'], 0.25)
    """
    document: dict[str, Any] = {}
    in_file = [*sections_of(read_yaml(file) if file else {}, file)]
    nodes, knowing = {*map(node_of, configs)}, [[config.NODE] for config in configs.values()]
    for section, values in in_file:
        for_all = node_of(section) in ALL
        kept = {n: values[n] for n in values if not for_all or nodes_that_know(n) not in knowing}
        if kept and node_of(section) not in nodes:
            document[section] = {'ros__parameters': kept}
    # Last, because of two sections for a node the later one holds.
    for name, config in configs.items():
        section = name if len(configs) > 1 else f'/**/{node_of(name)}'
        kept = {}
        for other, values in in_file:
            if matches(other, name) or matches(section, f'/{other.lstrip("/")}'):
                kept |= {n: value for n, value in values.items() if is_of_rclpy(n)}
        document[section] = {'ros__parameters': {**kept, **config.to_yaml()}}
    return document


def flattened(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Return values by their names with points.

    Examples
    --------
    >>> flattened({'threshold': 0.5, 'groups': {'TP': [1, 2]}})
    {'threshold': 0.5, 'groups.TP': [1, 2]}
    """
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        nested = isinstance(value, Mapping) and value
        flat |= flattened(value, f'{name}.') if nested else {name: value}
    return flat


def nodes_that_know(name: str) -> list[str]:
    """Return the nodes and commands of this package that have a parameter.

    Examples
    --------
    >>> nodes_that_know('sample_rate_hz'), nodes_that_know('channels')
    (['slip_detector'], ['slip_detector', 'slip_driver'])
    """
    head = name.partition('.')[0]
    return [node for node in SECTIONS if head in set_of(node).__dataclass_fields__]
